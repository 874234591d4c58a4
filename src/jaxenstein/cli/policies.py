"""Who acts in a recording."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from .arguments import UsageError

if TYPE_CHECKING:
    from ..tasks.first_person import FirstPerson


class Policy(Protocol):
    """Chooses actions."""

    def choose(self, key: Any, state: Any) -> int:
        """The next action.

        Args:
            key: a JAX key, another one at every step.
            state: the environment's state.
        """
        ...


class Script:
    """Plays a list of actions."""

    def __init__(self, actions: Sequence[int]) -> None:
        """Play `actions` in order."""
        self._actions = iter(actions)

    def choose(self, key: Any, state: Any) -> int:
        """The next action of the list."""
        del key, state
        return next(self._actions)


class RandomPolicy:
    """Draws every action uniformly."""

    def __init__(self, num_actions: int, rng: np.random.Generator) -> None:
        """Draw from `num_actions` actions."""
        self._num_actions = num_actions
        self._rng = rng

    def choose(self, key: Any, state: Any) -> int:
        """A random action."""
        del key, state
        return int(self._rng.integers(self._num_actions))


class Forward:
    """Walks on; where it is blocked it tries to open a door, and if that fails turns away.

    Now and then it also turns a little on its way, so as to come around.
    """

    DRIFT = 0.04

    def __init__(self, action_names: Sequence[str], rng: np.random.Generator) -> None:
        """Take the actions by their names; an environment without `interact` never gets it."""
        self._forward = action_names.index("forward")
        self._turns = action_names.index("turn left"), action_names.index("turn right")
        self._interact = action_names.index("interact") if "interact" in action_names else None
        self._rng = rng
        self._plan: list[int] = []
        self._walked_from: np.ndarray | None = None
        self._tried = False

    def choose(self, key: Any, state: Any) -> int:
        """Forward, unless the last step forward did not move."""
        del key
        position = np.asarray(state.position)
        if not self._plan:
            self._plan = self._next(position)
        action = self._plan.pop(0)
        self._walked_from = position if action == self._forward else None
        return action

    def _next(self, position: np.ndarray) -> list[int]:
        stuck = self._walked_from is not None and np.array_equal(self._walked_from, position)
        turn = self._turns[int(self._rng.integers(2))]
        if not stuck:
            self._tried = False
            drift = self._rng.random() < self.DRIFT
            return [turn] * int(self._rng.integers(1, 4)) if drift else [self._forward]
        if self._interact is not None and not self._tried:
            self._tried = True
            return [self._interact, self._forward]
        self._tried = False
        return [turn] * int(self._rng.integers(2, 9)) + [self._forward]


Maker = Callable[["FirstPerson[Any, Any]", Any, np.random.Generator], Policy]


@dataclasses.dataclass(frozen=True)
class Named:
    """A policy that `--policy` knows.

    Attributes:
        summary: what it does, for the help.
        make: builds it from the environment, its params and a source of random numbers.
    """

    summary: str
    make: Maker


POLICIES: dict[str, Named] = {
    "random": Named(
        "draws every action uniformly", lambda env, _, rng: RandomPolicy(env.num_actions, rng)
    ),
    "forward": Named(
        "walks on and turns where it is blocked",
        lambda env, _, rng: Forward(env.action_names, rng),
    ),
}


def parse_actions(text: str, names: Sequence[str]) -> list[int]:
    """The actions of a text like "2,2,forward*10".

    Args:
        text: numbers or names separated by commas, each optionally with `*` and a count.
        names: the names of the actions.

    Raises:
        UsageError: if the text names no action, or one that there is not.
    """
    actions: list[int] = []
    for part in text.split(","):
        word, star, times = (piece.strip() for piece in part.partition("*"))
        if word in names:
            action = names.index(word)
        elif word.isdecimal() and int(word) < len(names):
            action = int(word)
        else:
            known = ", ".join(f"{i} {name}" for i, name in enumerate(names))
            raise UsageError(f"jaxenstein record: --actions: no action {word!r}; known: {known}")
        if star and not (times.isdecimal() and 0 < int(times) <= 100_000):
            raise UsageError(f"jaxenstein record: --actions: {part.strip()!r} is not a count")
        actions += [action] * (int(times) if star else 1)
    return actions
