"""Trajectories: what it takes to play an episode again, and to tell whether it is the same.

A file holds no picture: it is small JSON with what the environment is built from, the seed, the
actions, and digests of every state and observation. Its entries bear the names of the attributes
below; actions and rewards are runs of [value, how often], the texts of a map lists of lines.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import importlib.metadata
import itertools
import json
import platform
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np

from ..errors import SettingError
from ..files import atomic, check_writable
from ..recipe import TEXTS, Recipe, recipe_of
from ..version import __version__
from .session import Session

FORMAT = "jaxenstein-trajectory"
FORMAT_VERSION = 1
# Digests in a file are at most so many, each of so many hexadecimal digits of a SHA-256.
MOST_DIGESTS, DIGITS = 64, 16


@dataclasses.dataclass(frozen=True)
class Checks:
    """What came of the actions, for comparing; T steps make T + 1 states.

    Attributes:
        rewards: of each step, exactly.
        terminated: whether the last step ended the task.
        truncated: whether the time limit was reached.
        every: how many states, and as many observations, each digest covers; the last one may
            cover fewer.
        states: digests of the states, from the reset on.
        observations: digests of the observations.
    """

    rewards: tuple[float, ...]
    terminated: bool
    truncated: bool
    every: int
    states: tuple[str, ...]
    observations: tuple[str, ...]

    def differences(self, others: Checks) -> tuple[str, ...]:
        """What differs in another run of the same actions, in words with the first steps."""
        found = []
        for step, (one, other) in enumerate(zip(self.rewards, others.rewards, strict=True), 1):
            if one != other:
                found.append(f"rewards differ from step {step} on: {one!r} there, {other!r} here")
                break
        for what in ("states", "observations"):
            pairs = zip(getattr(self, what), getattr(others, what), strict=True)
            differing = next((i for i, (one, other) in enumerate(pairs) if one != other), None)
            if differing is not None:
                found.append(f"{what} differ from {self._steps(differing)} on")
        for what in ("terminated", "truncated"):
            if getattr(self, what) != getattr(others, what):
                found.append(f"{what} was {getattr(self, what)} there, is {getattr(others, what)}")
        return tuple(found)

    def _steps(self, index: int) -> str:
        """The steps that a digest covers, in words."""
        first = index * self.every
        last = min(first + self.every, len(self.rewards) + 1) - 1
        if first == last:
            return "the reset" if first == 0 else f"step {first}"
        return f"some step of {first} to {last}"


class Witness:
    """Sees every state and observation of a session, and keeps their digests."""

    def __init__(self) -> None:
        """Begin with nothing seen."""
        self._states: list[bytes] = []
        self._observations: list[bytes] = []

    def look(self, session: Session) -> None:
        """Take in what the session shows; call it after the reset and after each step."""
        self._states.append(digest(session.state))
        self._observations.append(digest(session.observation))

    def checks(self, session: Session) -> Checks:
        """What the session came to."""
        every = -(-len(self._states) // MOST_DIGESTS)
        return Checks(
            rewards=tuple(session.rewards),
            terminated=session.terminated,
            truncated=session.truncated,
            every=every,
            states=_thinned(self._states, every),
            observations=_thinned(self._observations, every),
        )


def digest(tree: Any) -> bytes:
    """SHA-256 of the dtype, shape and bytes of each leaf of a pytree, in order."""
    sha = hashlib.sha256()
    for leaf in jax.tree.leaves(jax.device_get(tree)):
        array = np.asarray(leaf)
        little = array.astype(array.dtype.newbyteorder("<"), copy=False)
        sha.update(f"{array.dtype.name}{array.shape}".encode())
        sha.update(little.tobytes())
    return sha.digest()


def _thinned(digests: Sequence[bytes], every: int) -> tuple[str, ...]:
    """One digest for every so many."""
    groups = (digests[start : start + every] for start in range(0, len(digests), every))
    return tuple(hashlib.sha256(b"".join(group)).hexdigest()[:DIGITS] for group in groups)


@dataclasses.dataclass(frozen=True)
class Trajectory:
    """An episode as seed and actions.

    Attributes:
        environment: what the environment and its params are built from.
        seed: of the `Session`, 0 to 2**32 - 1.
        actions: of each step; -1 does nothing.
        checks: what came of it.
        made_by: versions of this package, JAX, numpy and Python, and the hardware.
    """

    environment: Recipe
    seed: int
    actions: tuple[int, ...]
    checks: Checks
    made_by: Mapping[str, str]

    def save(self, path: str | Path) -> None:
        """Write the file, whole or not at all.

        Raises:
            SettingError: `path` does not end in .json.
            OutputError: it cannot be written.
        """
        check_trajectory(path)
        with atomic(path) as temporary:
            temporary.write_text(to_text(self), encoding="utf-8", newline="\n")


def check_trajectory(path: str | Path) -> None:
    """Find out early whether a trajectory can be written at `path`.

    Raises:
        SettingError: it does not end in .json.
        OutputError: its folder is missing or cannot be written to.
    """
    if Path(path).suffix.lower() != ".json":
        raise SettingError(f"{path} should end in .json")
    check_writable(path)


def trajectory_of(session: Session, recipe: Recipe | None = None) -> Trajectory:
    """The trajectory of a session, found by playing its actions once more.

    Args:
        session: an episode, finished or not.
        recipe: how its environment is built, if that is known.

    Raises:
        TrajectoryError: neither `make` nor `from_ascii` builds its environment.
    """
    recipe = recipe or recipe_of(session.env, session.params)
    again = Session(session.env, session.params, session.seed)
    witness = Witness()
    witness.look(again)
    for action in session.actions:
        again.step(action)
        witness.look(again)
    return witnessed(again, witness, recipe)


def witnessed(session: Session, witness: Witness, recipe: Recipe) -> Trajectory:
    """The trajectory of a session that a witness has seen all of."""
    return Trajectory(
        environment=recipe,
        seed=session.seed,
        actions=tuple(session.actions),
        checks=witness.checks(session),
        made_by=running(),
    )


def running() -> dict[str, str]:
    """What runs now: versions, and the hardware, on which the last bits of numbers depend."""
    return {
        "jaxenstein": __version__,
        "jax": jax.__version__,
        "jaxlib": importlib.metadata.version("jaxlib"),
        "numpy": np.__version__,
        "python": platform.python_version(),
        "platform": jax.default_backend(),
        "device": jax.devices()[0].device_kind,
        "machine": f"{platform.system()} {platform.machine()}",
        "processor": _processor(),
    }


def _processor() -> str:
    """The model of the CPU; compiled code rounds by what instructions it has."""
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(errors="replace").splitlines():
            name, _, model = line.partition(":")
            if name.strip() == "model name":
                return model.strip()
    return platform.processor()


def to_text(trajectory: Trajectory) -> str:
    """The content of a trajectory's file."""
    recipe, checks = trajectory.environment, trajectory.checks
    settings = {
        name: value.splitlines() if name in TEXTS else value
        for name, value in recipe.settings.items()
    }
    entries = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "made_by": dict(trajectory.made_by),
        "environment": {
            "id": recipe.id,
            "version": recipe.version,
            "settings": settings,
            "params": dict(recipe.params),
        },
        "seed": trajectory.seed,
        "actions": runs(trajectory.actions),
        "checks": {**dataclasses.asdict(checks), "rewards": runs(checks.rewards)},
    }
    lines = (f"{json.dumps(name)}: {_dumps(value)}" for name, value in entries.items())
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _dumps(value: Any) -> str:
    return json.dumps(value, allow_nan=False, ensure_ascii=False)


def runs(values: Iterable[Any]) -> list[list[Any]]:
    """Values as [value, how often] each, for as long as they repeat."""
    return [[value, len(list(group))] for value, group in itertools.groupby(values)]
