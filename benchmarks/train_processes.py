"""Processes and those that they start: their memory, and their end (Linux; elsewhere unknown).

Both sides of `train_compare.py` use it, so it needs the standard library alone.
"""

from __future__ import annotations

import contextlib
import os
import re
import signal
import time
from collections.abc import Sequence
from pathlib import Path

PROCESSES, SHARED_MEMORY = Path("/proc"), Path("/dev/shm")


def family(pid: int) -> list[int]:
    """A process and its descendants, whichever of its threads started them."""
    found = [pid]
    for parent in found:
        with contextlib.suppress(OSError):
            for task in (PROCESSES / str(parent) / "task").glob("*/children"):
                found += [int(child) for child in task.read_text().split()]
    return found


def session(leader: int) -> list[int]:
    """The processes of a session, also those whose parents have ended; of Linux only."""
    found = []
    for folder in PROCESSES.glob("[0-9]*"):
        with contextlib.suppress(OSError, IndexError):
            # The name, in brackets, may contain anything: count the fields behind it.
            fields = (folder / "stat").read_text().rpartition(")")[2].split()
            if int(fields[3]) == leader:
                found.append(int(folder.name))
    return found


def inside(folder: str | Path) -> list[int]:
    """The other processes whose working directory is `folder`, whoever their parents are now."""
    found = []
    for process in PROCESSES.glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if os.path.samefile(process / "cwd", folder) and int(process.name) != os.getpid():
                found.append(int(process.name))
    return found


def memory(pids: Sequence[int]) -> dict[str, int | None]:
    """What processes hold together at their peaks, in bytes; None where nobody can tell.

    Returns:
        `memory_bytes`, in which pages that several of them share count once (PSS, and how much
        more than now each held at its peak), and `peak_rss_bytes`, the sum of their peaks, where
        such pages count in each.
    """
    status = [_kibibytes(pid, "status") for pid in pids]
    peak = sum(each.get("VmHWM", 0) for each in status)
    above = sum(each.get("VmHWM", 0) - each.get("VmRSS", 0) for each in status)
    held = sum(_kibibytes(pid, "smaps_rollup").get("Pss", 0) for pid in pids)
    return {
        "memory_bytes": (held + above) * 1024 if held else None,
        "peak_rss_bytes": peak * 1024 or None,
    }


def _kibibytes(pid: int, file: str) -> dict[str, int]:
    """The figures in KiB of a file of a process, by name; none if it has ended."""
    with contextlib.suppress(OSError):
        lines = (PROCESSES / str(pid) / file).read_text().splitlines()
        words = [line.replace(":", " ").split() for line in lines]
        return {each[0]: int(each[1]) for each in words if each[2:] == ["kB"]}
    return {}


def shared_memory_free() -> int | None:
    """Free bytes of the file system that shared-memory segments lie in; None if there is none."""
    with contextlib.suppress(OSError, AttributeError):
        found = os.statvfs(SHARED_MEMORY)
        return found.f_bavail * found.f_frsize
    return None


def end(pids: Sequence[int]) -> None:
    """End processes at once, and remove the segments that engines of ViZDoom among them leave.

    A killed engine cannot remove its segments itself, and nobody else would.
    """
    engines = [engine for pid in pids if (engine := engine_of(pid))]
    for pid in pids:
        with contextlib.suppress(OSError):
            os.kill(pid, signal.SIGKILL)
    for pid in pids:
        # Children of this process stay in the table until somebody asks for their status.
        with contextlib.suppress(OSError):
            os.waitpid(pid, os.WNOHANG)
    _wait(pids, seconds=5.0)
    for engine in engines:
        for segment in SHARED_MEMORY.glob(f"ViZDoom*{engine}"):
            with contextlib.suppress(OSError):
                segment.unlink()


def engine_of(pid: int) -> str:
    """The id of the ViZDoom engine that a process is, else ""."""
    with contextlib.suppress(OSError):
        command = (PROCESSES / str(pid) / "cmdline").read_bytes().decode(errors="replace")
        found = re.search(r"viz_instance_id\0?\s*(\w+)", command)
        return found[1] if found else ""
    return ""


def _wait(pids: Sequence[int], seconds: float) -> None:
    """Wait until none of the processes runs any more; a zombie does not."""
    limit = time.monotonic() + seconds
    while any(_runs(pid) for pid in pids) and time.monotonic() < limit:
        time.sleep(0.02)


def _runs(pid: int) -> bool:
    try:
        fields = (PROCESSES / str(pid) / "stat").read_text().rpartition(")")[2].split()
    except OSError:
        return False
    return fields[0] not in "ZX"
