"""Recurrent PPO on My Way Home: this project's, and sb3-contrib's on ViZDoom.

    python -m benchmarks.peers training
    python -m benchmarks.train_compare --envs 1 2 4 8 16 32 64 128 256 --json FILE

Whole training steps a second on all cores that this process may use, for each number of
environments: first this project, then the other, each in a process of its own with a time limit.
What fails is a row with its reason. FILE is written after each number; the same command goes on.
"""

from __future__ import annotations

import argparse
import contextlib
import datetime
import json
import math
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.interleave import SOURCE, tell
from benchmarks.measure import FORMAT
from benchmarks.peers import FOLDER, find
from benchmarks.report_training import OURS, PART, THEIRS, comparison_failures, comparison_table
from benchmarks.train_limits import limits, memory_kills, misfit
from benchmarks.train_processes import end, session
from jaxenstein.errors import JAXensteinError
from jaxenstein.files import OutputError, atomic, check_writable
from jaxenstein.speed.measuring import describe_machine, summarise

PEER = "training"
SCRIPT = Path(__file__).resolve().with_name("train_sb3.py")
NUMBERS = (1, 2, 4, 8, 16, 32, 64, 128, 256)


def main(argv: Sequence[str] | None = None) -> None:
    """Measure the numbers of environments that FILE has not yet, and print the table."""
    parser = _parser()
    options = parser.parse_args(argv)
    _check(parser, options)
    settings = {name: getattr(options, name) for name in ("rollout", "seconds", "limit", "vector")}
    check_writable(options.json)
    report = {
        "part": PART,
        "format": FORMAT,
        **describe_machine(),
        "settings": settings,
        "rows": [],
    }
    if not options.again:
        report["rows"] = _earlier(options.json, report)
    done = {row["envs"] for row in report["rows"] if not _unmade(row)}
    for number in options.envs:
        if number in done:
            continue
        report["rows"] = [row for row in report["rows"] if row["envs"] != number]
        row = compare(number, report["rows"], settings, options.peers.resolve())
        report["rows"] = sorted([*report["rows"], row], key=lambda row: row["envs"])
        with atomic(options.json) as path:
            path.write_text(json.dumps(report, indent=1))
    tell("")
    print(comparison_table(report["rows"]))
    print("".join(f"\n{line}" for line in comparison_failures(report["rows"])))


def compare(
    number: int, before: Sequence[Mapping[str, Any]], settings: Mapping[str, Any], peers: Path
) -> dict[str, Any]:
    """Measure both sides with one number of environments.

    Args:
        number: of environments.
        before: rows of other numbers, by which it is judged whether the memory suffices.
        settings: `rollout`, `seconds`, `limit` and `vector`.
        peers: where the peers are installed.

    Returns:
        `envs`, `began`, `limits`, what was free and allowed before each side, and `sides`.
    """
    began = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    row: dict[str, Any] = {"envs": number, "began": began, "limits": {}, "sides": {}}
    for side in (OURS, THEIRS):
        tell(f"{number} environments: {side}")
        free = row["limits"][side] = limits()
        earlier = [each["sides"][side] for each in before if each["envs"] < number]
        reason = misfit(number, earlier, free)
        if reason:
            row["sides"][side] = {"envs": number, "failed": reason, "skipped": True}
        elif side == OURS:
            row["sides"][side] = _own(number, settings)
        else:
            row["sides"][side] = _peer(number, settings, peers)
    return row


def _own(number: int, settings: Mapping[str, Any]) -> dict[str, Any]:
    places = [str(SOURCE), str(SOURCE.parent)]
    environment = dict(os.environ) | {"PYTHONPATH": os.pathsep.join(places)}
    return run([sys.executable, "-m", "benchmarks.train_own"], environment, number, settings)


def _peer(number: int, settings: Mapping[str, Any], peers: Path) -> dict[str, Any]:
    found = find(PEER, peers)
    if found.problem:
        return {"envs": number, "failed": found.problem, "missing": True}
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    python = str(Path(found.python).absolute())
    command = [python, str(SCRIPT), "--vector", settings["vector"]]
    return run(command, environment, number, settings)


def run(
    command: Sequence[str],
    environment: Mapping[str, str],
    number: int,
    settings: Mapping[str, Any],
) -> dict[str, Any]:
    """Run one side's program; end it and all that it started, however it went.

    Returns:
        What its last line says, with `steps_per_second`, or under `failed` what went wrong.
    """
    words = ["--envs", str(number), "--rollout", str(settings["rollout"])]
    words += ["--seconds", str(settings["seconds"])]
    kills = memory_kills()
    # ViZDoom leaves files in its working directory.
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        output, errors = Path(folder) / "stdout.txt", Path(folder) / "stderr.txt"
        try:
            with output.open("w") as out, errors.open("w") as err:
                process = subprocess.Popen(
                    [*command, *words],
                    cwd=folder,
                    env=dict(environment),
                    stdin=subprocess.DEVNULL,
                    stdout=out,
                    stderr=err,
                    start_new_session=True,
                )
        except OSError as error:
            name = Path(command[0]).name
            return {"envs": number, "failed": f"{name} does not run: {error.strerror}"}
        status = _wait(process, settings["limit"])
        found = _outcome(output, errors, status, settings["limit"]) | {"envs": number}
        found = _without(found, folder)
    killed = memory_kills() - kills
    if "failed" in found and killed:
        found["failed"] += f"; memory ran out, for which the system ended {killed} process(es)"
    return found


def _wait(process: subprocess.Popen[bytes], limit: float) -> int | None:
    """The exit status, or None if it had to be ended; nothing that it started is left."""
    status = None
    try:
        with contextlib.suppress(subprocess.TimeoutExpired):
            status = process.wait(timeout=limit)
    finally:
        # Workers may start others while they are being ended.
        for _ in range(5):
            rest = session(process.pid)
            if not rest:
                break
            end(rest)
        if process.poll() is None:
            process.kill()
            process.wait()
    return status


def _outcome(output: Path, errors: Path, status: int | None, limit: float) -> dict[str, Any]:
    """What a program said, checked; where it said nothing, why."""
    if status is None:
        return {"failed": f"no result within {limit:g} s{_hint(errors)}"}
    found: Any = None
    with contextlib.suppress(ValueError, IndexError):
        found = json.loads(output.read_text(errors="replace").splitlines()[-1])
    if not isinstance(found, dict):
        how = f"exit status {status}" if status >= 0 else f"ended by {_signal(-status)}"
        return {"failed": f"{how}{_hint(errors)}"}
    if "failed" in found:
        return found | {"failed": f"{found['failed']}{_hint(errors)}"}
    rates = found.get("rates") or []
    if not rates or not all(isinstance(r, int | float) and 0 < r < math.inf for r in rates):
        return found | {"failed": "it told no rates"}
    return found | {"steps_per_second": summarise(np.array(rates, float))}


def _hint(errors: Path) -> str:
    """The last line of the error output, which a worker's death is told in."""
    lines = [line.strip() for line in errors.read_text(errors="replace").splitlines()]
    said = next((line for line in reversed(lines) if line), "")
    return f" (it said last: {said[:300]})" if said else ""


def _signal(number: int) -> str:
    with contextlib.suppress(ValueError):
        return signal.Signals(number).name
    return f"signal {number}"


def _without(found: dict[str, Any], folder: str) -> dict[str, Any]:
    """The reason without folders of this machine."""
    if "failed" in found:
        for place in (folder, str(SOURCE.parent), sys.prefix, str(Path.home())):
            found["failed"] = found["failed"].replace(place, "")
    return found


def _unmade(row: Mapping[str, Any]) -> bool:
    """Whether a side was not there to be measured; that may change."""
    return any(side.get("missing") for side in row["sides"].values())


def _earlier(file: Path, now: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The rows that a file has already.

    Raises:
        OutputError: it is of something else, of another machine or of other settings.
    """
    if not file.exists():
        return []
    again = "choose another file, or --again to replace it"
    try:
        report = json.loads(file.read_text())
        if (report["part"], report["format"]) != (PART, FORMAT):
            raise KeyError
        before = {**report["settings"], **report["hardware"]}
        rows = [row for row in report["rows"] if {OURS, THEIRS} <= set(row["sides"])]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise OutputError(file, f"it is there and no result of this command; {again}") from error
    wanted = {**now["settings"], **now["hardware"]}
    changed = [f"{name} {before.get(name)}, not {wanted[name]}" for name in wanted
               if before.get(name) != wanted[name]]  # fmt: skip
    if changed:
        raise OutputError(file, f"it was measured with {'; '.join(changed)}; {again}")
    return rows


def _check(parser: argparse.ArgumentParser, options: argparse.Namespace) -> None:
    """Say which argument is out of range."""
    for name in ("rollout", "seconds", "limit"):
        value = getattr(options, name)
        if not 0 < value < math.inf:
            parser.error(f"--{name}: a number above 0 is needed, not {value}")
    for number in options.envs:
        # PPO parts the environments among its four minibatches, or one each if they are fewer.
        if number < 1 or number % min(4, number):
            parser.error(f"--envs: 1, 2, 3 or a multiple of 4 is needed, not {number}")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.train_compare",
        description="Training speed of recurrent PPO on My Way Home, here and in ViZDoom.",
        epilog="Numbers that FILE has are left out, so the same command goes on.",
    )
    add = parser.add_argument
    usual = " ".join(map(str, NUMBERS))
    add("--envs", nargs="+", type=int, default=NUMBERS, metavar="N", help=f"(default {usual})")
    add("--json", type=Path, required=True, metavar="FILE", help="for the result")
    add("--peers", type=Path, default=FOLDER, metavar="DIR", help="where benchmarks.peers put them")
    counted = "whole iterations, at least one, until S have passed (default 20)"
    add("--seconds", type=float, default=20.0, metavar="S", help=counted)
    steps = "steps of each environment in an iteration; fewer only for a trial (default 128)"
    add("--rollout", type=int, default=128, metavar="T", help=steps)
    hung = "seconds after which a side counts as hung (default 1800)"
    add("--limit", type=float, default=1800.0, metavar="S", help=hung)
    workers = "a worker process for each ViZDoom, or none (auto: none on one core)"
    add("--vector", choices=["auto", "subproc", "dummy"], default="auto", help=workers)
    add("--again", action="store_true", help="measure what FILE has anew")
    return parser


if __name__ == "__main__":
    # Told to end, it ends what it started before itself.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        main()
    except JAXensteinError as error:
        raise SystemExit(f"benchmarks.train_compare: {error}") from error
    except KeyboardInterrupt:
        print("\nstopped: the same command goes on", file=sys.stderr)
        raise SystemExit(130) from None
