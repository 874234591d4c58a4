"""`jaxenstein sweep`: train all runs of a grid in parallel, by default the paper's grids."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from ..files import check_links
from .arguments import Parser, UsageError, flag, reader, whole
from .listing import between, format_table
from .opening import (
    add_config,
    add_training_options,
    baselines,
    check_effect,
    given_training,
    named,
    printing_warnings,
)
from .train import INTERRUPTED, add_training, carry_out, openings, spread

if TYPE_CHECKING:
    from ..baselines.runs.sweeps import Point

HELP = "train over a grid of hyperparameters"
DESCRIPTION = """\
Train every algorithm at every point of its grid, with five seeds. One compiled program trains all
runs of an algorithm in parallel, in one run directory per algorithm below DIR. The final table
sorts the points by mean return over the last tenth of training. A warning names each diverged run,
as in 'train'; the exit status is 3 if all runs diverged.

The default grids are those of the paper: a single point for ppo; bonus_reward 0.1, 1, 10 and
rnd_loss 0.01, 0.1 for rnd; bonus_learning_rate 3e-4, 1e-4 and bonus_reward 0.1, 1, 10 for icm. A
flag that fixes one of these numbers takes it out of the grid.
"""
EPILOG = """\
examples:
  jaxenstein sweep --env simple --total-steps 3e6 --out runs/simple
  jaxenstein sweep --out runs/simple --env simple --total-steps 3e6 --resume
  jaxenstein sweep --algo rnd --grid bonus_reward=0.1,1 --at-once 10 --out runs/rnd
  jaxenstein sweep --algo ppo rnd --no-grid --minutes 25 --config maze.toml --out runs/maze

--resume skips finished runs and continues the others; repeat the same options.

The best of many points looks better than it is. Train it again with other seeds (--seed) before you
compare it with anything.
"""


def fill(parser: Parser) -> None:
    """Add the arguments, including a flag for every option of the baselines."""
    out = parser.add_argument_group("sweep")
    flag(out, "--out DIR", "folder for the run directories", Path, required=True)
    flag(out, "--resume", "continue the sweep in DIR")
    add_config(out)
    which = f"the algorithms (default: {' '.join(baselines('sweeps').swept())})"
    algorithms = baselines("options").all_options()["algo"].domain
    flag(out, "--algo NAME", which, reader(algorithms), nargs="+")
    few = "train at most N runs in parallel, to save memory (default: a whole grid)"
    flag(out, "--at-once N", few, whole())
    flag(out, "--no-grid", "train a single point, with the given or default hyperparameters")
    add_training(parser)
    add_training_options(parser, without=("algo",), seeds=baselines("sweeps").SEEDS)


def run(options: argparse.Namespace) -> int:
    """Train one grid after the other, and print a table of the results."""
    spread(options)
    sweeps = baselines("sweeps")
    given = named(given_training(options), "sweep")
    algos = options.algo or ([given["algo"]] if "algo" in given else sweeps.swept())
    if options.no_grid and given.get("grid"):
        raise UsageError("jaxenstein sweep: give either --no-grid or --grid, not both")
    with printing_warnings():
        check_effect(options, algos)
        planned = sweeps.plan(given, algos, options.at_once, paper=not options.no_grid)
    check_links(options.out)
    code = carry_out(openings(options, planned), options)
    if code != INTERRUPTED:
        print(table(sweeps.summary([options.out / name for name in planned])))
    return code


def table(points: list[Point]) -> str:
    """A table of the points."""
    rows = [("RUNS", "SEEDS", "RETURN", "95 %", "SUCCESS", "95 %")]
    for point in points:
        earned, success = point.earned, point.success
        rows.append(
            (
                point.label,
                f"{point.runs}, {point.diverged} diverged" if point.diverged else str(point.runs),
                f"{earned.mean:.3g}",
                between(earned, ".3g"),
                f"{success.mean:.1%}",
                between(success, ".1%"),
            )
        )
    return format_table(rows, right=(1, 2, 3, 4, 5))
