"""Environments with the peers in them: `python -m benchmarks.suites.peers [NAME ...]`.

Each gets a virtual environment of its own in `.venv-bench/`, since some exclude each other. One
that cannot be installed is noted with its reason, which the tables then show; it stops no other.
Nothing is installed twice: an environment with the same requirements is kept, and what this
interpreter has already needs none.
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
from dataclasses import dataclass
from pathlib import Path

from reliability.partners import PARTNERS

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / ".venv-bench"
OUTCOME = "outcome.json"
NEWEST_LAST = ("3.11", "3.12", "3.13", "3.14")


@dataclass(frozen=True)
class Peer:
    """What one environment holds.

    Attributes:
        requirements: for pip.
        modules: what must be importable.
        quick: whether a quick run installs it too.
        named: whether it is installed only where it is named.
    """

    requirements: tuple[str, ...]
    modules: tuple[str, ...]
    quick: bool = True
    named: bool = False


# What this project needs, to be measured beside a partner of its adapters.
_CORE = ("jax>=0.7", "numpy>=2.0", "pillow>=10.1")
_OPENCV = "opencv-python-headless>=4.11"


def _partner(name: str) -> Peer:
    """A partner of the adapters, with the versions that its tests run beside."""
    partner = PARTNERS[name]
    return Peer((*_CORE, *partner.requirements), ("jax", *partner.modules), quick=False)


PEERS: dict[str, Peer] = {
    "vizdoom": Peer(("vizdoom>=1.3", "gymnasium>=1.1", _OPENCV), ("vizdoom", "gymnasium", "cv2")),
    "envpool": Peer(("envpool>=1.2", "gymnasium>=1.1"), ("envpool", "gymnasium")),
    "miniworld": Peer(("miniworld>=2.1", _OPENCV), ("miniworld", "cv2")),
    "gymnasium": Peer((*_CORE, "gymnasium>=1.1"), ("jax", "gymnasium")),
    **{name: _partner(name) for name in ("gymnax", "stoa", "brax", "sb3")},
    "training": Peer(
        (
            "torch>=2.6",
            "stable-baselines3>=2.4",
            "sb3-contrib>=2.4",
            "vizdoom>=1.3",
            "gymnasium>=1.1",
            _OPENCV,
        ),
        ("torch", "stable_baselines3", "sb3_contrib", "vizdoom", "gymnasium", "cv2"),
        named=True,
    ),
}


@dataclass(frozen=True)
class Found:
    """Where a peer is.

    Attributes:
        python: the interpreter that has it; "" if there is none.
        problem: why there is none, else "".
    """

    python: str = ""
    problem: str = ""


def find(name: str, folder: Path = FOLDER) -> Found:
    """The interpreter that has a peer: its own environment's, or else this one if it has it."""
    found = Found(problem=f"not installed (python -m benchmarks.suites.peers {name})")
    with contextlib.suppress(OSError, ValueError, KeyError):
        outcome = json.loads((folder / name / OUTCOME).read_text())
        found = Found(outcome["python"], outcome["problem"])
    return Found(sys.executable) if found.problem and _is_here(PEERS[name]) else found


def _is_here(peer: Peer) -> bool:
    return all(importlib.util.find_spec(module) for module in peer.modules)


def install(name: str, folder: Path = FOLDER) -> Found:
    """Make the environment of a peer if need be, with the first interpreter that can have it.

    What this interpreter has already is measured under it.
    """
    peer, home = PEERS[name], folder / name
    if _is_here(peer):
        return Found(sys.executable)
    wanted = sorted(peer.requirements)
    with contextlib.suppress(OSError, ValueError, KeyError):
        outcome = json.loads((home / OUTCOME).read_text())
        # What failed is tried again: it may have been the network.
        if outcome["requirements"] == wanted and not outcome["problem"]:
            return Found(outcome["python"])
    found = Found(problem="no interpreter can make a virtual environment")
    for base in interpreters():
        shutil.rmtree(home, ignore_errors=True)
        found = _try(base, home, peer)
        if not found.problem:
            break
    home.mkdir(parents=True, exist_ok=True)
    outcome = {"requirements": wanted, "python": found.python, "problem": found.problem}
    (home / OUTCOME).write_text(json.dumps(outcome))
    return found


def interpreters() -> Iterator[str]:
    """This interpreter, then those of other versions on the path, the oldest first.

    A peer without a wheel for this version may well have one for an older version.
    """
    yield sys.executable
    own = f"{sys.version_info.major}.{sys.version_info.minor}"
    for version in NEWEST_LAST:
        other = "" if version == own else shutil.which(f"python{version}") or ""
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
    steps = (
        [base, "-m", "venv", "--clear", str(home)],
        [*pip, "--only-binary", ":all:", *peer.requirements],
        [python, "-c", look, *peer.modules],
    )
    for command in steps:
        try:
            done = subprocess.run(command, env=environment, capture_output=True, text=True)
        except OSError as error:
            return Found(problem=f"{Path(command[0]).name} does not run: {error.strerror}")
        if done.returncode:
            return Found(problem=_reason(done.stderr or done.stdout, str(home)))
    return Found(python)


def _reason(text: str, home: str) -> str:
    """The line of an error output that says most, without the paths of this machine."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    errors = [line.removeprefix("ERROR: ") for line in lines if line.startswith("ERROR")]
    return (errors or lines or ["it gave no reason"])[-1].replace(home, "")


def _usual(quick: bool) -> Iterator[str]:
    """What is installed where nothing is named."""
    for name, peer in PEERS.items():
        if not peer.named and (peer.quick or not quick):
            yield name


def main(argv: Sequence[str] | None = None) -> None:
    """Install what the command line names, and print what came of each."""
    parser = argparse.ArgumentParser(description="Install the peers, each apart.")
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help=f"{', '.join(PEERS)} (default: all but training)"
    )
    parser.add_argument("--quick", action="store_true", help="leave out the adapters' partners")
    parser.add_argument("--folder", type=Path, default=FOLDER, help="(default .venv-bench)")
    options = parser.parse_args(argv)
    if unknown := [name for name in options.names if name not in PEERS]:
        parser.error(f"unknown: {', '.join(unknown)}; known: {', '.join(PEERS)}")
    names = options.names or [*_usual(options.quick)]
    for name in names:
        print(f"{name:10}", end=" ", flush=True)
        print(install(name, options.folder.resolve()).problem or "ok", flush=True)


if __name__ == "__main__":
    main()
