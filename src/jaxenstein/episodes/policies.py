"""Who acts in an episode that is recorded.

Importing this module does not import JAX, so that the command line can list the names.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from ..errors import SettingError, nearest

if TYPE_CHECKING:
    from ..environment import Environment
    from ..players import Player
    from .session import Session


class Policy(Protocol):
    """Chooses actions, seeing all of the episode so far.

    Any function of a session is one. A policy with a memory begins anew where
    `session.actions` is empty.
    """

    def __call__(self, session: Session) -> Any:
        """The next action: a whole number, from Python, numpy or JAX.

        Args:
            session: with `observation`, `state`, `actions`, `rewards`, and `policy_key()` for
                random choices.
        """
        ...


class Script:
    """Plays a list of actions."""

    def __init__(self, actions: Sequence[int]) -> None:
        """Play `actions` in order."""
        self._actions = tuple(actions)

    def __call__(self, session: Session) -> int:
        """The action whose turn it is."""
        return self._actions[len(session.actions)]


class Scripted:
    """Plays as one of `jaxenstein.players`, which see the whole state."""

    def __init__(self, player: Player, env: Environment[Any, Any], params: Any) -> None:
        """Take the player.

        Raises:
            SettingError: the player does not know this environment's task.
        """
        player(env, params)
        self._params = params
        self._choose = _compiled(player, env)

    def __call__(self, session: Session) -> int:
        """What the player does in the state."""
        return int(self._choose(self._params, session.policy_key(), session.state))


@functools.lru_cache(maxsize=32)
def _compiled(player: Player, env: Environment[Any, Any]) -> Callable[..., Any]:
    """A function of params, key and state, compiled once for each player and environment."""
    import jax

    return jax.jit(lambda params, key, state: player(env, params)(key, state))


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

    def __call__(self, session: Session) -> int:
        """Forward, unless the last step forward did not move."""
        position = np.asarray(session.state.position)
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


Maker = Callable[["Environment[Any, Any]", Any, int], Policy]


@dataclasses.dataclass(frozen=True)
class Named:
    """A policy that has a name.

    Attributes:
        summary: what it does, for people.
        make: builds it from the environment, its params and a seed; a `SettingError` if it does
            not know the environment's task.
    """

    summary: str
    make: Maker


def _player(name: str) -> Maker:
    """What makes the player of that name; "expert" is the one that fits the environment."""

    def make(env: Environment[Any, Any], params: Any, seed: int) -> Policy:
        from ..players import PLAYERS, expert

        del seed
        return Scripted(PLAYERS[expert(env) if name == "expert" else name], env, params)

    return make


POLICIES: dict[str, Named] = {
    "random": Named("draws every action uniformly", _player("uniform")),
    "forward": Named(
        "walks on and turns where it is blocked",
        lambda env, params, seed: Forward(env.action_names, np.random.default_rng(seed)),
    ),
    "expert": Named("does the task: the one of the next two that fits it", _player("expert")),
    "shortest_path": Named(
        "walks to the goal, by way of keys; sees the whole state", _player("shortest_path")
    ),
    "greedy_medkits": Named(
        "goes from medkit to medkit in health-gathering; sees the whole state",
        _player("greedy_medkits"),
    ),
    "idle": Named("does nothing", _player("idle")),
}


def named_policy(name: str, env: Environment[Any, Any], params: Any, seed: int) -> Policy:
    """The policy of a name.

    Raises:
        SettingError: there is none, or it does not know this environment's task.
    """
    if name not in POLICIES:
        known = ", ".join(POLICIES)
        raise SettingError(f"unknown policy {name!r}{nearest(name, POLICIES)}; known: {known}")
    return POLICIES[name].make(env, params, seed)
