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
    """A small environment that goes on after its end, and its params."""
    return jaxenstein.make(name, **({"height": 4, "width": 6, "autoreset": None} | settings))


class Tics(NamedTuple):
    """What many tics gave, each leaf with an axis of time in front."""

    reward: Any
    ends: Any
    info: Any
    state: Any


def player(env: Any, params: Any) -> Callable[..., Tics]:
    """A function of a state, actions and a seed that plays a tic for each action."""

    @jax.jit
    def play(state: Any, actions: jax.Array, key: jax.Array) -> Tics:
        def tic(state: Any, given: Any) -> Any:
            after, reward, ends, info = env.advance(given[1], state, given[0], params)
            return after, Tics(reward, ends, info, after)

        return jax.lax.scan(tic, state, (actions, jax.random.split(key, len(actions))))[1]

    def played(state: Any, actions: Sequence[int], seed: int = 0) -> Tics:
        given = jnp.asarray(actions, jnp.int32), jax.random.key(seed)
        return jax.device_get(play(state, *given))

    return played


def started(name: str) -> tuple[Any, Any, Callable[..., Tics]]:
    """A small environment, the first state of an episode, and its `player`."""
    env, params = make(name)
    return env, env.reset(jax.random.key(0), params)[1], player(env, params)


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
