"""Recurrent PPO on My Way Home: this project's, and sb3-contrib's on ViZDoom.

    python -m benchmarks.suites.peers training
    python -m benchmarks.training.compare --envs 1 2 4 8 16 32 64 128 256 --json FILE

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
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.report.results import OTHERS, Result
from benchmarks.report.tables import table_of
from benchmarks.store import earlier, write
from benchmarks.suites.measure import FORMAT
from benchmarks.suites.peers import FOLDER, Found, find
from benchmarks.suites.processes import PROCESSES
from benchmarks.suites.worker import ROOT, tell
from benchmarks.training import OURS, THEIRS
from jaxenstein.errors import JAXensteinError
from jaxenstein.files import check_writable
from jaxenstein.speed.measuring import describe_machine, summarise

PART = "training-compare"
PROGRAMS = {
    OURS: ["benchmarks.training", "--env", "my-way-home", "--algo", "ppo"],
    THEIRS: ["benchmarks.training.sb3"],
}
NUMBERS = (1, 2, 4, 8, 16, 32, 64, 128, 256)
SEGMENTS = Path("/dev/shm")


def main(argv: Sequence[str] | None = None) -> None:
    """Measure the numbers of environments that FILE has not yet, and print the table."""
    parser = _parser()
    options = parser.parse_args(argv)
    _check(parser, options)
    settings = {name: getattr(options, name) for name in ("rollout", "seconds", "limit", "vector")}
    check_writable(options.json)
    report: dict[str, Any] = {"part": PART, "format": FORMAT, **describe_machine()}
    report |= {"settings": settings, "rows": []}
    known = {name: report[name] for name in ("part", "format", "settings", "hardware")}
    before = None if options.again else earlier(options.json, known)
    # A side that was not there may be now.
    report["rows"] = [
        row for row in (before or report)["rows"]
        if not any(side.get("missing") for side in row["sides"].values())
    ]  # fmt: skip
    done = [row["envs"] for row in report["rows"]]
    pythons = {OURS: Found(sys.executable), THEIRS: find("training", options.peers.resolve())}
    for number in (number for number in options.envs if number not in done):
        began = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
        sides = {side: run(side, python, number, settings) for side, python in pythons.items()}
        report["rows"].append({"envs": number, "began": began, "sides": sides})
        report["rows"].sort(key=lambda row: row["envs"])
        write(options.json, report)
    tell("")
    rows = [*OTHERS[PART](report)]
    print(table_of(PART, Result(report, rows)))
    for row in rows:
        for side, found in row["sides"].items():
            if "failed" in found:
                print(f"{side}, {row['envs']}: {found['failed']}")


def run(side: str, found: Found, number: int, settings: Mapping[str, Any]) -> dict[str, Any]:
    """Run one side's program; end it and all that it started, however it went.

    Returns:
        What it wrote, with `steps_per_second`, or under `failed` what went wrong.
    """
    tell(f"{number} environments: {side}")
    if found.problem:
        return {"envs": number, "failed": found.problem, "missing": True}
    command = [str(Path(found.python).absolute()), "-m", *PROGRAMS[side], "--envs", str(number)]
    command += ["--rollout", str(settings["rollout"]), "--seconds", str(settings["seconds"])]
    command += ["--json", "result.json"]
    command += ["--vector", settings["vector"]] if side == THEIRS else []
    places = [str(ROOT), *[str(ROOT / "src")] * (side == OURS)]
    environment = dict(os.environ) | {"PYTHONPATH": os.pathsep.join(places)}
    # ViZDoom leaves files in its working directory.
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        errors = Path(folder) / "stderr.txt"
        with errors.open("w") as err:
            process = subprocess.Popen(
                command, cwd=folder, env=environment, stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL, stderr=err, start_new_session=True,
            )  # fmt: skip
        status = None
        try:
            with contextlib.suppress(subprocess.TimeoutExpired):
                status = process.wait(timeout=settings["limit"])
        finally:
            end(process)
        said = _outcome(Path(folder) / "result.json", errors, status, settings["limit"])
        # Without folders of this machine.
        for place in (folder, str(ROOT), sys.prefix, str(Path.home())):
            if "failed" in said:
                said["failed"] = said["failed"].replace(place, "")
    return said | {"envs": number}


def end(process: subprocess.Popen[Any]) -> None:
    """End a program, its session, and the segments that ViZDoom's engines in it leave behind.

    Engines that are killed cannot remove their shared memory themselves, and nobody else would.
    """
    engines: list[str] = []
    # Workers may start others while they are being ended.
    for _ in range(3):
        for folder in PROCESSES.glob("[0-9]*"):
            with contextlib.suppress(OSError):
                if os.getsid(int(folder.name)) == process.pid:
                    words = (folder / "cmdline").read_bytes().decode(errors="replace")
                    engines += re.findall(r"viz_instance_id\0?\s*(\w+)", words)
                    os.kill(int(folder.name), signal.SIGKILL)
    if process.poll() is None:
        process.kill()
        process.wait()
    for engine in engines:
        for segment in SEGMENTS.glob(f"ViZDoom*{engine}"):
            segment.unlink(missing_ok=True)


def _outcome(file: Path, errors: Path, status: int | None, limit: float) -> dict[str, Any]:
    """What a program wrote, checked; where it wrote nothing, why."""
    try:
        report = json.loads(file.read_text())
        found = {**report, **report["rows"][0]}
        rates = np.array(found["rates"], float)
        if not rates.size or not np.all((rates > 0) & np.isfinite(rates)):
            return {"failed": "it told no rates"}
    except (OSError, ValueError, KeyError, IndexError, TypeError):
        how = f"exit status {status}" if status is not None else f"no result within {limit:g} s"
        if status is not None and status < 0:
            how = f"ended by {signal.Signals(-status).name}"
        lines = [line.strip() for line in errors.read_text(errors="replace").splitlines()]
        last = next((line for line in reversed(lines) if line), "")
        return {"failed": how + (f" (it said last: {last[:300]})" if last else "")}
    found["versions"] = found.get("versions") or found["machine"]["versions"]
    kept = ("versions", "device", "parameters", "creation_seconds", "compile_seconds")
    told = {name: found[name] for name in (*kept, "memory_bytes", "rates") if name in found}
    return told | {"steps_per_second": summarise(rates)}


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
        prog="python -m benchmarks.training.compare",
        description="Training speed of recurrent PPO on My Way Home, here and in ViZDoom.",
        epilog="Numbers that FILE has are left out, so the same command goes on.",
    )
    add = parser.add_argument
    usual = " ".join(map(str, NUMBERS))
    add("--envs", nargs="+", type=int, default=NUMBERS, metavar="N", help=f"(default {usual})")
    add("--json", type=Path, required=True, metavar="FILE", help="for the result")
    where = "where benchmarks.suites.peers put them"
    add("--peers", type=Path, default=FOLDER, metavar="DIR", help=where)
    counted = "whole iterations, at least one, until S have passed (default 20)"
    add("--seconds", type=float, default=20.0, metavar="S", help=counted)
    steps = "steps of each environment in an iteration; fewer only for a trial (default 128)"
    add("--rollout", type=int, default=128, metavar="T", help=steps)
    workers = "a worker process for each ViZDoom, or none (auto: none on one core)"
    add("--vector", choices=["auto", "subproc", "dummy"], default="auto", help=workers)
    hung = "seconds after which a side counts as hung (default 1800)"
    add("--limit", type=float, default=1800.0, metavar="S", help=hung)
    add("--again", action="store_true", help="measure what FILE has anew")
    return parser


if __name__ == "__main__":
    # Told to end, it ends what it started before itself.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        main()
    except JAXensteinError as error:
        raise SystemExit(f"benchmarks.training.compare: {error}") from error
    except KeyboardInterrupt:
        print("\nstopped: the same command goes on", file=sys.stderr)
        raise SystemExit(130) from None
