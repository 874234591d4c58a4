"""The benchmark suite: `python -m benchmarks [PART ...] --json DIR`; README.md explains it."""

from __future__ import annotations

import argparse
import dataclasses
import functools
import json
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.interleave import tell
from benchmarks.measure import FORMAT, Settings, measure
from benchmarks.parts import PARTS, Plan, quick_plan
from benchmarks.peers import FOLDER, find
from jaxenstein.errors import JAXensteinError
from jaxenstein.files import OutputError, atomic, check_writable, make_folder
from jaxenstein.speed.measuring import describe_machine

# Rounds and seconds of a chunk: of a run for the record, and of a quick one.
FULL, QUICK = (7, 1.0), (1, 0.05)


def main(argv: Sequence[str] | None = None) -> None:
    """Measure the parts that the command line names and whose files are not there yet."""
    parser = _parser()
    options = parser.parse_args(argv)
    if unknown := [name for name in options.parts if name not in PARTS]:
        parser.error(f"unknown part: {', '.join(unknown)}; known: {', '.join(PARTS)}")
    names = options.parts or list(PARTS)
    settings = _settings(options, parser)
    sizes = quick_plan() if settings.quick else Plan()
    where = functools.partial(find, folder=options.peers.resolve())
    plan = dataclasses.replace(sizes, cores=_cores(), find=where)
    folder = make_folder(options.json)
    files = {name: folder / f"{name}.json" for name in names}
    for file in files.values():
        check_writable(file)
    todo = [n for n, file in files.items() if options.again or not _is_done(file, settings)]
    for name in names:
        if name not in todo:
            print(f"{name}: {files[name]} is there already (--again measures it anew)")
    for name in todo:
        report = {"part": name, **measure(PARTS[name](plan), settings)}
        tell("")
        with atomic(files[name]) as path:
            path.write_text(json.dumps(report, indent=1))
        print(f"{name}: {files[name]}{_troubles(report)}", flush=True)


def _is_done(file: Path, settings: Settings) -> bool:
    """Whether a part's file is there, of this machine and measured as it would be now.

    Raises:
        OutputError: it is there, but of something else.
    """
    if not file.exists():
        return False
    again = "choose another folder, or --again to replace it"
    try:
        report = json.loads(file.read_text())
        before = {"format": report["format"], **report["settings"], **report["hardware"]}
    except (ValueError, KeyError, TypeError) as error:
        raise OutputError(file, f"it is there and no result of this suite; {again}") from error
    now = {"format": FORMAT, **vars(settings), **describe_machine()["hardware"]}
    changed = [f"{name} {before.get(name)}, not {now[name]}" for name in now
               if before.get(name) != now[name]]  # fmt: skip
    if changed:
        raise OutputError(file, f"it was measured with {'; '.join(changed)}; {again}")
    return True


def _troubles(report: Mapping[str, Any]) -> str:
    """What a person should hear at once: what failed, and whether the machine was quiet."""
    rows = [row for group in report["groups"] for row in group]
    lines = [f"\n  {row['title']}: {row['failed']}" for row in rows if "failed" in row]
    disturbed = sum(len(row.get("disturbed", ())) for row in rows)
    if disturbed:
        lines.append(f"\n  other processes used the core during {disturbed} chunks: not quiet")
    return "".join(lines)


def _settings(options: argparse.Namespace, parser: argparse.ArgumentParser) -> Settings:
    rounds, seconds = QUICK if options.quick else FULL
    rounds = options.rounds or rounds
    seconds = options.seconds or seconds
    core = None
    if hasattr(os, "sched_getaffinity"):
        allowed = sorted(os.sched_getaffinity(0))
        # The last one: the first has most of the system's own work.
        core = allowed[-1] if options.core is None else options.core
        if core not in allowed:
            parser.error(f"--core: there is no core {core}, only {allowed}")
    return Settings(core, rounds, seconds, options.quick)


def _cores() -> int:
    allowed = getattr(os, "sched_getaffinity", None)
    return len(allowed(0)) if allowed else os.cpu_count() or 1


def _positive(convert: Any) -> Any:
    def parse(text: str) -> Any:
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
    parser.add_argument(
        "parts", nargs="*", metavar="PART", help=f"{', '.join(PARTS)} (default: all)"
    )
    parser.add_argument(
        "--json", type=Path, required=True, metavar="DIR", help="folder for the results"
    )
    parser.add_argument("--quick", action="store_true", help="tiny sizes, only to see it work")
    parser.add_argument("--core", type=int, metavar="N", help="core to use (default: the last)")
    parser.add_argument("--rounds", type=_positive(int), metavar="N", help="rounds (default 7)")
    parser.add_argument(
        "--seconds", type=_positive(float), metavar="S", help="length of a chunk (default 1)"
    )
    parser.add_argument(
        "--peers", type=Path, default=FOLDER, metavar="DIR", help="where benchmarks.peers put them"
    )
    parser.add_argument("--again", action="store_true", help="measure parts that are there anew")
    return parser


if __name__ == "__main__":
    try:
        main()
    except JAXensteinError as error:
        raise SystemExit(f"benchmarks: {error}") from error
    except KeyboardInterrupt:
        print("\nstopped: the same command goes on", file=sys.stderr)
        raise SystemExit(130) from None
