"""What each adapter costs: steps a second beside the native environments, measured in turn.

    python -m benchmarks.adapters [--envs 64,1024] [--core N] [--json FILE]

Adapters whose partner is not installed are named and left out; `--also-python PATH` measures
those that another interpreter has, beside the native environments there. README.md beside this
file says what the figures mean.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from benchmarks.interleave import SubjectError, Worker, add_options, median_ratio, run_rounds, tell
from jaxenstein.files import atomic, check_writable
from jaxenstein.speed.measuring import describe_machine, summarise


class Adapter(NamedTuple):
    """One row of the table.

    Attributes:
        title: for people.
        module: what has to be importable; "" for none.
        single: whether it has one environment, whatever `--envs` says.
    """

    title: str
    module: str = ""
    single: bool = False


SCAN, LOOP = "scan", "adapter-loop"
ADAPTERS: dict[str, Adapter] = {
    SCAN: Adapter("native, in a scan"),
    LOOP: Adapter("native, one jitted call a step from Python"),
    "adapter-gymnax": Adapter("gymnax, in a scan", "gymnax"),
    "adapter-stoa": Adapter("Stoa, in a scan", "stoa"),
    "adapter-brax": Adapter("Brax with its wrappers, in a scan", "brax"),
    "adapter-torch": Adapter("Torch", "torch"),
    "adapter-gymnasium-same-step": Adapter("Gymnasium vector, same-step", "gymnasium"),
    "adapter-gymnasium-next-step": Adapter("Gymnasium vector, next-step", "gymnasium"),
    "adapter-sb3": Adapter("Stable-Baselines3", "stable_baselines3"),
    "adapter-gymnasium-single": Adapter("Gymnasium, one environment", "gymnasium", single=True),
}


def main(argv: Sequence[str] | None = None) -> None:
    """Measure and print a table for each interpreter."""
    arguments = _parser().parse_args(argv)
    if arguments.json:
        check_writable(arguments.json)
    core = arguments.core if hasattr(os, "sched_setaffinity") else None
    report = []
    for python in [sys.executable, *arguments.also_python]:
        missing = missing_modules(python)
        names = subjects(arguments.envs, arguments.only, missing)
        workers = start_workers(names, python, core)
        try:
            rates = run_rounds(workers, arguments.rounds, arguments.seconds)
        finally:
            for worker in workers.values():
                worker.close()
        versions = {}
        for worker in workers.values():
            versions |= worker.description["versions"]
        disturbed = {name: worker.disturbed for name, worker in workers.items()}
        print_table(rates, versions, missing, sum(map(len, disturbed.values())))
        found = {name: summarise(np.array(values)) for name, values in rates.items()}
        report.append({"versions": versions, "steps_per_second": found, "disturbed": disturbed})
    if arguments.json:
        settings = {name: str(value) for name, value in vars(arguments).items()}
        text = json.dumps(
            {**describe_machine(), "settings": settings, "interpreters": report}, indent=1
        )
        with atomic(arguments.json) as path:
            path.write_text(text)


def missing_modules(python: str) -> list[str]:
    """The partners' modules that an interpreter cannot find."""
    modules = sorted({adapter.module for adapter in ADAPTERS.values() if adapter.module})
    code = (
        "import importlib.util, json, sys\n"
        "print(json.dumps([m for m in sys.argv[1:] if importlib.util.find_spec(m) is None]))"
    )
    done = subprocess.run([python, "-I", "-c", code, *modules], capture_output=True, check=True)
    return json.loads(done.stdout)


def subjects(envs: Sequence[int], only: Sequence[str], missing: Sequence[str]) -> list[str]:
    """Names of what is measured: the native ones of every size, and the adapters there are."""
    names = []
    for kind, adapter in ADAPTERS.items():
        chosen = not only or kind.removeprefix("adapter-") in only or not adapter.module
        if adapter.module in missing or not chosen:
            continue
        if adapter.single:
            names.append(f"{LOOP}-1")
        names += [f"{kind}-{batch}" for batch in ([1] if adapter.single else envs)]
    return list(dict.fromkeys(names))


def start_workers(names: Sequence[str], python: str, core: int | None) -> dict[str, Worker]:
    """A process for each subject, started one at a time."""
    workers: dict[str, Worker] = {}
    try:
        for name in names:
            tell(f"starting {name} ...")
            workers[name] = Worker(name, python, core, jax=True)
    except BaseException:
        for worker in workers.values():
            worker.close()
        raise
    return workers


def print_table(
    rates: Mapping[str, list[float]],
    versions: Mapping[str, Any],
    missing: Sequence[str],
    disturbed: int,
) -> None:
    """Print a Markdown table: medians, quartiles, and ratios to the native environments."""
    print("\n" + ", ".join(f"{name} {version}" for name, version in versions.items()) + "\n")
    print("| | environments | steps/s | quartiles | of the scan | of the loop |")
    print("|---|---:|---:|---:|---:|---:|")
    # By size, and within a size as in `ADAPTERS`.
    for name in sorted(rates, key=lambda name: int(name.rpartition("-")[2])):
        kind, _, batch = name.rpartition("-")
        found = summarise(np.array(rates[name]))
        quartiles = f"{found['lower_quartile']:,.0f} - {found['upper_quartile']:,.0f}"
        cells = [ADAPTERS[kind].title, batch, f"{found['median']:,.0f}", quartiles]
        for native in (SCAN, LOOP):
            other = rates.get(f"{native}-{batch}")
            cells.append("" if other is None else f"{median_ratio(rates[name], other):.2f}")
        print(f"| {' | '.join(cells)} |")
    if missing:
        print(f"\nNot installed: {', '.join(missing)}.")
    if disturbed:
        print(f"\nOther processes used the core during {disturbed} chunks: not a quiet machine.")


def _sizes(text: str) -> list[int]:
    try:
        sizes = [int(part) for part in text.split(",")]
    except ValueError:
        sizes = []
    if not sizes or min(sizes) < 1:
        raise argparse.ArgumentTypeError(f"whole numbers from 1 on are needed, not {text!r}")
    return sizes


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description="Measure every adapter on one core.")
    parser.add_argument(
        "--envs", type=_sizes, default=[64, 1024], metavar="N,...", help="(default 64,1024)"
    )
    add_options(parser)
    kinds = [kind.removeprefix("adapter-") for kind, a in ADAPTERS.items() if a.module]
    parser.add_argument(
        "--only", nargs="+", default=[], choices=kinds, metavar="ADAPTER", help=", ".join(kinds)
    )
    return parser


if __name__ == "__main__":
    try:
        main()
    except SubjectError as error:
        raise SystemExit(str(error)) from error
