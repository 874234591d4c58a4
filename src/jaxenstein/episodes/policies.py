"""Who acts in an episode that is recorded.

Importing this module does not import JAX, so that the command line can list the names.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from ..errors import SettingError, nearest, quoted

if TYPE_CHECKING:
    from ..environment import AnyEnvironment
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


class Forward:
    """Walks on; where it is blocked it tries to open a door, and if that fails turns away.

    Now and then it also turns a little on its way, so as to come around.
    """

    DRIFT = 0.04

    def __init__(self, action_names: Sequence[str], rng: np.random.Generator) -> None:
        """Take the actions by their names; an environment without `interact` never gets it.

        Raises:
            SettingError: there is no action to walk or turn with.
        """
        from ..players.walking import walking_actions

        self._left, self._right, self._forward = walking_actions(action_names)
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
    """Plays as a scripted player, which sees the whole state."""

    def __init__(self, player: Player, env: AnyEnvironment, params: Any) -> None:
        """Take the player."""
        self.waits = player.waits
        self._params = params
        self._choose = _compiled(player, env)

    def __call__(self, session: Session) -> int:
        """What the player does in the state."""
        return int(self._choose(self._params, session.policy_key(), session.state))


@functools.lru_cache(maxsize=32)
def _compiled(player: Player, env: AnyEnvironment) -> Callable[..., Any]:
    """A function of params, key and state, compiled once for each player and environment."""
    import jax

    return jax.jit(lambda params, key, state: player(env, params)(key, state))


class Own:
    """A policy of observations, in JAX, as `jaxenstein.evaluate` takes one.

    Attributes:
        env: the environment that it plays in.
        params: its params.
        name: of the policy, to show.
        policy: the function.
        carry: its memory at the start of an episode, as arrays; None without one.
    """

    def __init__(
        self, policy: Callable[..., Any], carry: Any, env: AnyEnvironment, params: Any, name: str
    ) -> None:
        """Take the policy.

        Raises:
            SettingError: it takes or returns something else than `jaxenstein.evaluate` says.
        """
        import jax

        from ..evaluation import check_policy

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
    "random": "draws every action uniformly",
    "forward": "walks on and turns where it is blocked",
    "expert": "does the task: the best of the players that know it",
    "idle": "does nothing",
}
"""The policies that there are in every environment, in words."""


def named_policy(name: str, env: AnyEnvironment, params: Any, seed: int) -> Policy:
    """The policy of a name: one of `GENERAL`, or a player of the environment's own.

    Raises:
        SettingError: there is none; the message names those of this environment.
    """
    from ..players import players_of

    if name == "forward":
        return Forward(env.action_names, np.random.default_rng(seed))
    about, players = env.about(), players_of(env)
    players["random"] = players.pop("uniform")
    player = players.get(about.expert if name == "expert" else name)
    if player is None:
        known = [n for n in GENERAL if n != "expert" or about.expert] + list(about.players)
        raise SettingError(
            f"{quoted(env.name)} has no policy {quoted(name)}{nearest(name, known)}; it has "
            f"{', '.join(known)}"
        )
    return Scripted(player, env, params)
