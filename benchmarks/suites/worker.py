"""Several programs measured in turn, so that all of them see the same moods of the machine."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
from collections.abc import Mapping, MutableMapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.suites.processes import CoreWatch, family, memory
from jaxenstein.speed.measuring import ONE_THREAD

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = ("-m", "benchmarks.subjects")
# A chunk during which others used more of the core than this is measured again, a few times.
DISTURBED = 0.05
ATTEMPTS = 5
# Seconds after which a subject that has not started, or a chunk that is not over, counts as hung.
START_LIMIT = 600.0
CHUNK_LIMIT = 600.0


class SubjectError(RuntimeError):
    """A subject could not be started, or ended, or hung; the message says why."""


class Worker:
    """A subject in a process of its own, which steps only when asked to.

    Attributes:
        description: what the subject said of itself: `versions`, `notes`, `ready_seconds`.
        disturbed: of each chunk that stayed disturbed, the share of the core that others used.
    """

    def __init__(
        self, name: str, python: str, core: int | None, flags: str | None = ONE_THREAD
    ) -> None:
        """Start a subject.

        Args:
            name: of the subject.
            python: the interpreter; "" for this one.
            core: the core to stay on, or None for all.
            flags: XLA's; None for a subject that does without this project.

        Raises:
            SubjectError: it cannot be started.
        """
        command = [str(Path(python or sys.executable).absolute()), *PROGRAM, name]
        command += [] if core is None else ["--core", str(core)]
        places = [str(ROOT)] + ([] if flags is None else [str(ROOT / "src")])
        environment = dict(os.environ) | {"PYTHONPATH": os.pathsep.join(places)}
        if flags is not None:
            environment |= {"JAX_PLATFORMS": "cpu", "XLA_FLAGS": flags}
        self.disturbed: list[float] = []
        self._core = core
        # ViZDoom leaves files in its working directory.
        self._folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        self._errors = Path(self._folder.name) / "stderr.txt"
        self._lines: queue.SimpleQueue[str] = queue.SimpleQueue()
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
        # A thread of its own reads, so that a subject that hangs can be given up.
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        try:
            self.description = self._reply(START_LIMIT)
        except BaseException:
            self.close()
            raise

    def measure(self, seconds: float) -> float:
        """Let the subject step for about `seconds`; return its steps a second.

        A disturbed chunk is measured again; of several disturbed ones the least disturbed counts,
        and the share of the core that it lost to others goes to `disturbed`.

        Raises:
            SubjectError: the subject ended, or did not answer.
        """
        chunks: list[tuple[float, float]] = []
        while len(chunks) < ATTEMPTS and (not chunks or chunks[-1][0] > DISTURBED):
            watch = CoreWatch(self._core, self._process.pid)
            rate = self._chunk(seconds)
            chunks.append((watch.foreign_share(), rate))
        share, rate = min(chunks)
        if share > DISTURBED:
            self.disturbed.append(round(share, 3))
        return rate

    def memory(self) -> int | None:
        """Bytes that the process and those that it started hold at their peaks, if known."""
        return memory(family(self._process.pid))

    def close(self) -> None:
        """End the process and those that it started."""
        assert self._process.stdin is not None
        with contextlib.suppress(OSError):
            self._process.stdin.close()
        try:
            self._process.wait(timeout=10)
        except subprocess.TimeoutExpired:
            self._kill()
        # What it started may still hold its output open.
        self._reader.join(timeout=1)
        if not self._reader.is_alive() and self._process.stdout is not None:
            self._process.stdout.close()
        self._folder.cleanup()

    def _chunk(self, seconds: float) -> float:
        assert self._process.stdin is not None
        # Where the process has ended, reading says so better than writing.
        with contextlib.suppress(OSError):
            self._process.stdin.write(json.dumps({"seconds": seconds}) + "\n")
            self._process.stdin.flush()
        reply = self._reply(CHUNK_LIMIT + 10 * seconds)
        return reply["steps"] / reply["seconds"]

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._lines.put(line)
        self._lines.put("")

    def _reply(self, limit: float) -> dict[str, Any]:
        try:
            line = self._lines.get(timeout=limit)
        except queue.Empty:
            self._kill()
            raise SubjectError(f"no answer within {limit:g} s") from None
        if not line:
            raise SubjectError(f"{self._last_words()} (exit status {self._process.wait()})")
        return json.loads(line)

    def _last_words(self) -> str:
        """The last line of the error output, without folders of this machine."""
        lines = self._errors.read_text(errors="replace").split("\n")
        said = next((line.strip() for line in reversed(lines) if line.strip()), "it said nothing")
        return said.replace(self._folder.name, "").replace(str(ROOT), "")

    def _kill(self) -> None:
        kill_group(self._process)


def kill_group(process: subprocess.Popen[Any]) -> None:
    """End a process that leads a group of its own, and its children in it."""
    if hasattr(os, "killpg"):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()
    process.wait()


def run_rounds(
    workers: Mapping[str, Worker], rounds: int, seconds: float, failed: MutableMapping[str, str]
) -> dict[str, list[float]]:
    """Give every worker one chunk a round, after a round that is not counted.

    Args:
        workers: by the names of their subjects.
        rounds: how many count.
        seconds: length of a chunk.
        failed: where to note a worker that fails, which then is left out.
    """
    rates: dict[str, list[float]] = {name: [] for name in workers}
    for number in range(rounds + 1):
        for name in list(rates):
            tell(f"round {number}/{rounds}: {name}")
            try:
                rates[name].append(workers[name].measure(seconds))
            except SubjectError as error:
                failed[name] = str(error)
                del rates[name]
    tell("")
    return {name: measured[1:] for name, measured in rates.items()}


def tell(message: str) -> None:
    """Show what is going on in one line of a terminal, overwritten each time; nothing in a log."""
    if sys.stderr.isatty():
        print(f"\r\x1b[K{message}", end="", file=sys.stderr, flush=True)


def median_ratio(values: Sequence[float], others: Sequence[float]) -> float:
    """Median over the rounds of the ratio of two subjects within a round.

    Where they were not measured in turn, as some results of before, the ratio of their medians.
    """
    if len(values) != len(others):
        return statistics.median(values) / statistics.median(others)
    return statistics.median(value / other for value, other in zip(values, others, strict=True))
