"""What the strikes of monsters do: bites, and bullets that may hit another monster instead."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from .creatures import Creatures, in_reach, sight
from .dice import byte, roll, spread
from .geometry import RADIUS
from .kinds import Act, Roster
from .shots import along, bearing, first_body

# Shots that reach no farther are blows, for which the player must be near.
_BLOW = 100


def strike(
    roster: Roster,
    creatures: Creatures,
    strikes: jax.Array,
    player: jax.Array,
    bits: jax.Array,
    opaque: np.ndarray,
) -> tuple[jax.Array, jax.Array]:
    """What the player loses by each monster, and what each monster loses: int32[N] twice.

    Args:
        roster: their kinds.
        creatures: the monsters.
        strikes: bool[N], who strikes now, as the act of its frame says.
        player: int32[2], where the player is.
        bits: uint32[N, R], random; R is the most rays of a shot, and at least 1.
        opaque: float32[L, 4], walls that stop bullets.
    """
    near = in_reach(creatures, player, sight(creatures, player, opaque))
    acts = jnp.asarray(roster.acts).at[creatures.frame].get(mode="promise_in_bounds")
    bites = strikes & near & ((acts == Act.BITE) | (acts == Act.THROW))
    bite = jnp.where(bites, roll(roster.dice, roster.sides, byte(bits[:, 0], 2)), 0)
    count = int(roster.rays.max())
    if count == 0:
        return bite, jnp.zeros_like(bite)
    shoots = strikes & (acts == Act.SHOOT) & (near | (roster.reach > _BLOW))
    rays = np.arange(count)[None] < roster.rays[:, None]
    shape = (len(roster), count)
    aim = bearing(player[None] - creatures.position).astype(jnp.uint32)
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
    dealt = jnp.sum(jnp.where(hit, damage, 0), axis=1, dtype=jnp.int32)
    return bite + dealt[:, -1], jnp.sum(dealt[:, :-1], axis=0, dtype=jnp.int32)


def throws(roster: Roster, creatures: Creatures, strikes: jax.Array, lost: jax.Array) -> jax.Array:
    """bool[N]: who of those that strike throws something; who is near enough has bitten instead.

    Args:
        roster: their kinds.
        creatures: the monsters.
        strikes: bool[N], who strikes now.
        lost: int32[N], what each strike has hurt the player already.
    """
    acts = jnp.asarray(roster.acts).at[creatures.frame].get(mode="promise_in_bounds")
    return strikes & (acts == Act.THROW) & (lost == 0)
