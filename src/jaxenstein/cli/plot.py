"""`jaxenstein plot`: learning curves."""

from __future__ import annotations

import argparse
from pathlib import Path

from .arguments import whole
from .training import baselines

DESCRIPTION = """\
Draw the learning curves of run directories: the mean over seeds, and the band in which it lies
with 95 % confidence by a bootstrap over seeds. A run that still trains is drawn as far as it is.
"""
EPILOG = """\
examples:
  jaxenstein plot runs/simple-ppo runs/simple-rnd --out curves.png
  jaxenstein plot runs/simple-rnd --metric success --out success.png --out success.svg
"""


def add_command(commands: argparse._SubParsersAction) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "plot",
        help="draw learning curves of runs that 'jaxenstein train' made",
        description=DESCRIPTION,
        epilog=EPILOG,
    )
    parser.add_argument("runs", nargs="+", metavar="RUN", type=Path, help="run directories")
    parser.add_argument(
        "--out",
        action="append",
        required=True,
        type=Path,
        metavar="FILE",
        help="the picture, .png or .svg; may be given again",
    )
    parser.add_argument(
        "--metric",
        default="return",
        metavar="NAME",
        help="a column of metrics.jsonl (default %(default)s)",
    )
    parser.add_argument(
        "--points",
        type=whole(),
        default=50,
        metavar="N",
        help="pool the updates into N parts (default %(default)s)",
    )
    parser.add_argument("--title", default="", metavar="TEXT", help="a line above the plot")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Draw, and say what was written."""
    drawing = baselines("curves")
    for path in options.out:
        drawing.check_picture(path)
    found = [
        curve
        for folder in options.runs
        for curve in drawing.curves_of(folder, options.metric, options.points)
    ]
    drawing.save_plot(found, options.out, options.metric, options.title)
    print(f"wrote {' and '.join(map(str, options.out))}")
