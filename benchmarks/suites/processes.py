"""Processes and those that they start, and whether others use a core (Linux; elsewhere unknown)."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Sequence
from pathlib import Path

PROCESSES = Path("/proc")
TICKS_PER_SECOND = os.sysconf("SC_CLK_TCK") if hasattr(os, "sysconf") else 100


def family(pid: int) -> list[int]:
    """A process and its descendants, whichever of its threads started them."""
    found = [pid]
    for parent in found:
        with contextlib.suppress(OSError):
            for task in (PROCESSES / str(parent) / "task").glob("*/children"):
                found += [int(child) for child in task.read_text().split()]
    return found


def cores_allowed() -> int:
    """How many cores this process may use; here too, for peers without JAX ask it."""
    allowed = getattr(os, "sched_getaffinity", None)
    return len(allowed(0)) if allowed else os.cpu_count() or 1


class CoreWatch:
    """Share of a core's time that went to other processes than a given one and its children.

    Without a core it is the share of the time of all cores together.
    """

    def __init__(self, core: int | None, pid: int) -> None:
        """Start watching `core` on behalf of the process `pid`."""
        self._core, self._pid = core, pid
        self._began, self._others = time.perf_counter(), self._ticks_of_others()

    def foreign_share(self) -> float:
        """Share (0 to 1) since the start; 0 where it cannot be known."""
        ticks = self._ticks_of_others() - self._others
        cores = 1 if self._core is not None else os.cpu_count() or 1
        elapsed = cores * (time.perf_counter() - self._began)
        return max(0.0, ticks / TICKS_PER_SECOND / elapsed)

    def _ticks_of_others(self) -> int:
        try:
            return _busy_ticks(self._core) - sum(_ticks(pid) for pid in family(self._pid))
        except (OSError, StopIteration):
            return 0


def _busy_ticks(core: int | None) -> int:
    """Ticks of `core` not spent idle, with those that the host of a virtual machine took."""
    name = "cpu" if core is None else f"cpu{core}"
    lines = map(str.split, (PROCESSES / "stat").read_text().splitlines())
    fields = next(line for line in lines if line[0] == name)
    user, nice, system, _idle, _waiting, *interrupts_and_stolen = map(int, fields[1:9])
    return user + nice + system + sum(interrupts_and_stolen)


def _ticks(pid: int) -> int:
    """Ticks that a process and its ended children have used; 0 if it has ended itself."""
    try:
        # The name, in brackets, may contain anything: count the fields behind it.
        fields = (PROCESSES / str(pid) / "stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0
    return sum(map(int, fields[11:15]))


def memory(pids: Sequence[int]) -> int | None:
    """Bytes that processes hold together at their peaks; None where nobody can tell.

    Pages that several share count once: the proportional share of each, and how much more than
    now it held at its peak.
    """
    held = above = 0
    for pid in pids:
        sizes = {**_kibibytes(pid, "status"), **_kibibytes(pid, "smaps_rollup")}
        held += sizes.get("Pss", 0)
        above += sizes.get("VmHWM", 0) - sizes.get("VmRSS", 0)
    return (held + above) * 1024 if held else None


def _kibibytes(pid: int, file: str) -> dict[str, int]:
    """The figures in KiB of a file of a process, by name; none if it has ended."""
    with contextlib.suppress(OSError):
        lines = (PROCESSES / str(pid) / file).read_text().splitlines()
        words = [line.replace(":", " ").split() for line in lines]
        return {each[0]: int(each[1]) for each in words if each[2:] == ["kB"]}
    return {}
