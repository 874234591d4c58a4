"""The policies for recording an episode."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import jax
import numpy as np

from ..environment import AnyEnvironment
from ..evaluation import check_policy
from ..players import Player, player_of
from ..players.walking import walking_actions
from .session import Session


class Policy(Protocol):
    """Chooses actions from the episode so far.

    Any function of a session is a policy. A policy with a memory must reset it when
    `session.actions` is empty.
    """

    def __call__(self, session: Session) -> Any:
        """The next action: a whole number, from Python, numpy or JAX.

        Args:
            session: has `observation`, `state`, `actions` and `rewards`, and `policy_key()` for
                random choices.
        """
        ...


class Script:
    """Plays a list of actions."""

    def __init__(self, actions: Sequence[int]) -> None:
        """Play `actions` in order."""
        self._actions = tuple(actions)

    def __call__(self, session: Session) -> int:
        """The next action of the list."""
        return self._actions[len(session.actions)]


class Forward:
    """Walks forward; if blocked, tries to open a door, and then turns away.

    Now and then it also turns a little, so that it gets around.
    """

    DRIFT = 0.04

    def __init__(self, action_names: Sequence[str], rng: np.random.Generator) -> None:
        """Find the actions by their names; `interact` is optional.

        Raises:
            SettingError: an action for walking or turning is missing.
        """
        self._left, self._right, self._forward = walking_actions(action_names)
        self._interact = action_names.index("interact") if "interact" in action_names else None
        self._rng = rng
        self._forget()

    def _forget(self) -> None:
        self._plan: list[int] = []
        self._walked_from: np.ndarray | None = None
        self._tried = False

    def __call__(self, session: Session) -> int:
        """Forward, unless the last step forward did not move the agent."""
        if not session.actions:
            self._forget()
        position = np.asarray(session.state.position)
        if not self._plan:
            self._plan = self._next(position)
        action = self._plan.pop(0)
        self._walked_from = position if action == self._forward else None
        return action

    def _next(self, position: np.ndarray) -> list[int]:
        stuck = self._walked_from is not None and np.array_equal(self._walked_from, position)
        turn = (self._left, self._right)[int(self._rng.integers(2))]
        if not stuck:
            self._tried = False
            drift = self._rng.random() < self.DRIFT
            return [turn] * int(self._rng.integers(1, 4)) if drift else [self._forward]
        if self._interact is not None and not self._tried:
            self._tried = True
            return [self._interact, self._forward]
        self._tried = False
        return [turn] * int(self._rng.integers(2, 9)) + [self._forward]


class Scripted:
    """Plays like a scripted player, which sees the whole state.

    Attributes:
        env: the environment.
        params: its params.
        name: the name of the player.
        waits: as `Player.waits`.
    """

    def __init__(self, player: Player, env: AnyEnvironment, params: Any, name: str = "") -> None:
        """Store the player."""
        self.env, self.params, self.name, self.waits = env, params, name, player.waits
        self._choose = _compiled(player, env)

    def __call__(self, session: Session) -> int:
        """The action that the player chooses."""
        return int(self._choose(self.params, session.policy_key(), session.state))


@functools.lru_cache(maxsize=32)
def _compiled(player: Player, env: AnyEnvironment) -> Callable[..., Any]:
    """A function of params, key and state, compiled once per player and environment."""
    return jax.jit(lambda params, key, state: player(env, params)(key, state))


class Own:
    """A policy of observations written in JAX, as for `jaxenstein.evaluate`.

    Attributes:
        env: the environment.
        params: its params.
        name: the name of the policy.
        policy: the function.
        carry: its memory at the start of an episode, as arrays; None without one.
    """

    def __init__(
        self, policy: Callable[..., Any], carry: Any, env: AnyEnvironment, params: Any, name: str
    ) -> None:
        """Check and store the policy.

        Raises:
            SettingError: the policy takes or returns the wrong values; see `jaxenstein.evaluate`.
        """
        self.carry = check_policy(env, params, policy, carry)
        self.env, self.params, self.policy, self.name = env, params, policy, name
        self._compiled = jax.jit(lambda *given: policy(*given))

    def __call__(self, session: Session) -> int:
        """The next action."""
        obs, key = session.observation, session.policy_key()
        if self.carry is None:
            return int(self._compiled(obs, key))
        memory = self._memory if session.actions else self.carry
        self._memory, action = self._compiled(memory, obs, key)
        return int(action)


GENERAL = {
    "random": "samples every action uniformly",
    "forward": "walks forward and turns where it is blocked",
    "expert": "the best scripted player of the task",
    "idle": "does nothing",
}
"""The policies that every environment has, with descriptions."""


def named_policy(name: str, env: AnyEnvironment, params: Any, seed: int) -> Policy:
    """Look up a policy: one of `GENERAL`, or a player of the environment.

    Raises:
        SettingError: there is no such policy; the message names those of this environment.
    """
    if name == "forward":
        return Forward(env.action_names, np.random.default_rng(seed))
    return Scripted(player_of(env, name, ("forward",)), env, params, name)
