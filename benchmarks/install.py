"""Install the peers of the benchmarks: `python -m benchmarks.install [NAME ...]`.

Each peer gets its own virtual environment in `.venv-bench/`, since some exclude each other. If a
peer cannot be installed, the tables say so. Existing environments are kept; remove one to reinstall
it. A peer that this interpreter already has needs no environment, unless it is another version.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

FOLDER = Path(__file__).resolve().parents[1] / ".venv-bench"


class Peer(NamedTuple):
    """A peer: requirements for pip, and modules that must be importable.

    A `separate` peer needs an environment of its own, since it has another version of a package.
    """

    requirements: tuple[str, ...]
    modules: tuple[str, ...]
    separate: bool = False


class Found(NamedTuple):
    """The interpreter that has a peer, or the reason why there is none."""

    python: str = ""
    problem: str = ""


_PROJECT = tomllib.loads((FOLDER.parent / "pyproject.toml").read_text("utf-8"))["project"]
_EXTRAS = _PROJECT["optional-dependencies"]
# The requirements of this project, to measure it through Gymnasium.
_CORE = tuple(_PROJECT["dependencies"])
_OPENCV, _VIZDOOM, _GYMNASIUM, _TORCH, _SB3 = (
    next(each for each in _EXTRAS[extra] if each.startswith(name))
    for extra, name in (
        ("bench", "opencv"), ("bench", "vizdoom"), ("bench", "gymnasium"), ("torch", "torch"),
        ("sb3", "stable"),
    )
)  # fmt: skip

PEERS: dict[str, Peer] = {
    "vizdoom": Peer((_VIZDOOM, _GYMNASIUM, _OPENCV), ("vizdoom", "gymnasium", "cv2")),
    "envpool": Peer(("envpool>=1.2", _GYMNASIUM), ("envpool", "gymnasium")),
    "miniworld": Peer(("miniworld>=2.1", _OPENCV), ("miniworld", "cv2")),
    "gymnasium": Peer((*_CORE, _GYMNASIUM), ("jax", "gymnasium")),
    "jax-0.10": Peer((*_CORE, "jax<0.11", _GYMNASIUM), ("jax", "gymnasium"), separate=True),
    "training": Peer(
        (_TORCH, _SB3, "sb3-contrib>=2.4", _VIZDOOM, _GYMNASIUM, _OPENCV),
        ("torch", "stable_baselines3", "sb3_contrib", "vizdoom", "gymnasium", "cv2"),
    ),
}
# Peers to install by default; PyTorch is large.
USUAL = tuple(name for name in PEERS if name != "training")


def find(name: str) -> Found:
    """Find the interpreter that has a peer: that of its own environment, or else this one."""
    python = FOLDER / name / "bin" / "python"
    if name and python.exists():
        return Found(str(python))
    if not name:
        return Found(sys.executable)
    peer = PEERS[name]
    if not peer.separate and all(importlib.util.find_spec(module) for module in peer.modules):
        return Found(sys.executable)
    return Found(problem=f"not installed (python -m benchmarks.install {name})")


def install(name: str) -> bool:
    """Create the environment of a peer if needed; return whether its modules can be imported."""
    if not find(name).problem:
        return True
    home, peer = FOLDER / name, PEERS[name]
    python = str(home / "bin" / "python")
    hidden = ("PYTHONPATH", "VIRTUAL_ENV", "PYTHONHOME")
    environment = {name: value for name, value in os.environ.items() if name not in hidden}
    pip = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    # Find modules without importing them, since some open a display.
    look = "import importlib.util as u, sys; assert all(map(u.find_spec, sys.argv[1:]))"
    for command in (
        [sys.executable, "-m", "venv", "--clear", str(home)],
        [*pip, "--only-binary", ":all:", *peer.requirements],
        [python, "-c", look, *peer.modules],
    ):
        if subprocess.run(command, env=environment).returncode:
            shutil.rmtree(home, ignore_errors=True)
            return False
    return True


def main(argv: Sequence[str] | None = None) -> None:
    """Install the named peers, and print the result of each."""
    parser = argparse.ArgumentParser(description="Install the peers of the benchmarks.")
    known = f"{', '.join(PEERS)} (default: all but training)"
    parser.add_argument("names", nargs="*", metavar="NAME", help=known)
    options = parser.parse_args(argv)
    if unknown := [name for name in options.names if name not in PEERS]:
        parser.error(f"unknown: {', '.join(unknown)}; known: {', '.join(PEERS)}")
    for name in options.names or USUAL:
        print(f"{name}: {'ok' if install(name) else 'cannot be installed'}", flush=True)


if __name__ == "__main__":
    main()
