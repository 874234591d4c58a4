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

from .errors import SettingError
from .fields import check_whole
from .version import __version__


def use_cores(count: int | None = None) -> int:
    """Make each of some processor cores a device of JAX, over which environments spread.

    XLA's own threads gain next to nothing from a second core; two programs beside each other gain
    most of it. With several devices the adapters for NumPy (Gymnasium's vector environments and
    Stable-Baselines3) step a part of their environments on each, if their number can be divided
    by that of the cores, and `jaxenstein train --cores N` trains seeds beside each other. Where
    JAX has an accelerator nothing changes.

    Args:
        count: of cores; None for all that this process may use.

    Returns:
        The number of cores.

    Raises:
        SettingError: there are not so many, or JAX has been used already: its devices stay as
            they are from then on.

    Examples:
        >>> import jaxenstein
        >>> jaxenstein.use_cores(0)
        Traceback (most recent call last):
        jaxenstein.errors.SettingError: cores must be a whole number from 1 to ...
    """
    most = cores_allowed()
    if count is None:
        count = most
    count = check_whole("cores", count, 1, most)
    try:
        jax.config.update("jax_num_cpu_devices", count)
    except RuntimeError as error:
        raise SettingError(
            "JAX has been used already, and its devices stay as they are: call use_cores at the "
            "beginning of the program"
        ) from error
    return count


def cores_allowed() -> int:
    """How many processor cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


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
    return {
        "versions": versions(),
        "hardware": {
            "cpu": cpu_model(),
            "cores": os.cpu_count(),
            "cores_allowed": cores_allowed(),
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
