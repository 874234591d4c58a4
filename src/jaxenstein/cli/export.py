"""`jaxenstein export`: one trained agent as a small file, to be handed on."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..progress import Progress
from .arguments import Parser, add_run, add_seed, flag, whole
from .evaluate import table
from .opening import baselines, telling_warnings

HELP = "write a trained agent into a small file"
DESCRIPTION = """\
Write one agent of a run directory into a file of its own: its network, the configuration of its
run, and what it achieves in so many episodes. 'play', 'record' and 'evaluate' take the file's name
where they take a run directory.
"""
EPILOG = """\
examples:
  jaxenstein export runs/simple-rnd --out simple.npz
  jaxenstein play --policy simple.npz
"""


def fill(parser: Parser) -> None:
    """Add the arguments."""
    parser.add_argument("folder", metavar="RUN", type=Path, help="a run directory")
    flag(parser, "--out FILE.npz", "the file to write", Path, required=True)
    add_run(parser)
    weights = "precision of the network's numbers, float16 or float32"
    flag(parser, "--weights NAME", weights, str, "float16", choices=("float16", "float32"))
    flag(parser, "--episodes N", "episodes that its score is of", whole(), 100)
    add_seed(parser)


def run(options: argparse.Namespace) -> None:
    """Write the file, and say how good its agent is."""
    agents = baselines("agents")
    total = len(agents.WAYS) * options.episodes
    with (
        telling_warnings(),
        Progress(total, "evaluating", unit="episodes", compiles=True) as progress,
    ):
        results = agents.export_policy(
            options.folder,
            options.out,
            options.number,
            weights=options.weights,
            episodes=options.episodes,
            seed=options.seed,
            notify=progress.update,
        )
    print(table(results))
    print(f"wrote {options.out}, {options.out.stat().st_size / 1e3:.0f} kB")
