"""Monsters that turn on each other: who was hurt by another goes for it, until one of them is dead.

The rules are the game's (ZDoom's p_interaction.cpp and p_enemy.cpp, read for them): every blow that
does not kill makes a monster go for who dealt it, if it has not been after somebody for that
reason for less than a hundred of its steps. Kinds do not matter, but that fireballs do nothing to
the thrower's own kind. When the enemy is dead, the monster goes for the player again.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import jax
import jax.numpy as jnp
import numpy as np

from ...pytree import PyTreeNode
from .geometry import RADIUS
from .kinds import Roster

if TYPE_CHECKING:
    from .creatures import Creatures

STUBBORN = 100
"""Steps for which a monster keeps to whom it has turned."""


class Feud(PyTreeNode):
    """Whom N monsters are after.

    Attributes:
        target: int32[N], the number of another monster; N for the player.
        anger: int32[N], steps for which it keeps to that one.
    """

    target: jax.Array
    anger: jax.Array


def peace(count: int) -> Feud:
    """So many monsters, who are all after the player."""
    return Feud(jnp.full(count, count, jnp.int32), jnp.zeros(count, jnp.int32))


def quarry(
    roster: Roster, creatures: Creatures, player: jax.Array
) -> tuple[jax.Array, jax.Array | np.ndarray]:
    """Where each monster's enemy is, int32[N, 2], and its half-width, int32[N] map units.

    Args:
        roster: their kinds.
        creatures: the monsters.
        player: int32[2], where the player is.
    """
    count = len(roster)
    if creatures.feud is None:
        return jnp.broadcast_to(player[None], (count, 2)), np.full(count, RADIUS, np.int32)
    places = jnp.concatenate([creatures.position, player[None]])
    widths = jnp.asarray(np.append(roster.half_widths, np.int32(RADIUS)))
    target = creatures.feud.target
    return places[target], widths[target]


def settled(creatures: Creatures) -> Creatures:
    """The monsters, of which those whose enemy is dead go for the player again."""
    feud = creatures.feud
    if feud is None:
        return creatures
    count = feud.target.shape[0]
    over = ~jnp.append(creatures.living, True)[feud.target]
    target, anger = jnp.where(over, count, feud.target), jnp.where(over, 0, feud.anger)
    return creatures.replace(feud=Feud(target, anger))


def calmer(feud: Feud | None, steps: jax.Array) -> Feud | None:
    """The feud after a tic in which bool[N] have taken a step."""
    if feud is None:
        return None
    return feud.replace(anger=jnp.maximum(feud.anger - steps.astype(jnp.int32), 0))


def provoked(feud: Feud | None, hurt: jax.Array, source: jax.Array | None) -> Feud | None:
    """The feud after blows.

    Args:
        feud: before them.
        hurt: bool[N], who was hurt and lives.
        source: int32[N], by which monster; N for the player, who it is if there is none.
    """
    if feud is None:
        return None
    own = np.arange(feud.target.shape[0], dtype=np.int32)
    by = jnp.full(own.shape, len(own), jnp.int32) if source is None else source
    turns = hurt & (by != own) & ((feud.anger == 0) | (by == feud.target))
    return Feud(jnp.where(turns, by, feud.target), jnp.where(turns, STUBBORN, feud.anger))
