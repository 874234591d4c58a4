"""Where numbers were made: versions and hardware, on which speeds and last bits depend."""

from __future__ import annotations

import contextlib
import importlib.metadata
import os
import platform
from pathlib import Path
from typing import Any

import jax
import numpy as np

from .version import __version__


def versions() -> dict[str, str]:
    """The versions that numbers depend on."""
    return {
        "jaxenstein": __version__,
        "jax": jax.__version__,
        "jaxlib": importlib.metadata.version("jaxlib"),
        "numpy": np.__version__,
        "python": platform.python_version(),
    }


def made_by() -> dict[str, str]:
    """What a trajectory is made by: versions, and the hardware that the code is compiled for."""
    return {
        **versions(),
        "platform": jax.default_backend(),
        "device": jax.devices()[0].device_kind,
        "machine": f"{platform.system()} {platform.machine()}",
        "processor": cpu_model(),
    }


def describe_machine() -> dict[str, Any]:
    """What a reader of speeds needs to know; starts no device."""
    allowed = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else None
    return {
        "versions": versions(),
        "hardware": {
            "cpu": cpu_model(),
            "cores": os.cpu_count(),
            "cores_allowed": allowed,
            "platform": platform.platform(),
        },
    }


def cpu_model() -> str:
    """The processor's name as the system tells it."""
    return cpu_fact("model name") or platform.processor() or platform.machine()


def cpu_fact(*names: str) -> str:
    """What Linux tells of the first processor under one of these names, "" for nothing."""
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(errors="replace").splitlines():
            name, _, value = line.partition(":")
            if name.strip() in names:
                return value.strip()
    return ""
