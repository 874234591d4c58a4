"""Scripted players: one that does nothing, one that acts at random, and those of the tasks.

Nothing here depends on a task. Tasks declare their own players (`Environment.about`), and build
them from the paths and steps in `walking`.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp

from .._jax.batching import select, varying
from ..about import Choose, Player
from ..errors import SettingError, nearest, quoted
from ..params import with_numbers
from ..pytree import PyTreeNode
from .chance import IDLE, UNIFORM

if TYPE_CHECKING:
    from ..environment import AnyEnvironment

EXPERT = "expert"
"""Stands for the best player of the task."""


def players_of(env: AnyEnvironment) -> dict[str, Player]:
    """All players of an environment by name: idle, random, and those of its task."""
    return {"idle": IDLE, "random": UNIFORM, **env.about().players}


def player_of(env: AnyEnvironment, name: str = EXPERT, others: Sequence[str] = ()) -> Player:
    """Look up a player by name; `"expert"` is the best player of the task.

    Args:
        env: the environment.
        name: the name.
        others: what else the caller accepts, for the message.

    Raises:
        SettingError: the environment has no such player; the message names the players it has.
    """
    players, expert = players_of(env), env.about().expert
    wanted = expert if name == EXPERT else name
    if wanted not in players:
        known = [*players, *[EXPERT] * bool(expert), *others]
        raise SettingError(
            f"{quoted(env.name)} has no player {quoted(name)}{nearest(name, known)}; it has "
            f"{', '.join(known)}"
        )
    return players[wanted]


class Played(PyTreeNode):
    """The results of B episodes.

    Attributes:
        returned: float32[B], undiscounted sums of rewards.
        length: int32[B], decisions of `frame_skip` world steps each.
        terminated: bool[B], whether the task ended the episode; otherwise the time limit did.
        successes: int32[B], how often the aim of the task was reached.
    """

    returned: jax.Array
    length: jax.Array
    terminated: jax.Array
    successes: jax.Array


@functools.partial(jax.jit, static_argnums=(0, 1))
def play(
    env: AnyEnvironment,
    player: Player,
    params: Any,
    key: jax.Array,
    states: Any,
    numbers: dict[str, jax.Array] | None = None,
) -> Played:
    """Play one episode from each state to its end.

    Args:
        env: the environment; its `autoreset` does not matter.
        player: the player, such as `player_of(env)`.
        params: the params of the environment.
        key: the random key of all steps.
        states: B first states, each leaf with a leading axis B.
        numbers: params of each episode by name, [B] each, instead of those in `params`.
    """
    batch, numbers = states.done.shape[0], numbers or {}
    of_all = None if numbers else player(env, params)

    def advance(key: jax.Array, state: Any, numbers: Any) -> tuple[Any, jax.Array, jax.Array]:
        policy_key, step_key = jax.random.split(key)
        own = with_numbers(params, numbers)
        choose = of_all or player(env, own)
        action = choose(policy_key, state)
        after, _, terminated, info = env.advance(step_key, state, action, own)
        success = (info["success"] & ~state.done).astype(jnp.int32)
        return select(state.done, state, after), terminated & ~state.done, success

    def body(carry: tuple[Any, ...]) -> tuple[Any, ...]:
        key, states, terminated, successes = carry
        key, step_key = jax.random.split(key)
        keys = jax.random.split(step_key, batch)
        states, ended, reached = jax.vmap(advance)(keys, states, numbers)
        return key, states, terminated | ended, successes + reached

    start = key, states, jnp.zeros(batch, bool), jnp.zeros(batch, jnp.int32)
    start = varying(start, start, params)
    end = jax.lax.while_loop(lambda carry: ~jnp.all(carry[1].done), body, start)
    _, states, terminated, successes = end
    return Played(
        returned=states.episode_return,
        length=-(-states.time // env.frame_skip),
        terminated=terminated,
        successes=successes,
    )


__all__ = [
    "EXPERT",
    "IDLE",
    "UNIFORM",
    "Choose",
    "Played",
    "Player",
    "play",
    "player_of",
    "players_of",
]
