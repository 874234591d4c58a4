"""Shared code of the scripted players of several scenarios: walking, aiming, and `hunt`.

A player for a single scenario is in the scenario's file.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ...about import Choose, Player
from ...maps.reach import open_tiles
from ...players.chance import NO_OP
from ...players.walking import flood, next_tile, walking_actions
from .collision import LATTICE, Geometry, bearing, offsets
from .fixed import ONE
from .monster_ai import sight
from .physics import ATTACK, TURN_LEFT, TURN_RIGHT
from .scenario import DoomScenario

NEIGHBOURS = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)]
"""The neighbours of a lattice point."""
# A body keeps walking while its heading is off by less than this, in 2**32ths of a turn; turning
# for a tic changes it by 1.76 or 3.52 degrees.
_ALIGNED = 1 << 25
# In the choice of a target, a turn by a radian counts as this distance in map units. A player
# shoots if its aim is within this share of the target's half-width; `hunt` from this distance on.
_TURNING, _SURE, _RANGE = 80, 0.8, 800


def walker(env: DoomScenario[Any, Any]) -> Callable[[Any, jax.Array], jax.Array]:
    """A function from a state and an int32[2] position (16.16) to the action that leads there."""
    left, right, ahead = walking_actions(env.action_names)

    def walk(state: Any, target: jax.Array) -> jax.Array:
        error = bearing(target - state.fixed_position) - state.angle.astype(jnp.int32)
        turn = jnp.where(error > 0, jnp.int32(left), jnp.int32(right))
        aligned = jnp.abs(error) < _ALIGNED * env.frame_skip
        return jnp.where(aligned, jnp.int32(ahead), turn)

    return walk


def nearest_node(geometry: Geometry, position: jax.Array) -> jax.Array:
    """int32[2]: the point of the lattice of 16 units nearest to a position."""
    half = LATTICE * ONE // 2
    node = (position - jnp.asarray(geometry.origin) + half) // (LATTICE * ONE)
    return jnp.clip(node, 0, np.array(geometry.cells.shape, np.int32) - 1)


def free_nodes(geometry: Geometry) -> np.ndarray:
    """bool[n, m]: the lattice points where a body can be."""
    return (geometry.cells >> 3 & 1) == 0


def off_by(error: jax.Array) -> jax.Array:
    """float32[...]: the magnitude of an angle int32[...], 2**32 per turn, in radians."""
    return jnp.abs(error.astype(jnp.float32)) * jnp.float32(math.pi * 2.0**-31)


def turn_and_shoot(env: Any, params: Any) -> Choose:
    """Turn to the monster that is nearest, counting angle too, and shoot when it is ahead."""
    del params
    left, right, shoot = (env.index_of(name) for name in (TURN_LEFT, TURN_RIGHT, ATTACK))
    widths = jnp.asarray(env.horde.half_width, jnp.float32)

    def choose(key: jax.Array, state: Any) -> jax.Array:
        del key
        monsters = state.monsters
        offset = monsters.position - state.fixed_position[None]
        error = bearing(offset) - state.angle.astype(jnp.int32)
        length = jnp.sqrt(jnp.sum((offset.astype(jnp.float32) * (1 / ONE)) ** 2, axis=-1))
        off = off_by(error)
        worst = jnp.where(monsters.living, length + _TURNING * off, jnp.inf)
        first = jnp.argmin(worst)
        ahead = monsters.living[first] & (off[first] * length[first] < widths[first] * _SURE)
        turn = jnp.where(error[first] > 0, jnp.int32(left), jnp.int32(right))
        acts = jnp.where(ahead, jnp.int32(shoot), turn)
        return jnp.where(jnp.any(monsters.living), acts, NO_OP)

    return choose


TURN_AND_SHOOT = Player(
    "turns to the nearest monster and shoots when it is ahead; sees the whole state",
    turn_and_shoot,
    waits="waits: alone",
)


def only(state: Any, shown: jax.Array) -> Any:
    """The state with only the monsters bool[N]."""
    monsters = state.monsters
    health = jnp.where(shown, monsters.health, 0)
    return state.replace(monsters=monsters.replace(health=health))


def tiles_of(
    env: DoomScenario[Any, Any], places: np.ndarray | jax.Array, which: np.ndarray | jax.Array
) -> jax.Array:
    """bool[rows, columns]: the tiles of those int32[N, 2] positions for which bool[N] is true."""
    cell = jnp.floor(env.to_tiles(jnp.asarray(places))).astype(jnp.int32)
    none = jnp.zeros((env.tilemap.rows, env.tilemap.columns), bool)
    return none.at[cell[:, 1], cell[:, 0]].max(jnp.asarray(which))


def hunt(env: Any, params: Any) -> Choose:
    """Shoot the nearest visible monster; otherwise fetch things, or walk on.

    Args:
        env: a scenario with two methods for this player. `to_fetch(state)` returns int32[M, 2],
            positions of things, and bool[M], which of them to fetch; `next_tiles(state)` returns
            bool[rows, columns], the tiles to go to otherwise.
        params: its params.
    """
    fight, walk = turn_and_shoot(env, params), walker(env)
    floor = jnp.asarray(np.pad(open_tiles(env.tilemap), 1))

    def choose(key: jax.Array, state: Any) -> jax.Array:
        monsters, origin = state.monsters, state.fixed_position
        distance = jnp.sum(offsets(origin, monsters.position) ** 2, axis=-1)
        seen = monsters.living & sight(monsters, origin, env.horde.opaque)
        seen = seen & (distance < _RANGE**2) & (state.trigger.ammo > 0)
        shoots = fight(key, only(state, seen))
        places, fetched = env.to_fetch(state)
        supplies = tiles_of(env, places, fetched)
        aims = jnp.where(jnp.any(fetched), supplies, env.next_tiles(state))
        field = flood(floor, jnp.pad(aims, 1))[1:-1, 1:-1]
        column, row = next_tile(field, state)
        east = env.tiles.west * ONE + (2 * column + 1) * (env.unit * ONE // 2)
        north = env.tiles.north * ONE - (2 * row + 1) * (env.unit * ONE // 2)
        return jnp.where(jnp.any(seen), shoots, walk(state, jnp.stack([east, north])))

    return choose


HUNT = Player("shoots what is in sight, else walks on to the aim; sees the whole state", hunt)
