"""Environments with the peers in them: `python -m benchmarks.install [NAME ...]`.

Each gets a virtual environment of its own in `.venv-bench/`, since some exclude each other. One
that cannot be installed stops no other; the tables then say so. An environment that is there is
kept (remove it to install anew), and what this interpreter has needs none.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from reliability.partners import PARTNERS

FOLDER = Path(__file__).resolve().parents[1] / ".venv-bench"


class Peer(NamedTuple):
    """What one environment holds: pip's requirements, and what must be importable."""

    requirements: tuple[str, ...]
    modules: tuple[str, ...]


class Found(NamedTuple):
    """Where a peer is: the interpreter that has it, or why there is none."""

    python: str = ""
    problem: str = ""


# What this project needs, to be measured beside a partner of its adapters.
_CORE = ("jax>=0.7", "numpy>=2.0", "pillow>=10.1")
_OPENCV, _VIZDOOM, _GYMNASIUM = "opencv-python-headless>=4.11", "vizdoom>=1.3", "gymnasium>=1.1"
_TRAINING = ("torch>=2.6", "stable-baselines3>=2.4", "sb3-contrib>=2.4")

PEERS: dict[str, Peer] = {
    "vizdoom": Peer((_VIZDOOM, _GYMNASIUM, _OPENCV), ("vizdoom", "gymnasium", "cv2")),
    "envpool": Peer(("envpool>=1.2", _GYMNASIUM), ("envpool", "gymnasium")),
    "miniworld": Peer(("miniworld>=2.1", _OPENCV), ("miniworld", "cv2")),
    "gymnasium": Peer((*_CORE, _GYMNASIUM), ("jax", "gymnasium")),
    # With the versions that the adapters' tests run beside.
    **{
        name: Peer((*_CORE, *PARTNERS[name].requirements), ("jax", *PARTNERS[name].modules))
        for name in ("gymnax", "stoa", "sb3")
    },
    "training": Peer(
        (*_TRAINING, _VIZDOOM, _GYMNASIUM, _OPENCV),
        ("torch", "stable_baselines3", "sb3_contrib", "vizdoom", "gymnasium", "cv2"),
    ),
}
# Installed where nothing is named: of a quick run, and of a full one. PyTorch is large.
QUICK = ("vizdoom", "envpool", "miniworld", "gymnasium")
USUAL = tuple(name for name in PEERS if name != "training")


def find(name: str) -> Found:
    """The interpreter that has a peer: its own environment's, or else this one if it has it."""
    python = FOLDER / name / "bin" / "python"
    if name and python.exists():
        return Found(str(python))
    if not name or all(importlib.util.find_spec(module) for module in PEERS[name].modules):
        return Found(sys.executable)
    return Found(problem=f"not installed (python -m benchmarks.install {name})")


def install(name: str) -> bool:
    """Make the environment of a peer if need be; whether it can import what it is for."""
    if not find(name).problem:
        return True
    home, peer = FOLDER / name, PEERS[name]
    python = str(home / "bin" / "python")
    hidden = ("PYTHONPATH", "VIRTUAL_ENV", "PYTHONHOME")
    environment = {name: value for name, value in os.environ.items() if name not in hidden}
    pip = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    # Modules are looked for, not imported: some open a display when they are.
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
    """Install what the command line names, and print what came of each."""
    parser = argparse.ArgumentParser(description="Install the peers, each apart.")
    known = f"{', '.join(PEERS)} (default: all but training)"
    parser.add_argument("names", nargs="*", metavar="NAME", help=known)
    parser.add_argument("--quick", action="store_true", help="leave out the adapters' partners")
    options = parser.parse_args(argv)
    if unknown := [name for name in options.names if name not in PEERS]:
        parser.error(f"unknown: {', '.join(unknown)}; known: {', '.join(PEERS)}")
    for name in options.names or (QUICK if options.quick else USUAL):
        print(f"{name}: {'ok' if install(name) else 'cannot be installed'}", flush=True)


if __name__ == "__main__":
    main()
