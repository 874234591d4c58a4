"""`jaxenstein plot`: learning curves."""

from __future__ import annotations

import argparse
from pathlib import Path

from .arguments import Parser, flag, whole
from .opening import baselines

HELP = "draw learning curves of runs that 'jaxenstein train' made"
DESCRIPTION = """\
Draw the learning curves of run directories: the mean over seeds, and the band in which it lies
with 95 % confidence by a bootstrap over seeds. A run that still trains is drawn as far as it is.
"""
EPILOG = """\
examples:
  jaxenstein plot runs/simple-ppo runs/simple-rnd --out curves.png
  jaxenstein plot runs/simple-rnd --metric success --out success.png --out success.svg
"""


def fill(parser: Parser) -> None:
    """Add the arguments."""
    parser.add_argument("runs", nargs="+", metavar="RUN", type=Path, help="run directories")
    parser.add_argument(
        "--out",
        action="append",
        required=True,
        type=Path,
        metavar="FILE",
        help="the picture, .png or .svg; may be given again",
    )
    flag(parser, "--metric NAME", "a column of metrics.jsonl", str, "return")
    parser.add_argument(
        "--over",
        choices=("decisions", "minutes"),
        default="decisions",
        help="what the curves go along: decisions of a run, the default, or minutes of training, "
        "of all runs of a folder together",
    )
    flag(parser, "--points N", "pool the updates into N parts", whole(), 50)
    parser.add_argument("--title", default="", metavar="TEXT", help="a line above the plot")


def run(options: argparse.Namespace) -> None:
    """Draw, and say what was written."""
    drawing = baselines("curves")
    for path in options.out:
        drawing.check_picture(path)
    found = [
        curve
        for folder in options.runs
        for curve in drawing.curves_of(folder, options.metric, options.points, options.over)
    ]
    drawing.save_plot(found, options.out, options.metric, options.title)
    print(f"wrote {' and '.join(map(str, options.out))}")
