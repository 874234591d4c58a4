"""What a machine allows before many processes are started, and whether they will fit."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.tables import plural
from benchmarks.train_processes import shared_memory_free

GROUP = Path("/sys/fs/cgroup")
GIB = 2**30


def limits() -> dict[str, int | None]:
    """What is free and what is allowed now; None where there is no limit or nobody can tell.

    Returns:
        `memory_free_bytes` and `shared_memory_free_bytes`; `processes` and `files`, what this
        user and one process may have (soft limits); `group_processes`, what the container may.
    """
    return {
        "memory_free_bytes": memory_free(),
        "shared_memory_free_bytes": shared_memory_free(),
        "processes": _soft_limit("RLIMIT_NPROC"),
        "files": _soft_limit("RLIMIT_NOFILE"),
        "group_processes": _number(GROUP / "pids.max"),
    }


def memory_free() -> int | None:
    """Bytes of memory that may still be used, of the machine or of the container if less."""
    found = []
    with contextlib.suppress(OSError, StopIteration):
        lines = Path("/proc/meminfo").read_text().splitlines()
        found.append(1024 * next(int(e.split()[1]) for e in lines if e.startswith("MemAvailable")))
    most, used = _number(GROUP / "memory.max"), _number(GROUP / "memory.current")
    if most is not None and used is not None:
        with contextlib.suppress(OSError, ValueError):
            # Files that are only cached make way.
            words = [line.split() for line in (GROUP / "memory.stat").read_text().splitlines()]
            used -= int(dict(words).get("inactive_file", 0))
        found.append(max(0, most - used))
    return min(found, default=None)


def memory_kills() -> int:
    """How many processes the system has ended so far because memory ran out."""
    with contextlib.suppress(OSError, ValueError, IndexError):
        for line in Path("/proc/vmstat").read_text().splitlines():
            if line.startswith("oom_kill "):
                return int(line.split()[1])
    return 0


def misfit(
    number: int, measured: Sequence[Mapping[str, Any]], free: Mapping[str, int | None]
) -> str:
    """Why `number` environments will not fit, going by the last number measured; "" if they may.

    Memory beyond what the process held before (`base_bytes`), and shared memory, are taken to
    grow with the number.

    Args:
        number: of environments.
        measured: earlier results of the same side.
        free: see `limits`.
    """
    known = [each for each in measured if each.get("memory_bytes") and each.get("rates")]
    if not known:
        return ""
    last = known[-1]
    times, base = number / last["envs"], last.get("base_bytes") or 0
    wants = {
        "memory": (base + max(0, last["memory_bytes"] - base) * times, "memory_free_bytes"),
        "shared memory": (
            (last.get("shared_memory_bytes") or 0) * times,
            "shared_memory_free_bytes",
        ),
    }
    for name, (need, place) in wants.items():
        there = free.get(place)
        if there is not None and need > there:
            return (
                f"not tried: going by {plural(last['envs'], 'environment')} it needs about "
                f"{need / GIB:.1f} GiB of {name}, and {there / GIB:.1f} GiB are free"
            )
    return ""


def _number(file: Path) -> int | None:
    with contextlib.suppress(OSError, ValueError):
        return int(file.read_text())
    return None


def _soft_limit(name: str) -> int | None:
    with contextlib.suppress(ImportError, AttributeError, OSError):
        import resource

        found = resource.getrlimit(getattr(resource, name))[0]
        return None if found == resource.RLIM_INFINITY else found
    return None
