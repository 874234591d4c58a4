"""`jaxenstein export`: write one trained agent into a small file that you can share."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..progress import Progress
from .arguments import Parser, UsageError, add_run, add_seed, flag, whole
from .evaluate import table
from .opening import baselines, printing_warnings

HELP = "write a trained agent into a small file"
DESCRIPTION = """\
Write one agent of a run directory into a file: its network with a description of every layer, the
config of its run, and its score over --episodes episodes. 'play', 'record' and 'evaluate' accept
the file in place of a run directory. --program also writes the agent as a jax.export program, which
runs on CPUs and GPUs and needs only jax and flatbuffers.
"""
EPILOG = """\
examples:
  jaxenstein export runs/simple-rnd --out simple.npz
  jaxenstein play --policy simple.npz
  jaxenstein export runs/simple-rnd --out simple.npz --program simple.jaxexport
"""


def fill(parser: Parser) -> None:
    """Add the arguments."""
    parser.add_argument("folder", metavar="RUN", type=Path, help="a run directory")
    flag(parser, "--out FILE.npz", "the file to write", Path, required=True)
    add_run(parser)
    weights = "precision of the weights, float16 or float32"
    flag(parser, "--weights NAME", weights, str, "float16", choices=("float16", "float32"))
    flag(parser, "--episodes N", "episodes for the score", whole(), 100)
    add_seed(parser)
    flag(parser, "--program FILE.jaxexport", "also write the agent as a program", Path)
    greedy = "the program takes the most likely actions (default: it samples them)"
    flag(parser, "--greedy", greedy)


def run(options: argparse.Namespace) -> None:
    """Write the files, and print the score of the agent."""
    if options.greedy and options.program is None:
        raise UsageError("jaxenstein export: --greedy needs --program")
    agents = baselines("agents")
    total = len(agents.WAYS) * options.episodes
    with (
        printing_warnings(),
        Progress(total, "evaluating", unit="episodes", compiles=True) as progress,
    ):
        results = agents.export_policy(
            options.folder,
            options.out,
            options.number,
            weights=options.weights,
            episodes=options.episodes,
            seed=options.seed,
            program=options.program,
            greedy=options.greedy,
            notify=progress.update,
        )
    print(table(results))
    for path in filter(None, (options.out, options.program)):
        print(f"wrote {path}, {path.stat().st_size / 1e3:.0f} kB")
