"""The benchmark suite: `python -m benchmarks [PART ...] [--json DIR]`; README.md explains it."""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.measure import FORMAT, Groups, Settings, measure
from benchmarks.parts import NAMED, PARTS, QUICK, ROUNDS, Plan
from benchmarks.tables import rows_of, table_of
from fidelity.commands import positive, run_command
from jaxenstein.cli.arguments import whole
from jaxenstein.files import OutputError, atomic, check_writable, make_folder
from jaxenstein.machine import describe_machine

# Number of rounds and seconds per chunk, for a full and for a quick run.
FULL_RUN, QUICK_RUN = (7, 1.0), (1, 0.05)


def main(argv: Sequence[str] | None = None) -> None:
    """Measure the named parts whose files do not exist yet."""
    parser = _parser()
    options = parser.parse_args(argv)
    if unknown := [name for name in options.parts if name not in PARTS]:
        parser.error(f"unknown part: {', '.join(unknown)}; known: {', '.join(PARTS)}")
    usual = _settings(options, parser)
    names = options.parts or [name for name in PARTS if name not in NAMED]
    groups = {name: PARTS[name](QUICK if usual.quick else Plan()) for name in names}
    every = dict.fromkeys(row.name for part in groups.values() for group in part for row in group)
    for word in options.only or ():
        if not any(name.startswith(word) for name in every):
            known = ", ".join(map(repr, every))
            parser.error(f"--only: no name of a subject starts with {word!r}; there are {known}")
    folder = make_folder(options.json) if options.json else None
    for name in names:
        if not (subjects := chosen(groups[name], options.only)):
            continue
        rounds = usual.rounds if options.rounds or usual.quick else ROUNDS.get(name, usual.rounds)
        settings = dataclasses.replace(usual, rounds=rounds)
        file = folder / f"{name}.json" if folder else None
        if file:
            check_writable(file)
        if file and not options.again and is_there(file, settings):
            print(f"{name}: {file} already exists (--again measures it again)")
            continue
        report = {"part": name, **measure(subjects, settings)}
        rows = rows_of(report)
        print(f"{name}\n\n{table_of(name, rows)}\n", flush=True)
        for row in rows:
            if "failed" in row:
                print(f"  {row['title']}: {row['failed']}", flush=True)
        if file:
            with atomic(file) as path:
                path.write_text(json.dumps(report, indent=1))
            print(f"wrote {file}", flush=True)


def is_there(file: Path, settings: Settings) -> bool:
    """Whether a file has a part that was measured on this machine with these settings.

    Raises:
        OutputError: the file is something else, or from another machine or other settings.
    """
    if not file.exists():
        return False
    now: dict[str, Any] = {"format": FORMAT, "settings": dataclasses.asdict(settings)}
    now["hardware"] = describe_machine()["hardware"]
    try:
        report = json.loads(file.read_text())
        before: Mapping[str, Any] = {name: report[name] for name in now}
    except (ValueError, KeyError, TypeError) as error:
        raise OutputError(file, "it exists and is not a result of this command") from error
    for name, value in now.items():
        if before[name] != value:
            raise OutputError(
                file, f"it has {name} {before[name]}, not {value}; choose another folder"
            )
    return True


def chosen(groups: Groups, only: Sequence[str] | None) -> Groups:
    """The subjects whose names start with one of these words, and the subjects they refer to."""
    if not only:
        return groups
    kept = []
    for group in groups:
        named = [row for row in group if row.name.startswith(tuple(only))]
        beside = {name for row in named for name in row.references.values()}
        kept.append([row for row in group if row in named or row.name in beside])
    return [group for group in kept if group]


def _settings(options: argparse.Namespace, parser: argparse.ArgumentParser) -> Settings:
    rounds, seconds = QUICK_RUN if options.quick else FULL_RUN
    core = None
    if hasattr(os, "sched_getaffinity"):
        allowed = sorted(os.sched_getaffinity(0))
        # The last core, since the system uses the first one most.
        core = allowed[-1] if options.core is None else options.core
        if core not in allowed:
            parser.error(f"--core must be one of {allowed}, not {core}")
    rounds, seconds = options.rounds or rounds, options.seconds or seconds
    return Settings(core, rounds, seconds, options.quick, options.only)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description="Measure this project and its peers in turn on one core, with a file per part.",
        epilog="Parts with a file are skipped, so repeating the command continues.",
    )
    add = parser.add_argument
    usual = ", ".join(name for name in PARTS if name not in NAMED)
    named = f"{usual} (default: all of these); {', '.join(NAMED)}"
    add("parts", nargs="*", metavar="PART", help=named)
    add("--json", type=Path, metavar="DIR", help="folder for results (default: only print)")
    add("--quick", action="store_true", help="tiny sizes, to test that everything works")
    add("--core", type=int, metavar="N", help="core to use (default: the last)")
    add("--rounds", type=whole(), metavar="N", help="rounds (default 7; starts 3)")
    add("--seconds", type=positive, metavar="S", help="length of a chunk (default 1)")
    only = "only subjects whose names start with NAME, such as scan-64, and their references"
    add("--only", nargs="+", metavar="NAME", help=only)
    add("--again", action="store_true", help="measure existing parts again")
    return parser


if __name__ == "__main__":
    try:
        run_command(main)
    except KeyboardInterrupt:
        print("\nstopped: repeat the command to continue", file=sys.stderr)
        raise SystemExit(130) from None
