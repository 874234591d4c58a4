"""Monsters that come without end, of each kind by its own chance, wherever there is room."""

from __future__ import annotations

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

from ..draws import draw_index
from .bodies import overlap
from .creatures import Creatures, joined, placed
from .fixed import ONE
from .geometry import RADIUS
from .kinds import Roster

TRIES = 6
"""Places that are looked at before a monster stays away after all."""
# The game draws its chances from so many numbers.
_CHANCES = ONE + 1


def words(roster: Roster) -> tuple[int, int]:
    """The shape of the random bits that `come` needs."""
    return len(roster.kinds), 2 + 2 * TRIES


def come(
    roster: Roster,
    old: Creatures,
    player: jax.Array,
    chances: jax.Array | Sequence[float],
    square: tuple[int, int],
    health: jax.Array,
    bits: jax.Array,
) -> tuple[Creatures, jax.Array]:
    """The monsters with those who come, at most one of each of K kinds.

    A new one takes the place of one that is not there; while all of its kind are, none comes.

    Args:
        roster: their kinds.
        old: the monsters.
        player: int32[2], where the player is.
        chances: of each kind, in 65536ths.
        square: the least and the greatest x and y of those who come, in map units.
        health: int32[N], of new ones.
        bits: uint32[K, W], random, of the shape `words`.

    Returns:
        The monsters, and bool[N] who has come.
    """
    kinds, low, high = len(roster.kinds), *square
    wants = draw_index(bits[:, 0], _CHANCES).astype(jnp.float32) < jnp.asarray(chances)
    drawn = draw_index(bits[:, 2:], (high - low) * ONE + 1) + low * ONE
    place, room = _roomy(roster, old, player, drawn.reshape(kinds, TRIES, 2))
    free = ~old.present[None] & (roster.cast[None] == np.arange(kinds)[:, None])
    index = np.arange(len(roster), dtype=np.int32)
    here = index[None] == jnp.argmax(free, axis=1)[:, None]
    here = here & (wants & room)[:, None] & free
    comes = jnp.any(here, axis=0)
    facing = (bits[:, 1] >> 24) << 24
    present = old.present | comes
    new = placed(roster, place[roster.cast], facing[roster.cast], present, health)
    # They tick once in the tic in which they appear.
    return joined(old, new.replace(tics=new.tics - 1), comes), comes


def _roomy(
    roster: Roster, old: Creatures, player: jax.Array, places: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """Of places int32[K, T, 2] for each kind the first with room, and bool[K] whether one has."""
    widths = np.array([kind.half_width for kind in roster.kinds], np.int32)
    bodies = jnp.concatenate([old.position, player[None]])
    sizes = np.append(roster.half_widths, np.int32(RADIUS))
    met = overlap(places[:, :, None], widths[:, None, None], bodies[None, None], sizes[None, None])
    free = ~jnp.any(met & jnp.append(old.living, True)[None, None], axis=-1)
    first = jnp.argmax(free, axis=1)
    place = jnp.take_along_axis(places, first[:, None, None], axis=1)[:, 0]
    # Of two that come at once to the same place the later one stays away.
    beside = overlap(place[:, None], widths[:, None], place[None], widths[None])
    later = jnp.any(beside & np.tri(len(widths), k=-1, dtype=bool), axis=1)
    return place, jnp.any(free, axis=1) & ~later
