"""A player for steps so long, and limits so short, that a way from tile to tile wastes too many.

It looks at all ways of two straight legs: some turns, some strides, some turns, some strides.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..._jax.batching import varying
from ...about import Choose, Player
from ...engine.level import Level
from ...engine.motion import forward, walk
from ...players.walking import Gait, gait, shortest_path
from ..minigrid.state import GridState, solid_level

# Turns before either leg, either way, and the most strides of one.
_FIRST, _SECOND, _STRIDES = 4, 2, 14
_NEVER = 2**14


class Ground(NamedTuple):
    """What a leg is walked on, and what there is to touch.

    Attributes:
        level: walls and things.
        closed: bool[D], which of them are there.
        things: float32[N, 2], (x, y) in tiles.
        right: bool[N], which of them is to be touched; the others end the episode.
        radius: float32[], tiles at which one is touched.
    """

    level: Level
    closed: jax.Array
    things: jax.Array
    right: jax.Array
    radius: Any


class Leg(NamedTuple):
    """Positions after 0, 1, 2, ... strides; S is the most strides and one.

    Attributes:
        position: float32[S, 2].
        open: bool[S], whether all strides so far went ahead, and touched nothing wrong.
        there: bool[S], whether the right thing is touched.
    """

    position: jax.Array
    open: jax.Array
    there: jax.Array


def find(env: Any, params: Any) -> Choose:
    """The first action of the way with the fewest actions; where there is none, walk on tiles."""
    body, otherwise = gait(env, params), shortest_path(env, params)
    numbers = [np.arange(-most, most + 1, dtype=np.float32) for most in (_FIRST, _SECOND)]

    def choose(key: jax.Array, state: GridState) -> jax.Array:
        level, closed = solid_level(state)
        middle = state.things.tile.astype(jnp.float32) + 0.5
        ground = Ground(level, closed, middle, env.target(state), params.touch_radius)

        def second(position: jax.Array, heading: jax.Array, turns: jax.Array) -> Leg:
            return _leg(body, ground, position, heading + turns * body.angle)

        def first(turns: jax.Array) -> tuple[Leg, Leg]:
            heading = state.heading + turns * body.angle
            leg = _leg(body, ground, state.position, heading)
            ends = jax.vmap(second, (None, None, 0))
            return leg, jax.vmap(ends, (0, None, None))(
                leg.position, heading, jnp.asarray(numbers[1])
            )

        legs = jax.vmap(first)(jnp.asarray(numbers[0]))
        action, found = _first_action(body, *legs, *numbers)
        return jnp.where(found, action, otherwise(key, state))

    return choose


def _first_action(
    body: Gait, leg: Leg, then: Leg, first: np.ndarray, second: np.ndarray
) -> tuple[jax.Array, jax.Array]:
    """int32[], what to do first on the shortest way that ends at the right thing; bool[], if any.

    Args:
        body: how it moves.
        leg: the first ones, [F, S].
        then: the second ones from each of their places, [F, S, T, S].
        first: float32[F], turns to the right before the first ones.
        second: float32[T], before the second ones.
    """
    strides = np.arange(_STRIDES + 1, dtype=np.int32)
    turns = np.abs(first).astype(np.int32)[:, None, None, None]
    more = np.abs(second).astype(np.int32)[:, None] + strides
    ends = leg.open[:, :, None, None] & then.open & then.there
    actions = jnp.where(ends, turns + strides[:, None, None] + more, np.int32(_NEVER))
    chosen = jnp.argmin(actions)
    spin, stride, again, _ = jnp.unravel_index(chosen, actions.shape)
    # Without a first leg the turns of both are one.
    turn = jnp.asarray(first)[spin]
    turn = jnp.where((turn == 0) & (stride == 0), jnp.asarray(second)[again], turn)
    turned = jnp.where(turn > 0, jnp.int32(body.right), jnp.int32(body.left))
    action = jnp.where(turn == 0, jnp.int32(body.forward), turned)
    return action, actions.reshape(-1)[chosen] < _NEVER


def _leg(body: Gait, ground: Ground, position: jax.Array, heading: jax.Array) -> Leg:
    """Walk straight ahead from a place."""
    step = forward(heading) * body.step

    def stride(carry: tuple[jax.Array, jax.Array], _: None) -> tuple[Any, Any]:
        before, going = carry
        after = walk(ground.level, ground.closed, before, step)
        there, wrong = _touched(ground, after)
        going = going & jnp.any(after != before) & ~wrong
        return (after, going), (after, going, there)

    start = varying((position, jnp.bool_(True)), position, heading, ground)
    _, walked = jax.lax.scan(stride, start, length=_STRIDES * body.steps)
    here = position, jnp.bool_(True), _touched(ground, position)[0]
    decided = jax.tree.map(lambda leaf: leaf[body.steps - 1 :: body.steps], walked)
    return Leg(*jax.tree.map(lambda a, b: jnp.concatenate([a[None], b]), here, decided))


def _touched(ground: Ground, position: jax.Array) -> tuple[jax.Array, jax.Array]:
    """bool[]: whether the right thing is touched; bool[]: whether another is, and not that."""
    distance = jnp.sqrt(jnp.sum((ground.things - position[None]) ** 2, axis=-1))
    touched = distance < ground.radius
    right = jnp.any(touched & ground.right)
    return right, jnp.any(touched & ~ground.right) & ~right


TWO_LEGS = Player("takes the shortest way of two straight legs; sees the whole state", find)
