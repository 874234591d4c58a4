"""`jaxenstein plot`: learning curves."""

from __future__ import annotations

import argparse
from pathlib import Path

from .arguments import Parser, flag, whole
from .opening import baselines

HELP = "draw learning curves of runs that 'jaxenstein train' made, and of others beside them"
DESCRIPTION = """\
Draw the learning curves of run directories: the mean over seeds, and the band in which it lies
with 95 % confidence by a bootstrap over seeds. A run that still trains is drawn as far as it is.

Metrics of other programs are drawn by the same rules: a file with a JSON object in each line, or a
folder of TensorBoard (which needs tensorboard), in which each folder with event files is a seed.
In JSON lines a column says the step and perhaps one named 'seed' the seed. Steps should count
decisions over all environments of a seed, as those of 'jaxenstein train' do.
"""
EPILOG = """\
examples:
  jaxenstein plot runs/simple-ppo runs/simple-rnd --out curves.png
  jaxenstein plot runs/simple-rnd --metric success --out success.png --out success.svg
  jaxenstein plot runs/simple-rnd mine/metrics.jsonl tensorboard/mine --out curves.png
  jaxenstein plot runs/simple-rnd mine.jsonl --metric return --metric score --out curves.png
"""


def fill(parser: Parser) -> None:
    """Add the arguments."""
    what = "run directories, files of JSON lines, or folders of TensorBoard"
    parser.add_argument("runs", nargs="+", metavar="PATH", type=Path, help=what)
    parser.add_argument(
        "--out",
        action="append",
        required=True,
        type=Path,
        metavar="FILE",
        help="the picture, .png or .svg; may be given again",
    )
    metric = "a column (default: return); may be given again: the first that a PATH has counts"
    flag(parser, "--metric NAME", metric, str, action="append")
    step = "the column of steps in JSON lines (default: by its name); may be given again"
    flag(parser, "--step NAME", step, str, action="append")
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
    metrics, how = options.metric or ["return"], (options.points, options.over, options.step or ())
    found = [curve for path in options.runs for curve in drawing.curves_of(path, metrics, *how)]
    drawing.save_plot(found, options.out, metrics[0], options.title)
    print(f"wrote {' and '.join(map(str, options.out))}")
