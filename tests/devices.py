"""Run programs on simulated devices, which must be set up before JAX starts."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]


def run_with_devices(number: int, *arguments: str) -> None:
    """Run a program that says "equal" on simulated devices."""
    done = subprocess.run(
        [sys.executable, "-W", "error", *arguments],
        env=_environment(number),
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "equal"


def started(code: str, devices: int) -> subprocess.Popen[str]:
    """Start a process with this many simulated devices that runs this code."""
    return subprocess.Popen(
        [sys.executable, "-c", code],
        env=_environment(devices),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def _environment(devices: int) -> dict[str, str]:
    """The variables of a process with this many simulated devices."""
    flags = f"{os.environ.get('XLA_FLAGS', '')} --xla_force_host_platform_device_count={devices}"
    path = os.pathsep.join([str(ROOT / "src"), str(ROOT)])
    return {**os.environ, "XLA_FLAGS": flags, "PYTHONPATH": path, "JAX_PLATFORMS": "cpu"}


def free_port() -> int:
    """A free port."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])
