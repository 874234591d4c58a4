"""The benchmark suite: `python -m benchmarks [PART ...] [--json DIR]`; README.md explains it."""

from __future__ import annotations

import argparse
import dataclasses
import functools
import os
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.report.results import Result, suite_rows
from benchmarks.report.tables import table_of
from benchmarks.store import earlier, write
from benchmarks.suites.measure import FORMAT, Groups, Settings, measure
from benchmarks.suites.parts import NAMED, PARTS
from benchmarks.suites.peers import FOLDER, find
from benchmarks.suites.plan import QUICK, Plan
from benchmarks.suites.processes import cores_allowed
from benchmarks.suites.worker import tell
from jaxenstein.errors import JAXensteinError
from jaxenstein.files import check_writable, make_folder
from jaxenstein.machine import describe_machine

# Rounds and seconds of a chunk: of a run for the record, and of a quick one.
FULL_RUN, QUICK_RUN = (7, 1.0), (1, 0.05)


def main(argv: Sequence[str] | None = None) -> None:
    """Measure the parts that the command line names and whose files are not there yet."""
    parser = _parser()
    options = parser.parse_args(argv)
    if unknown := [name for name in options.parts if name not in PARTS]:
        parser.error(f"unknown part: {', '.join(unknown)}; known: {', '.join(PARTS)}")
    names = options.parts or [name for name in PARTS if name not in NAMED]
    settings = _settings(options, parser)
    plan = dataclasses.replace(QUICK if settings.quick else Plan(), cores=cores_allowed())
    also = {python: _words(python, parser) for python in options.also_python}
    folder = make_folder(options.json) if options.json else None
    files = {name: folder / f"{name}.json" for name in names} if folder else {}
    for file in files.values():
        check_writable(file)
    known = {
        "format": FORMAT,
        "settings": vars(settings),
        "hardware": describe_machine()["hardware"],
    }
    done = [n for n, file in files.items() if not options.again and earlier(file, known)]
    for name in names:
        if name in done:
            print(f"{name}: {files[name]} is there already (--again measures it anew)")
            continue
        groups = _chosen(_doubled(PARTS[name](plan), also), settings.only)
        where = functools.partial(find, folder=options.peers.resolve())
        report = {"part": name, **measure(groups, settings, where)}
        tell("")
        shown = table_of(name, Result(report, [*suite_rows(report)]))
        print(f"{name}\n\n{shown}\n{_troubles(report)}", flush=True)
        if name in files:
            write(files[name], report)
            print(f"wrote {files[name]}", flush=True)


def _doubled(groups: Groups, also: Mapping[str, str]) -> Groups:
    """The same with this project's subjects under further interpreters too."""
    return [
        [
            *group,
            *(
                dataclasses.replace(
                    row, name=f"{row.name} with={told.replace(' ', '')}",
                    title=f"{row.title}, {told}", python=python,
                )
                for python, told in also.items() for row in group
                if not row.peer and row.flags is not None
            ),
        ]
        for group in groups
    ]  # fmt: skip


def _chosen(groups: Groups, only: Sequence[str] | None) -> Groups:
    """The subjects whose names begin with one of these words, and what they are compared to."""
    if not only:
        return groups
    kept = []
    for group in groups:
        chosen = [row for row in group if row.name.startswith(tuple(only))]
        beside = {name for row in chosen for name in row.references.values()}
        kept.append([row for row in group if row in chosen or row.name in beside])
    return [group for group in kept if group]


def _words(python: str, parser: argparse.ArgumentParser) -> str:
    """The versions that an interpreter has, for people."""
    told = (
        "import platform, jax; print(f'Python {platform.python_version()}, JAX', jax.__version__)"
    )
    try:
        done = subprocess.run([python, "-c", told], capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        parser.error(f"--also-python: {python} does not run, or has no jax")
    return done.stdout.strip()


def _troubles(report: Mapping[str, Any]) -> str:
    """What a person should hear at once: what failed, and whether the machine was quiet."""
    rows = [row for group in report["groups"] for row in group]
    lines = [f"\n  {row['title']}: {row['failed']}" for row in rows if "failed" in row]
    disturbed = sum(len(row.get("disturbed", ())) for row in rows)
    if disturbed:
        lines.append(f"\n  other processes used the core during {disturbed} chunks: not quiet")
    return "".join(lines)


def _settings(options: argparse.Namespace, parser: argparse.ArgumentParser) -> Settings:
    rounds, seconds = QUICK_RUN if options.quick else FULL_RUN
    core = None
    if hasattr(os, "sched_getaffinity"):
        allowed = sorted(os.sched_getaffinity(0))
        # The last one: the first has most of the system's own work.
        core = allowed[-1] if options.core is None else options.core
        if core not in allowed:
            parser.error(f"--core: there is no core {core}, only {allowed}")
    rounds, seconds = options.rounds or rounds, options.seconds or seconds
    return Settings(core, rounds, seconds, options.quick, options.only)


def _positive(convert: Callable[[str], float]) -> Callable[[str], float]:
    def parse(text: str) -> float:
        try:
            value = convert(text)
        except ValueError:
            value = 0
        if not value > 0:
            raise argparse.ArgumentTypeError(f"a number above 0 is needed, not {text!r}")
        return value

    return parse


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description="Measure this project and its peers in turn on one core, a file a part.",
        epilog="A part whose file is there is left out, so the same command goes on.",
    )
    add = parser.add_argument
    usual = ", ".join(name for name in PARTS if name not in NAMED)
    named = f"{usual} (default: all of these); {', '.join(NAMED)}"
    add("parts", nargs="*", metavar="PART", help=named)
    add("--json", type=Path, metavar="DIR", help="folder for the results (default: only shown)")
    add("--quick", action="store_true", help="tiny sizes, only to see it work")
    add("--core", type=int, metavar="N", help="core to use (default: the last)")
    add("--rounds", type=_positive(int), metavar="N", help="rounds (default 7)")
    add("--seconds", type=_positive(float), metavar="S", help="length of a chunk (default 1)")
    only = "of a part only subjects whose names begin so, such as scan-64, and what stands beside"
    add("--only", nargs="+", metavar="NAME", help=only)
    also = "measure this project under this interpreter too; it needs jax, numpy and pillow"
    add("--also-python", action="append", default=[], metavar="PATH", help=also)
    where = "where benchmarks.suites.peers put them"
    add("--peers", type=Path, default=FOLDER, metavar="DIR", help=where)
    add("--again", action="store_true", help="measure parts that are there anew")
    return parser


if __name__ == "__main__":
    try:
        main()
    except JAXensteinError as error:
        raise SystemExit(f"benchmarks: {error}") from error
    except KeyboardInterrupt:
        print("\nstopped: the same command goes on", file=sys.stderr)
        raise SystemExit(130) from None
