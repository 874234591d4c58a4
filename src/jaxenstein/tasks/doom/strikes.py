"""What the strikes of monsters do: bites, and bullets that may hit another monster instead."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..._jax.batching import where_few
from .creatures import FEW, Creatures, in_reach, sight
from .dice import byte, roll, spread
from .feuds import quarry
from .geometry import RADIUS
from .kinds import Act, Roster
from .shots import along, bearing, first_body

# Shots that reach no farther are blows, for which the player must be near.
_BLOW = 100


class Blows(NamedTuple):
    """What strikes do.

    Attributes:
        lost: int32[N], what the player loses by each monster.
        dealt: int32[N], what each monster loses.
        source: int32[N], by which other one.
        bitten: bool[N], who has bitten.
    """

    lost: jax.Array
    dealt: jax.Array
    source: jax.Array
    bitten: jax.Array


def strike(
    roster: Roster,
    creatures: Creatures,
    strikes: jax.Array,
    player: jax.Array,
    bits: jax.Array,
    opaque: np.ndarray,
) -> Blows:
    """What those do who strike.

    Args:
        roster: their kinds.
        creatures: the monsters.
        strikes: bool[N], who strikes now, as the act of its frame says.
        player: int32[2], where the player is.
        bits: uint32[N, R], random; R is the most rays of a shot, and at least 1.
        opaque: float32[L, 4], walls that stop bullets.
    """
    # In a tic, monsters strike in few of a batch.
    blows = where_few(partial(_blows, roster, opaque), FEW)
    return blows(jnp.any(strikes), creatures, strikes, player, bits)


def _blows(
    roster: Roster,
    opaque: np.ndarray,
    creatures: Creatures,
    strikes: jax.Array,
    player: jax.Array,
    bits: jax.Array,
) -> Blows:
    goal, width = quarry(roster, creatures, player)
    near = in_reach(goal - creatures.position, width, sight(creatures, goal, opaque))
    acts = jnp.asarray(roster.acts).at[creatures.frame].get(mode="promise_in_bounds")
    bites = strikes & near & ((acts == Act.BITE) | (acts == Act.THROW))
    bite = jnp.where(bites, roll(roster.dice, roster.sides, byte(bits[:, 0], 2)), 0)
    if creatures.feud is None and not roster.rays.any():
        nothing = jnp.zeros_like(bite)
        return Blows(bite, nothing, nothing, bites)
    dealt = _bitten(creatures, bite)
    if roster.rays.any():
        shoots = strikes & (acts == Act.SHOOT)
        places = player, goal
        dealt = dealt + _shot(roster, creatures, shoots, near, places, bits, opaque)
    source = jnp.argmax(dealt[:, :-1], axis=0).astype(jnp.int32)
    return Blows(dealt[:, -1], jnp.sum(dealt[:, :-1], axis=0, dtype=jnp.int32), source, bites)


def _bitten(creatures: Creatures, bite: jax.Array) -> jax.Array:
    """int32[N, N + 1]: what bites int32[N] do to each monster, and to the player."""
    count = bite.shape[0]
    if creatures.feud is None:
        return jnp.pad(bite[:, None], ((0, 0), (count, 0)))
    index = np.arange(count + 1, dtype=np.int32)[None]
    return jnp.where(creatures.feud.target[:, None] == index, bite[:, None], 0)


def _shot(
    roster: Roster,
    creatures: Creatures,
    shoots: jax.Array,
    near: jax.Array,
    places: tuple[jax.Array, jax.Array],
    bits: jax.Array,
    opaque: np.ndarray,
) -> jax.Array:
    """int32[N, N + 1]: what bullets do to each monster, and to the player.

    Args:
        roster: their kinds.
        creatures: the monsters.
        shoots: bool[N], who shoots.
        near: bool[N], whose enemy can be reached by a blow.
        places: int32[2] where the player is, int32[N, 2] where the enemies are.
        bits: uint32[N, R], random.
        opaque: float32[L, 4].
    """
    player, goal = places
    count = int(roster.rays.max())
    shoots = shoots & (near | (roster.reach > _BLOW))
    rays = np.arange(count)[None] < roster.rays[:, None]
    shape = (len(roster), count)
    aim = bearing(goal - creatures.position).astype(jnp.uint32)
    angle = aim[:, None] + spread(bits, roster.spread[:, None])
    others = ~np.eye(len(roster), len(roster) + 1, dtype=bool)
    there = jnp.append(creatures.living, True)[None] & others
    hit = first_body(
        jnp.broadcast_to(creatures.position[:, None], (*shape, 2)),
        along(angle),
        jnp.concatenate([creatures.position, player[None]]),
        np.append(roster.half_widths, np.int32(RADIUS)),
        jnp.broadcast_to(there[:, None], (*shape, len(roster) + 1)),
        opaque,
        roster.reach[:, None],
    )
    damage = roll(roster.dice[:, None], roster.sides[:, None], byte(bits, 2))
    damage = jnp.where(shoots[:, None] & rays, damage, 0)[..., None]
    return jnp.sum(jnp.where(hit, damage, 0), axis=1, dtype=jnp.int32)


def throws(
    roster: Roster, creatures: Creatures, strikes: jax.Array, bitten: jax.Array
) -> jax.Array:
    """bool[N]: who of those that strike throws something; who is near enough has bitten instead.

    Args:
        roster: their kinds.
        creatures: the monsters.
        strikes: bool[N], who strikes now.
        bitten: bool[N], who has bitten.
    """
    acts = jnp.asarray(roster.acts).at[creatures.frame].get(mode="promise_in_bounds")
    return strikes & (acts == Act.THROW) & ~bitten
