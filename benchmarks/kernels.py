"""How many kernels a program starts on an accelerator, and how long they run, by JAX's profiler."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax


def count_kernels(run: Callable[[], Any]) -> dict[str, float] | None:
    """Kernels and copies on the device while `run` runs, which must wait for its end.

    Returns:
        `count` and `seconds`, which adds up those that ran at once; None where the profiler saw
        no device, such as on a CPU, or this JAX cannot read its files.
    """
    profile_data = getattr(jax.profiler, "ProfileData", None)
    if profile_data is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        with jax.profiler.trace(folder):
            run()
        files = sorted(Path(folder).rglob("*.xplane.pb"))
        profiles = [profile_data.from_file(str(file)) for file in files]
        return total([event for profile in profiles for event in _device_events(profile)])


def total(durations: list[float]) -> dict[str, float] | None:
    """Number and sum of durations in nanoseconds; None if there are none."""
    if not durations:
        return None
    return {"count": float(len(durations)), "seconds": sum(durations) / 1e9}


def _device_events(profile: Any) -> list[float]:
    """Durations of what ran on the streams of accelerators."""
    return [
        event.duration_ns
        for plane in profile.planes
        if plane.name.startswith("/device:")
        for line in plane.lines
        # Other lines of the plane sum the same kernels up by operation, module and step.
        if line.name.startswith("Stream")
        for event in line.events
    ]
