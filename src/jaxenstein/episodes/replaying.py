"""Playing a trajectory again, and telling whether it is the same bit for bit."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping

from ..trajectory import Trajectory
from ..view.episode import Episode
from .policies import Script
from .recorder import play
from .session import Session

COMPARED = ("rewards", "states", "observations")


@dataclasses.dataclass(frozen=True)
class Replay:
    """A trajectory played again.

    Attributes:
        episode: as it was played now; its `trajectory` says what runs now.
        original: the trajectory that was played again.
        differences: what is not as it was, each in words with its first steps; () if the
            rewards, states and observations are the same bit for bit.
    """

    episode: Episode
    original: Trajectory
    differences: tuple[str, ...]

    @property
    def identical(self) -> bool:
        """Whether all rewards, states and observations are the same bit for bit."""
        return not self.differences

    def report(self) -> str:
        """Lines that say whether it is identical; if not, where it differs and what differs."""
        if self.identical:
            return f"{self.episode.summary()}, the same bit for bit"
        assert self.episode.trajectory is not None
        now = self.episode.trajectory
        lines = [f"{self.episode.summary()}, NOT the same", *(f"  {d}" for d in self.differences)]
        differing = {difference.partition(" ")[0] for difference in self.differences}
        same = [name for name in COMPARED if name not in differing]
        lines += [f"  {' and '.join(same)} are the same bit for bit"] * bool(same)
        versions = self.original.environment.version, now.environment.version
        if versions[0] != versions[1]:
            lines.append(f"  the environment was version {versions[0]}, now it is {versions[1]}")
        lines.append(f"  made by  {described(self.original.made_by)}")
        lines.append(f"  running  {described(now.made_by)}")
        return "\n".join(lines)


def described(made_by: Mapping[str, str]) -> str:
    """Versions and hardware in one line."""
    return ", ".join(f"{name} {value}" for name, value in made_by.items())


def replay(trajectory: Trajectory, *, notify: Callable[[int], object] | None = None) -> Replay:
    """Play a trajectory again.

    Args:
        trajectory: as `load_trajectory` reads it or `Episode.trajectory` holds it.
        notify: called with the number of steps taken.

    Raises:
        JAXensteinError: its environment cannot be built any more.
    """
    spec = trajectory.environment
    env, params = spec.build()
    spec = dataclasses.replace(spec, version=env.version)
    session = Session(env, params, trajectory.seed)
    actions = Script(trajectory.actions)
    count = len(trajectory.actions)
    episode = play(session, actions, count, spec, notify=notify, beyond=True)
    assert episode.trajectory is not None
    differences = trajectory.checks.differences(episode.trajectory.checks)
    return Replay(episode, trajectory, differences)
