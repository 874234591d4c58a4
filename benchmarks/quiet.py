"""Whether anything else used a core during a measurement (Linux; elsewhere nobody can tell)."""

from __future__ import annotations

import os
import time
from pathlib import Path

from benchmarks.train_processes import family

TICKS_PER_SECOND = os.sysconf("SC_CLK_TCK") if hasattr(os, "sysconf") else 100


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
    lines = Path("/proc/stat").read_text().splitlines()
    name = "cpu" if core is None else f"cpu{core}"
    fields = next(line.split() for line in lines if line.split()[0] == name)
    user, nice, system, _idle, _waiting, *interrupts_and_stolen = map(int, fields[1:9])
    return user + nice + system + sum(interrupts_and_stolen)


def _ticks(pid: int) -> int:
    """Ticks that a process has used; 0 if it has ended."""
    try:
        # The name, in brackets, may contain anything: count the fields behind it.
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0
    return int(fields[11]) + int(fields[12])
