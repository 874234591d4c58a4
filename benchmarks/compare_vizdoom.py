"""My Way Home here and in ViZDoom, measured in turn on one core.

    python -m benchmarks.compare_vizdoom [--core N] [--rounds N] [--json FILE]

Needs the `bench` extra. The subjects are described in README.md beside this file.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.interleave import SubjectError, Worker, add_options, median_ratio, run_rounds, tell
from jaxenstein.files import atomic, check_writable
from jaxenstein.speed.measuring import describe_machine, summarise

BATCHES = (64, 128, 256, 512, 1024)
RESIZED = "vizdoom-gymnasium"
RAW = "vizdoom-raw"
TITLES = {
    RESIZED: "ViZDoom, Gymnasium, 320x240 -> 64x64 by area",
    RAW: "ViZDoom, raw game, 160x120, no resize",
    "loop": "this project, 64x64, Python loop, 1 environment",
    "loop-async": "this project, 64x64, Python loop, 1 environment, asynchronous dispatch",
} | {f"scan-{batch}": f"this project, 64x64, scan, {batch} environments" for batch in BATCHES}


def main(argv: Sequence[str] | None = None) -> None:
    """Run the comparison and print its table."""
    arguments = _parser().parse_args(argv)
    if arguments.json:
        check_writable(arguments.json)
    core = arguments.core if hasattr(os, "sched_setaffinity") else None
    workers = start_workers([sys.executable, *arguments.also_python], arguments.only, core)
    try:
        rates = run_rounds(workers, arguments.rounds, arguments.seconds)
    finally:
        for worker in workers.values():
            worker.close()
    print_table(rates)
    disturbed = sum(len(worker.disturbed) for worker in workers.values())
    if disturbed:
        print(f"\nOther processes used the core during {disturbed} chunks: not a quiet machine.")
    if arguments.json:
        report = {
            **describe_machine(),
            "settings": {name: value for name, value in vars(arguments).items() if name != "json"},
            "subjects": {
                label: worker.description | {"disturbed_chunks": worker.disturbed}
                for label, worker in workers.items()
            },
            "steps_per_second": {
                label: summarise(np.array(values)) for label, values in rates.items()
            },
        }
        with atomic(arguments.json) as path:
            path.write_text(json.dumps(report, indent=1))


def start_workers(
    pythons: Sequence[str], only: Sequence[str], core: int | None
) -> dict[str, Worker]:
    """Start ViZDoom's subjects once and the project's under every interpreter, one at a time."""
    workers: dict[str, Worker] = {}
    for number, python in enumerate(pythons):
        for name, title in TITLES.items():
            peer = name in (RESIZED, RAW)
            if (peer and number) or not (peer or not only or name in only):
                continue
            tell(f"starting {name} ...")
            worker = Worker(name, python, core, jax=not peer)
            workers[name if peer else _label(title, worker)] = worker
    return workers


def _label(title: str, worker: Worker) -> str:
    versions: dict[str, Any] = worker.description["versions"]
    return f"{title}, Python {versions['python']}, JAX {versions['jax']}"


def print_table(rates: dict[str, list[float]]) -> None:
    """Print a Markdown table: median, quartiles, and ratios to ViZDoom's two subjects."""
    print("| subject | steps/s | quartiles | x resized | x raw |")
    print("|---|---:|---:|---:|---:|")
    for label, values in rates.items():
        found = summarise(np.array(values))
        ratios = [median_ratio(values, rates[peer]) for peer in (RESIZED, RAW)]
        quartiles = f"{found['lower_quartile']:,.0f} - {found['upper_quartile']:,.0f}"
        cells = [TITLES.get(label, label), f"{found['median']:,.0f}", quartiles]
        cells += [f"{ratio:.2f}" for ratio in ratios]
        print(f"| {' | '.join(cells)} |")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description="Compare My Way Home with ViZDoom on one core.")
    add_options(parser)
    parser.add_argument(
        "--only",
        nargs="+",
        default=[],
        choices=[name for name in TITLES if name not in (RESIZED, RAW)],
        metavar="SUBJECT",
        help="of the project's subjects, only these: loop, loop-async, scan-64 ... scan-1024",
    )
    return parser


if __name__ == "__main__":
    try:
        main()
    except SubjectError as error:
        raise SystemExit(str(error)) from error
