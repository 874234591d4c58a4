"""What the tests of Doom share: small environments, places, and many tics in one program."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import jaxenstein
from jaxenstein.tasks.doom.fixed import to_fixed
from jaxenstein.tasks.doom.monster_ai import act
from jaxenstein.tasks.doom.monsters import Horde, Monsters

NO_WALLS = np.zeros((0, 4), np.float32)


def place(x: float, y: float) -> jax.Array:
    """int32[2]: a place of map units."""
    return jnp.array([to_fixed(x), to_fixed(y)], jnp.int32)


def places(*spots: tuple[float, float]) -> jax.Array:
    """int32[N, 2]: places of map units."""
    return jnp.stack([place(*spot) for spot in spots])


def make(name: str, **settings: Any) -> tuple[Any, Any]:
    """A small environment that continues after its end, and its params."""
    return jaxenstein.make(name, **({"height": 4, "width": 6, "autoreset": None} | settings))


class Tics(NamedTuple):
    """What many tics gave, each leaf with an axis of time in front."""

    reward: Any
    ends: Any
    info: Any
    state: Any


BLOCK = 64
"""Tics in a program: tests of one scenario share it, however many tics they play."""


@functools.partial(jax.jit, static_argnums=0)
def _block(
    env: Any, params: Any, state: Any, actions: jax.Array, keys: jax.Array, fields: Any
) -> tuple[Any, Tics]:
    def tic(state: Any, given: Any) -> Any:
        action, key, fields = given
        key = jax.random.wrap_key_data(key)
        after, reward, ends, info = env.advance(key, state.replace(**fields), action, params)
        return after, Tics(reward, ends, info, after)

    return jax.lax.scan(tic, state, (actions, keys, fields))


def player(env: Any, params: Any) -> Callable[..., Tics]:
    """A function of a state, actions and a seed that plays a tic for each action.

    It also takes arrays [T, ...] of fields of the state, which are set before each tic.
    """
    params = env.check_params(params)

    def played(state: Any, actions: Sequence[int], seed: int = 0, **fields: np.ndarray) -> Tics:
        count = len(actions)
        more = -count % BLOCK
        keys = jax.random.key_data(jax.random.split(jax.random.key(seed), count + more))
        # The last block is padded by repeating the last entries; its results are cut off.
        given = [np.asarray(actions, np.int32), np.asarray(keys)[:count], fields]
        given = jax.tree.map(lambda leaf: np.concatenate([leaf, leaf[-1:].repeat(more, 0)]), given)
        parts, state = [], jax.device_get(state)
        for first in range(0, count, BLOCK):
            some = jax.tree.map(lambda leaf, at=first: leaf[at : at + BLOCK], given)
            state, part = jax.device_get(_block(env, params, state, *some))
            parts.append(part)
        return jax.tree.map(lambda *leaves: np.concatenate(leaves)[:count], *parts)

    return played


@functools.partial(jax.jit, static_argnums=0)
def first_state(env: Any, params: Any, seed: int = 0) -> Any:
    """The first state of an episode, without its frame."""
    return env.first_state(jax.random.key(seed), env.check_params(params))


def started(name: str, **settings: Any) -> tuple[Any, Any, Callable[..., Tics]]:
    """A small environment, the first state of an episode, and its `player`."""
    env, params = make(name, **settings)
    return env, first_state(env, params), player(env, params)


@functools.partial(jax.jit, static_argnames="horde")
def walked(
    horde: Horde, monsters: Monsters, player: jax.Array, noises: jax.Array, key: jax.Array
) -> tuple[Monsters, jax.Array]:
    """The monsters after each tic, and bool[T, N] who strikes; noises bool[T] are heard."""

    def tic(monsters: Monsters, given: tuple[jax.Array, jax.Array]) -> Any:
        bits = jax.random.bits(given[1], (len(horde), 2), jnp.uint32)
        after, strikes = act(horde, monsters, player, given[0], bits)
        return after, (after, strikes)

    return jax.lax.scan(tic, monsters, (noises, jax.random.split(key, len(noises))))[1]
