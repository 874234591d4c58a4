"""The effects of monsters' attacks: bites, and bullets that may hit another monster instead."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..._jax.batching import where_few
from .collision import RADIUS, along, bearing, first_body
from .fixed import FEW, byte, roll, spread
from .monster_ai import in_reach, sight
from .monster_kinds import Act
from .monsters import Horde, Monsters

# Shots with at most this reach, in map units, are blows, for which the enemy must be close.
_BLOW = 100


class Blows(NamedTuple):
    """The effects of attacks.

    Attributes:
        lost: int32[N], health that the player loses to each monster.
        dealt: int32[N], health that each monster loses.
        source: int32[N], the monster that hurt it.
        bitten: bool[N], which monsters have bitten.
    """

    lost: jax.Array
    dealt: jax.Array
    source: jax.Array
    bitten: jax.Array


def attack(
    horde: Horde, monsters: Monsters, attacks: jax.Array, player: jax.Array, bits: jax.Array
) -> Blows:
    """The effects of the monsters that attack.

    Args:
        horde: the tables of the monsters, and the walls that stop bullets.
        monsters: the monsters.
        attacks: bool[N], which attack now, by the action of their frame.
        player: int32[2], the position of the player.
        bits: uint32[N, R], random; R is the most rays of a shot, and at least 1.
    """
    # In a tic, monsters only attack in few members of a batch.
    blows = where_few(partial(_blows, horde), FEW)
    return blows(jnp.any(attacks), monsters, attacks, player, bits)


def _blows(
    horde: Horde, monsters: Monsters, attacks: jax.Array, player: jax.Array, bits: jax.Array
) -> Blows:
    goal, width = horde.enemies(monsters, player)
    near = in_reach(goal - monsters.position, width, sight(monsters, goal, horde.opaque))
    acts = horde.at(horde.acts, monsters.frame)
    bites = attacks & near & ((acts == Act.BITE) | (acts == Act.THROW))
    bite = jnp.where(bites, roll(horde.dice, horde.sides, byte(bits[:, 0], 2)), 0)
    if monsters.infighting is None and not horde.rays.any():
        nothing = jnp.zeros_like(bite)
        return Blows(bite, nothing, nothing, bites)
    dealt = _bitten(monsters, bite)
    if horde.rays.any():
        shoots = attacks & (acts == Act.SHOOT)
        dealt = dealt + _shot(horde, monsters, shoots, near, (player, goal), bits)
    source = jnp.argmax(dealt[:, :-1], axis=0).astype(jnp.int32)
    return Blows(dealt[:, -1], jnp.sum(dealt[:, :-1], axis=0, dtype=jnp.int32), source, bites)


def _bitten(monsters: Monsters, bite: jax.Array) -> jax.Array:
    """int32[N, N + 1]: the damage of bites int32[N] to each monster, and to the player."""
    count = bite.shape[0]
    if monsters.infighting is None:
        return jnp.pad(bite[:, None], ((0, 0), (count, 0)))
    index = np.arange(count + 1, dtype=np.int32)[None]
    return jnp.where(monsters.infighting.target[:, None] == index, bite[:, None], 0)


def _shot(
    horde: Horde,
    monsters: Monsters,
    shoots: jax.Array,
    near: jax.Array,
    places: tuple[jax.Array, jax.Array],
    bits: jax.Array,
) -> jax.Array:
    """int32[N, N + 1]: the damage of bullets to each monster, and to the player.

    Args:
        horde: the tables of the monsters.
        monsters: the monsters.
        shoots: bool[N], which of them shoot.
        near: bool[N], whose enemy is in reach of a blow.
        places: int32[2], the player; int32[N, 2], the enemies.
        bits: uint32[N, R], random.
    """
    player, goal = places
    count = int(horde.rays.max())
    shoots = shoots & (near | (horde.reach > _BLOW))
    rays = np.arange(count)[None] < horde.rays[:, None]
    shape = (len(horde), count)
    aim = bearing(goal - monsters.position).astype(jnp.uint32)
    angle = aim[:, None] + spread(bits, horde.spread[:, None])
    others = ~np.eye(len(horde), len(horde) + 1, dtype=bool)
    there = jnp.append(monsters.living, True)[None] & others
    hit = first_body(
        jnp.broadcast_to(monsters.position[:, None], (*shape, 2)),
        along(angle),
        jnp.concatenate([monsters.position, player[None]]),
        np.append(horde.half_width, np.int32(RADIUS)),
        jnp.broadcast_to(there[:, None], (*shape, len(horde) + 1)),
        horde.opaque,
        horde.reach[:, None],
    )
    damage = roll(horde.dice[:, None], horde.sides[:, None], byte(bits, 2))
    damage = jnp.where(shoots[:, None] & rays, damage, 0)[..., None]
    return jnp.sum(jnp.where(hit, damage, 0), axis=1, dtype=jnp.int32)


def throws(horde: Horde, monsters: Monsters, attacks: jax.Array, bitten: jax.Array) -> jax.Array:
    """bool[N]: which monsters throw a fireball; one that has bitten or flinched does not.

    Args:
        horde: the tables of the monsters.
        monsters: the monsters after the blows of this tic.
        attacks: bool[N], which attack now.
        bitten: bool[N], which of them have bitten.
    """
    return attacks & (horde.at(horde.acts, monsters.frame) == Act.THROW) & ~bitten
