"""Environments with the peers in them: `python -m benchmarks.install [NAME ...]`.

Each gets a virtual environment of its own in `.venv-bench/`, since some exclude each other. One
that cannot be installed is noted with its reason, which the tables then show; it stops no other.
An environment with the same requirements is kept, and what this interpreter has needs none.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib.util
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from reliability.partners import PARTNERS

FOLDER = Path(__file__).resolve().parents[1] / ".venv-bench"
OUTCOME = "outcome.json"


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
    if not name:
        return Found(sys.executable)
    found = _outcome(name) or Found(problem=f"not installed (python -m benchmarks.install {name})")
    return Found(sys.executable) if found.problem and _is_here(name) else found


def install(name: str) -> Found:
    """Make the environment of a peer if need be, with the first interpreter that can have it."""
    # What failed is tried again: it may have been the network.
    if (found := find(name)).python and not found.problem:
        return found
    home = FOLDER / name
    for base in interpreters():
        shutil.rmtree(home, ignore_errors=True)
        found = _try(base, home, PEERS[name])
        if not found.problem:
            break
    home.mkdir(parents=True, exist_ok=True)
    outcome = {"requirements": sorted(PEERS[name].requirements), **found._asdict()}
    (home / OUTCOME).write_text(json.dumps(outcome))
    return found


def _outcome(name: str) -> Found | None:
    """What became of the last attempt to install just this; None if there was none."""
    with contextlib.suppress(OSError, ValueError, KeyError):
        outcome = json.loads((FOLDER / name / OUTCOME).read_text())
        if outcome["requirements"] == sorted(PEERS[name].requirements):
            return Found(outcome["python"], outcome["problem"])
    return None


def _is_here(name: str) -> bool:
    return all(importlib.util.find_spec(module) for module in PEERS[name].modules)


def interpreters() -> Iterator[str]:
    """This interpreter, then those of other versions on the path, the oldest first.

    A peer without a wheel for this version may well have one for an older version.
    """
    yield sys.executable
    for minor in (11, 12, 13, 14):
        other = shutil.which(f"python3.{minor}") if minor != sys.version_info.minor else None
        # A shim on the path need not run anything.
        if other and not subprocess.run([other, "-c", "import venv"], capture_output=True).stderr:
            yield other


def _try(base: str, home: Path, peer: Peer) -> Found:
    """Make one environment and look whether what it is for can be imported."""
    python = str(home / "bin" / "python")
    hidden = ("PYTHONPATH", "VIRTUAL_ENV", "PYTHONHOME")
    environment = {name: value for name, value in os.environ.items() if name not in hidden}
    pip = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    # Modules are looked for, not imported: some open a display when they are.
    look = (
        "import importlib.util, sys\n"
        "missing = [m for m in sys.argv[1:] if importlib.util.find_spec(m) is None]\n"
        "sys.exit(f'{missing} not there after installing' if missing else 0)"
    )
    for command in (
        [base, "-m", "venv", "--clear", str(home)],
        [*pip, "--only-binary", ":all:", *peer.requirements],
        [python, "-c", look, *peer.modules],
    ):
        try:
            done = subprocess.run(command, env=environment, capture_output=True, text=True)
        except OSError as error:
            return Found(problem=f"{Path(command[0]).name} does not run: {error.strerror}")
        if done.returncode:
            lines = (done.stderr or done.stdout).strip().splitlines() or ["it gave no reason"]
            errors = [line.removeprefix("ERROR: ") for line in lines if line.startswith("ERROR")]
            return Found(problem=(errors or lines)[-1].replace(str(home), ""))
    return Found(python)


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
        print(f"{name:10}", end=" ", flush=True)
        print(install(name).problem or "ok", flush=True)


if __name__ == "__main__":
    main()
