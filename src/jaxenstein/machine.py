"""Versions and hardware, on which speeds and the last bits of numbers depend."""

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
    """Make each of several CPU cores a JAX device, and spread environments over them.

    XLA gains next to nothing from a second core, but two programs side by side use most of it.
    With several devices, the adapters for NumPy (Gymnasium's vector environments and
    Stable-Baselines3) step a share of their environments on each device, if the number of devices
    divides the number of environments. `jaxenstein train --cores N` trains seeds in parallel. If
    JAX uses an accelerator, nothing changes.

    Args:
        count: the number of cores; None for all that this process may use.

    Returns:
        The number of cores.

    Raises:
        SettingError: there are fewer cores, or JAX is already in use, so its devices are fixed.

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
            "JAX is already in use and cannot change its devices: call use_cores at the "
            "beginning of the program"
        ) from error
    return count


def cores_allowed() -> int:
    """The number of CPU cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def versions() -> dict[str, str]:
    """The versions of all software that numbers depend on."""
    return {
        "jaxenstein": __version__,
        "jax": jax.__version__,
        "jaxlib": importlib.metadata.version("jaxlib"),
        "numpy": np.__version__,
        "python": platform.python_version(),
    }


def made_by() -> dict[str, str]:
    """The versions and the hardware recorded in a trajectory."""
    return {
        **versions(),
        "platform": jax.default_backend(),
        "device": jax.devices()[0].device_kind,
        "machine": f"{platform.system()} {platform.machine()}",
        "processor": cpu_model(),
    }


def describe_machine() -> dict[str, Any]:
    """The facts needed to interpret a measured speed; starts no device."""
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
    """The name of the processor."""
    return cpu_fact("model name") or platform.processor() or platform.machine()


def cpu_fact(*names: str) -> str:
    """A Linux fact about the first processor, under any of these names; "" if there is none."""
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(errors="replace").splitlines():
            name, _, value = line.partition(":")
            if name.strip() in names:
                return value.strip()
    return ""
