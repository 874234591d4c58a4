"""Measures subjects in turn, each in its own process, so that all see the same machine load."""

from __future__ import annotations

import contextlib
import dataclasses
import datetime
import json
import os
import select
import signal
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.install import find
from jaxenstein.machine import describe_machine
from jaxenstein.speed.measuring import ONE_THREAD, summarise

ROOT = Path(__file__).resolve().parents[1]
PROGRAM = ("-m", "benchmarks.subjects")
# Seconds after which a start or a chunk counts as hung.
LIMIT = 600.0
FORMAT = 1


@dataclasses.dataclass(frozen=True)
class Subject:
    """One thing to measure: a row of a table.

    Attributes:
        name: name for `benchmarks/subjects`; unique within its group.
        title: name for people.
        axes: what distinguishes it in tables and plots, such as `{"batch": 64}`.
        references: headings of ratios, with the subject of the group to divide by.
        peer: a peer of `benchmarks.install`, whose interpreter runs it; "" for this interpreter.
        pinned: whether it may use only one core.
        flags: XLA flags; None for a subject without this project.
    """

    name: str
    title: str
    axes: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    references: Mapping[str, str] = dataclasses.field(default_factory=dict)
    peer: str = ""
    pinned: bool = True
    flags: str | None = ONE_THREAD


Groups = Sequence[Sequence[Subject]]


@dataclasses.dataclass(frozen=True)
class Settings:
    """How to measure.

    Attributes:
        core: the core that pinned subjects share; None if the system cannot pin processes.
        rounds: number of rounds, after one that does not count.
        seconds: length of a chunk.
        quick: whether sizes are tiny, to test that everything works.
        only: prefixes of the names of subjects; None for all subjects.
    """

    core: int | None
    rounds: int
    seconds: float
    quick: bool = False
    only: list[str] | None = None


class SubjectError(RuntimeError):
    """A subject could not be started, ended, or hung; the message says why."""


class Worker:
    """A subject in its own process, which steps only on request.

    Attributes:
        description: `versions`, `notes` and `ready_seconds` from the subject.
    """

    def __init__(self, subject: Subject, core: int | None) -> None:
        """Start a subject on one core or on all cores.

        Raises:
            SubjectError: the subject cannot be started.
        """
        found = find(subject.peer)
        if found.problem:
            raise SubjectError(found.problem)
        command = [str(Path(found.python).absolute()), *PROGRAM, subject.name]
        if core is not None and subject.pinned:
            command += ["--core", str(core)]
        # The caller's JAX may have a cache on disk, which would hide compile times.
        kept = {name: value for name, value in os.environ.items() if not name.startswith("JAX_")}
        environment = kept | {"PYTHONPATH": str(ROOT)}
        if subject.flags is not None:
            environment["PYTHONPATH"] += f"{os.pathsep}{ROOT / 'src'}"
            environment |= {"JAX_PLATFORMS": "cpu", "XLA_FLAGS": subject.flags}
        # ViZDoom leaves files in its working directory.
        self._folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        self._errors = Path(self._folder.name) / "stderr.txt"
        try:
            with self._errors.open("w") as errors:
                self._process = subprocess.Popen(
                    command, cwd=self._folder.name, env=environment, text=True,
                    stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors,
                    start_new_session=True,
                )  # fmt: skip
        except OSError as error:
            self._folder.cleanup()
            raise SubjectError(f"{Path(command[0]).name} does not run: {error.strerror}") from error
        try:
            self.description = self._reply()
        except BaseException:
            self.close()
            raise

    def measure(self, seconds: float) -> float:
        """Let the subject step for about `seconds`; return steps per second.

        Raises:
            SubjectError: the subject ended, or did not answer.
        """
        assert self._process.stdin is not None
        # If the process has ended, reading gives the better error.
        with contextlib.suppress(OSError):
            self._process.stdin.write(json.dumps({"seconds": seconds}) + "\n")
            self._process.stdin.flush()
        reply = self._reply()
        return reply["steps"] / reply["seconds"]

    def close(self) -> None:
        """End the process and its children."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with contextlib.suppress(OSError):
            self._process.stdin.close()
        try:
            self._process.wait(timeout=10)
        except subprocess.TimeoutExpired:
            self._kill()
        self._process.stdout.close()
        self._folder.cleanup()

    def _reply(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        if not select.select([self._process.stdout], [], [], LIMIT)[0]:
            self._kill()
            raise SubjectError(f"no answer within {LIMIT:g} s")
        line = self._process.stdout.readline()
        if not line:
            raise SubjectError(f"{self._last_words()} (exit status {self._process.wait()})")
        return json.loads(line)

    def _last_words(self) -> str:
        """The last line of stderr, without paths of this machine."""
        lines = self._errors.read_text(errors="replace").split("\n")
        said = next((line.strip() for line in reversed(lines) if line.strip()), "no output")
        return said.replace(self._folder.name, "").replace(str(ROOT), "")

    def _kill(self) -> None:
        """Kill the process group of the subject."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()


def measure(groups: Groups, settings: Settings) -> dict[str, Any]:
    """Measure groups one after another.

    Returns:
        The content of a part's file without its name: `format`, `began` (UTC), `versions`,
        `hardware`, `settings`, `load` (system load at the start), and `groups`, lists with a
        dictionary for each subject.
    """
    began = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    return {
        "format": FORMAT,
        "began": began,
        **describe_machine(),
        "settings": dataclasses.asdict(settings),
        "load": os.getloadavg()[0],
        "groups": [measure_group(group, settings) for group in groups],
    }


def measure_group(subjects: Sequence[Subject], settings: Settings) -> list[dict[str, Any]]:
    """Measure subjects in turn; the failure of one does not affect the others.

    Returns:
        For each subject its name, title, axes and references, and either `failed` (the reason)
        or `versions`, `notes`, `ready_seconds` and `steps_per_second`.
    """
    failed: dict[str, str] = {}
    workers: dict[str, Worker] = {}
    try:
        for subject in subjects:
            tell(f"starting {subject.name} ...")
            try:
                workers[subject.name] = Worker(subject, settings.core)
            except SubjectError as error:
                failed[subject.name] = str(error)
        rates = run_rounds(workers, settings, failed)
        found = {
            name: {
                **workers[name].description,
                "steps_per_second": summarise(np.array(measured)),
            }
            for name, measured in rates.items()
        }
    finally:
        for worker in workers.values():
            worker.close()
    found |= {name: {"failed": reason} for name, reason in failed.items()}
    kept = ("name", "title", "axes", "references", "pinned")
    return [{key: getattr(row, key) for key in kept} | found[row.name] for row in subjects]


def run_rounds(
    workers: Mapping[str, Worker], settings: Settings, failed: dict[str, str]
) -> dict[str, list[float]]:
    """Give every worker one chunk per round; leave out workers after a failure."""
    rates: dict[str, list[float]] = {name: [] for name in workers}
    for number in range(settings.rounds + 1):
        for name in list(rates):
            tell(f"round {number}/{settings.rounds}: {name}")
            try:
                rates[name].append(workers[name].measure(settings.seconds))
            except SubjectError as error:
                failed[name] = str(error)
                del rates[name]
    tell("")
    return {name: measured[1:] for name, measured in rates.items()}


def tell(message: str) -> None:
    """Show a message on the last line of a terminal; print nothing in a log."""
    if sys.stderr.isatty():
        print(f"\r\x1b[K{message}", end="", file=sys.stderr, flush=True)


def median_ratio(values: Sequence[float], others: Sequence[float]) -> float:
    """The median over rounds of the ratio of two subjects.

    For results without equal rounds, it is the ratio of the medians.
    """
    if len(values) != len(others):
        return statistics.median(values) / statistics.median(others)
    return statistics.median(value / other for value, other in zip(values, others, strict=True))
