"""Several programs measured in turn, so that all of them see the same moods of the machine."""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from benchmarks.quiet import CoreWatch
from jaxenstein.benchmark import ONE_THREAD

SOURCE = Path(__file__).resolve().parent.parent / "src"
# A chunk during which others used more of the core than this is measured again, a few times.
DISTURBED = 0.05
ATTEMPTS = 5


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of every comparison on one core."""
    parser.add_argument("--core", type=int, default=0, help="the core to use (default 0)")
    parser.add_argument("--rounds", type=int, default=7, help="rounds counted (default 7)")
    parser.add_argument(
        "--seconds", type=float, default=1.0, help="length of a chunk in seconds (default 1)"
    )
    parser.add_argument(
        "--also-python",
        action="append",
        default=[],
        metavar="PATH",
        help="also measure under this interpreter; it needs the core dependencies",
    )
    parser.add_argument(
        "--json", type=Path, metavar="FILE", help="write every repeat and the versions here"
    )


class Worker:
    """A subject in a process of its own, which steps only when asked to."""

    def __init__(self, name: str, python: str, core: int | None, jax: bool) -> None:
        """Start `subjects.py` for the subject `name` under the interpreter `python`."""
        script = Path(__file__).resolve().with_name("subjects.py")
        command = [str(Path(python).absolute()), str(script), name]
        if core is not None:
            command += ["--core", str(core)]
        environment = dict(os.environ)
        if jax:
            # One thread, because the comparison is by the core.
            environment |= {"JAX_PLATFORMS": "cpu", "XLA_FLAGS": ONE_THREAD}
            environment["PYTHONPATH"] = str(SOURCE)
        self.name = name
        self.disturbed: list[float] = []
        self._core = core
        # ViZDoom leaves files in its working directory.
        self._folder = tempfile.TemporaryDirectory()
        self._process = subprocess.Popen(
            command,
            cwd=self._folder.name,
            env=environment,
            text=True,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        self.description = self._reply()

    def measure(self, seconds: float) -> float:
        """Let the subject step for about `seconds`; return its steps a second.

        A disturbed chunk is measured again; of several disturbed ones the least disturbed counts,
        and the share of the core that it lost to others goes to `disturbed`.
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

    def close(self) -> None:
        """End the process."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        try:
            self._process.wait(timeout=10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._folder.cleanup()

    def _chunk(self, seconds: float) -> float:
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps({"seconds": seconds}) + "\n")
        self._process.stdin.flush()
        reply = self._reply()
        return reply["steps"] / reply["seconds"]

    def _reply(self) -> dict:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError(f"the process of {self.name} ended with {self._process.wait()}")
        return json.loads(line)


def run_rounds(
    workers: Mapping[str, Worker], rounds: int, seconds: float
) -> dict[str, list[float]]:
    """Give every worker one chunk a round, after a round that is not counted."""
    rates: dict[str, list[float]] = {label: [] for label in workers}
    for number in range(rounds + 1):
        for label, worker in workers.items():
            tell(f"round {number}/{rounds}: {label}")
            rate = worker.measure(seconds)
            if number:
                rates[label].append(rate)
    tell("")
    return rates


def tell(message: str) -> None:
    """Show what is going on in one line of a terminal, overwritten each time; nothing in a log."""
    if sys.stderr.isatty():
        print(f"\r\x1b[K{message}", end="", file=sys.stderr, flush=True)


def median_ratio(values: Sequence[float], others: Sequence[float]) -> float:
    """Median over the rounds of the ratio of two subjects within a round."""
    return statistics.median(value / other for value, other in zip(values, others, strict=True))
