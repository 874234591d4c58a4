"""Trajectories: what it takes to play an episode again, and to tell whether it is the same.

A file holds no picture: it is small JSON with what the environment is built from, the seed, the
actions, and digests of every state and observation. Its entries bear the names of the attributes
below; actions and rewards are runs of [value, how often], the texts of a map lists of lines.
"""

from __future__ import annotations

import dataclasses
import itertools
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from .errors import SettingError
from .files import atomic, check_writable
from .spec import TEXTS, Spec

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

    environment: Spec
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


def to_text(trajectory: Trajectory) -> str:
    """The content of a trajectory's file."""
    spec, checks = trajectory.environment, trajectory.checks
    texts = TEXTS if spec.id is None else ()
    settings = {
        name: value.splitlines() if name in texts else value
        for name, value in spec.settings.items()
    }
    entries = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "made_by": dict(trajectory.made_by),
        "environment": {**spec.to_json(), "settings": settings},
        "seed": trajectory.seed,
        "actions": runs(trajectory.actions),
        "checks": {**dataclasses.asdict(checks), "rewards": runs(checks.rewards)},
    }
    lines = (f"{json.dumps(name)}: {_dumps(value)}" for name, value in entries.items())
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _dumps(value: Any) -> str:
    return json.dumps(value, allow_nan=False, ensure_ascii=False)


def digest_spacing(states: int) -> int:
    """How many of an episode's states each digest covers, for no more than `MOST_DIGESTS`."""
    return -(-states // MOST_DIGESTS)


def runs(values: Iterable[Any]) -> list[list[Any]]:
    """Values as [value, how often] each, for as long as they repeat."""
    return [[value, len(list(group))] for value, group in itertools.groupby(values)]
