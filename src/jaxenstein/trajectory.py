"""Trajectories: the data to replay an episode and to check that the replay is identical.

A file holds no images. It is a small JSON file with the description of the environment, the seed,
the actions, and digests of all states and observations. Its entries have the names of the
attributes below. Actions and rewards are stored as runs of [value, count], map texts as lists of
lines.
"""

from __future__ import annotations

import dataclasses
import itertools
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from .errors import SettingError, TrajectoryError
from .files import atomic, check_writable
from .spec import TEXTS, Spec

FORMAT = "jaxenstein-trajectory"
FORMAT_VERSION = 1
# The most digests in a file, and the hexadecimal digits kept of each SHA-256.
MOST_DIGESTS, DIGITS = 64, 16


@dataclasses.dataclass(frozen=True)
class Checks:
    """The outcome of the actions, for comparison; T steps give T + 1 states.

    Attributes:
        rewards: the exact reward of each step.
        terminated: whether the last step terminated the episode.
        truncated: whether the time limit was reached.
        every: the number of states, and of observations, that each digest covers; the last
            digest may cover fewer.
        states: digests of the states, starting at the reset.
        observations: digests of the observations.
    """

    rewards: tuple[float, ...]
    terminated: bool
    truncated: bool
    every: int
    states: tuple[str, ...]
    observations: tuple[str, ...]

    def differences(self, others: Checks) -> tuple[str, ...]:
        """How another run of the same actions differs, in words that name the first steps."""
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
                found.append(f"{what}: {getattr(self, what)} there, {getattr(others, what)} here")
        return tuple(found)

    def _steps(self, index: int) -> str:
        """The steps that a digest covers, in words."""
        first = index * self.every
        last = min(first + self.every, len(self.rewards) + 1) - 1
        if first == last:
            return "the reset" if first == 0 else f"step {first}"
        return f"one of steps {first} to {last}"


@dataclasses.dataclass(frozen=True)
class Trajectory:
    """An episode as a seed and actions.

    Attributes:
        environment: the spec of the environment and its params.
        seed: the seed of the `Session`, 0 to 2**32 - 1.
        actions: the action of each step; -1 does nothing.
        checks: the outcome.
        made_by: versions of this package, JAX, numpy and Python, and the hardware.
    """

    environment: Spec
    seed: int
    actions: tuple[int, ...]
    checks: Checks
    made_by: Mapping[str, str]

    def save(self, path: str | Path) -> None:
        """Write the file atomically.

        Raises:
            SettingError: `path` does not end in .json.
            OutputError: the file cannot be written.
        """
        check_trajectory(path)
        with atomic(path) as temporary:
            temporary.write_text(to_text(self), encoding="utf-8", newline="\n")


def check_trajectory(path: str | Path) -> None:
    """Check early whether a trajectory can be written to `path`.

    Raises:
        SettingError: `path` does not end in .json.
        OutputError: its folder does not exist or is not writable.
    """
    if Path(path).suffix.lower() != ".json":
        raise SettingError(f"{path} should end in .json")
    check_writable(path)


def to_text(trajectory: Trajectory) -> str:
    """The content of a trajectory file."""
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
    try:
        return json.dumps(value, allow_nan=False, ensure_ascii=False)
    except ValueError as error:
        raise TrajectoryError(f"a trajectory holds only finite numbers: {error}") from error


def digest_spacing(states: int) -> int:
    """The number of states per digest, so that there are at most `MOST_DIGESTS` digests."""
    return -(-states // MOST_DIGESTS)


def runs(values: Iterable[Any]) -> list[list[Any]]:
    """Run-length encode values as [value, count] pairs."""
    return [[value, len(list(group))] for value, group in itertools.groupby(values)]
