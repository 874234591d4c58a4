"""`jaxenstein plot`: learning curves."""

from __future__ import annotations

import argparse
import collections
import dataclasses
from pathlib import Path

from .arguments import Parser, flag, whole
from .opening import baselines

HELP = "plot learning curves"
DESCRIPTION = """\
Plot the learning curves of run directories: the mean over seeds with a 95 % bootstrap band. You can
plot a run while it trains.

Metrics of other programs can be plotted beside them. A file has one JSON object per line, with a
column for the step and optionally a column 'seed'. In a TensorBoard folder (needs tensorboard),
every folder with event files is a seed. Steps should count decisions over all environments of a
seed, as 'jaxenstein train' does.
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
    what = "run directories, JSON Lines files, or TensorBoard folders"
    parser.add_argument("runs", nargs="+", metavar="PATH", type=Path, help=what)
    parser.add_argument(
        "--out",
        action="append",
        required=True,
        type=Path,
        metavar="FILE",
        help="the plot, .png or .svg; repeat for several files",
    )
    metric = "the metric (default: return); repeat to name alternatives for some PATHs"
    flag(parser, "--metric NAME", metric, str, action="append")
    step = "the step column in JSON Lines (default: known names); repeat to name alternatives"
    flag(parser, "--step NAME", step, str, action="append")
    parser.add_argument(
        "--over",
        choices=("decisions", "minutes"),
        default="decisions",
        help="the horizontal axis: decisions of each run (default), or minutes of training of all "
        "runs of a folder together",
    )
    flag(parser, "--points N", "pool the updates into at most N points", whole(), 50)
    parser.add_argument("--title", default="", metavar="TEXT", help="title of the plot")


def run(options: argparse.Namespace) -> None:
    """Plot the curves, and print the names of the files."""
    drawing = baselines("curves")
    for path in options.out:
        drawing.check_picture(path)
    metrics, how = options.metric or ["return"], (options.points, options.over, options.step or ())
    each = [(path, drawing.curves_of(path, metrics, *how)) for path in options.runs]
    labels = collections.Counter(curve.label for _, curves in each for curve in curves)
    # Runs in folders of one name are told apart by their paths.
    found = [
        dataclasses.replace(curve, label=f"{path.parent}/{curve.label}")
        if labels[curve.label] > 1
        else curve
        for path, curves in each
        for curve in curves
    ]
    drawing.save_plot(found, options.out, metrics[0], options.title)
    print(f"wrote {' and '.join(map(str, options.out))}")
