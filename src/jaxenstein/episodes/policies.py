"""Who acts in an episode that is recorded.

Importing this module does not import JAX, so that the command line can list the names.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from ..errors import SettingError, nearest

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
    from ..players.forward import Forward

    if name == "forward":
        return Forward(env.action_names, np.random.default_rng(seed))
    about, players = env.about(), players_of(env)
    players["random"] = players.pop("uniform")
    player = players.get(about.expert if name == "expert" else name)
    if player is None:
        known = [n for n in GENERAL if n != "expert" or about.expert] + list(about.players)
        raise SettingError(
            f"{env.name!r} has no policy {name!r}{nearest(name, known)}; it has {', '.join(known)}"
        )
    return Scripted(player, env, params)
