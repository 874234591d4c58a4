"""`jaxenstein export`: one trained agent as a small file, to be handed on."""

from __future__ import annotations

import argparse
from pathlib import Path

from .arguments import add_run, add_seed, whole
from .evaluate import table
from .training import baselines

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


def add_command(commands: argparse._SubParsersAction) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "export",
        help="write a trained agent into a small file",
        description=DESCRIPTION,
        epilog=EPILOG,
    )
    parser.add_argument("folder", metavar="RUN", type=Path, help="a run directory")
    parser.add_argument(
        "--out", type=Path, required=True, metavar="FILE.npz", help="the file to write"
    )
    add_run(parser)
    parser.add_argument(
        "--weights",
        choices=("float16", "float32"),
        default="float16",
        metavar="NAME",
        help="precision of the network's numbers, float16 or float32 (default %(default)s)",
    )
    parser.add_argument(
        "--episodes",
        type=whole(),
        default=100,
        metavar="N",
        help="episodes that its score is of (default %(default)s)",
    )
    add_seed(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Write the file, and say how good its agent is."""
    results = baselines("agents").export_policy(
        options.folder,
        options.out,
        options.number,
        weights=options.weights,
        episodes=options.episodes,
        seed=options.seed,
    )
    print(table(results))
    print(f"wrote {options.out}, {options.out.stat().st_size / 1e3:.0f} kB")
