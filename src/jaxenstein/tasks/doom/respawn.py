"""How monsters appear: those present from the first tic, and those that come later."""

from __future__ import annotations

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

from ..draws import random_bits, sample_index
from .collision import RADIUS, crosses, overlap
from .fixed import ONE
from .monster_ai import set_off, settled, turned
from .monsters import Horde, Monsters

TRIES = 6
"""How many random positions are tried before a monster does not appear."""
# A monster's first look is in one of this many tics.
_FIRST_LOOKS = 10
# The range of the game's random numbers for chances.
_CHANCES = ONE + 1


def woken(
    horde: Horde, monsters: Monsters, player: jax.Array, key: jax.Array, first_tic: int
) -> Monsters:
    """The monsters at the first observation: they have seen the player and taken a step.

    This is `monster_ai.act` for monsters that all wake up.

    Args:
        horde: the tables of the monsters; they look in that tic, or earlier if their standing
            frame is shorter.
        monsters: standing monsters that see the player, but are not near it.
        player: int32[2], the position of the player.
        key: random.
        first_tic: the tic of the game with the first observation, before which nobody moves.
    """
    bits = random_bits(key, (len(horde), 2))
    position, direction, steps_left = set_off(horde, monsters, player, bits[:, 0])
    if horde.pictured:
        every = jnp.ones(len(horde), bool)
        monsters = monsters.replace(
            facing=turned(monsters, every, ~every, player[None] - monsters.position)
        )
    since = first_tic - horde.frame_tics[horde.stand]
    return monsters.replace(
        position=position,
        frame=jnp.asarray(horde.walk),
        tics=jnp.asarray(horde.frame_tics[horde.walk] - since),
        direction=direction,
        steps_left=steps_left,
        reaction=monsters.reaction - 1,
    )


def asleep(
    horde: Horde, places: np.ndarray, facing: jax.Array, health: jax.Array, bits: jax.Array
) -> Monsters:
    """Monsters at int32[N, 2], each of which looks for the player within its first ten tics.

    Args:
        horde: the tables of the monsters.
        places: map units in 16.16.
        facing: uint32[N], their headings.
        health: int32[N].
        bits: uint32[N], random.
    """
    everybody = jnp.ones(len(horde), bool)
    monsters = horde.placed(jnp.asarray(places), facing, everybody, health)
    return monsters.replace(tics=1 + sample_index(bits, _FIRST_LOOKS))


def arrived(
    horde: Horde,
    old: Monsters,
    comes: jax.Array,
    fresh: tuple[jax.Array, jax.Array, jax.Array],
) -> Monsters:
    """The old monsters, with new ones at the indices of those that appear.

    Args:
        horde: the tables of the monsters.
        old: the monsters before.
        comes: bool[N], which ones appear.
        fresh: int32[N, 2] positions, uint32[N] headings and int32[N] health of new ones.
    """
    place, facing, health = fresh
    new = horde.placed(place, facing, old.present | comes, health)
    # They already act in the tic in which they appear.
    new = new.replace(tics=new.tics - 1)

    def chosen(fresh: jax.Array, kept: jax.Array) -> jax.Array:
        return jnp.where(comes.reshape((-1,) + (1,) * (kept.ndim - 1)), fresh, kept)

    # No monster goes on fighting the new one that takes the index of its dead enemy.
    return jax.tree.map(chosen, new, settled(old))


def replaced(
    horde: Horde,
    old: Monsters,
    killed: jax.Array,
    absence: jax.Array,
    fresh: tuple[jax.Array, jax.Array, jax.Array],
) -> tuple[Monsters, jax.Array]:
    """The monsters without the dead, and with those that are due and find room.

    Args:
        horde: the tables of the monsters, and the walls.
        old: the monsters before.
        killed: bool[N], which have died in this tic.
        absence: int32[N], tics until each is replaced.
        fresh: as in `arrived`.

    Returns:
        The monsters, and bool[N], which have appeared.
    """
    place, width = fresh[0], horde.half_width
    present = old.present & ~killed
    meets = overlap(place[:, None], width[:, None], old.position[None], width[None])
    later = overlap(place[:, None], width[:, None], place[None], width[None])
    due = ~present & (absence == 0)
    room = ~jnp.any(meets & present[None], axis=1) & ~crosses(place, width, horde.walls)
    room = room & ~jnp.any(later & due[None] & np.tri(len(horde), k=-1, dtype=bool), axis=1)
    comes = due & room
    return arrived(horde, old.replace(present=present), comes, fresh), comes


def absent(absence: jax.Array, killed: jax.Array, period: jax.Array | float) -> jax.Array:
    """int32[N]: tics until the next monster, a tic later; `period` if one was just killed."""
    return jnp.where(killed, jnp.asarray(period, jnp.int32), jnp.maximum(absence - 1, 0))


def words(horde: Horde) -> tuple[int, int]:
    """The shape of the random bits that `invaded` needs."""
    return len(horde.kinds), 2 + 2 * TRIES


def invaded(
    horde: Horde,
    old: Monsters,
    player: jax.Array,
    chances: jax.Array | Sequence[float],
    square: tuple[int, int],
    health: jax.Array,
    bits: jax.Array,
) -> tuple[Monsters, jax.Array]:
    """The monsters with new ones wherever there is room, at most one of each of K kinds.

    A new one takes the index of one that is not present; if all of its kind are, none appears.

    Args:
        horde: the tables of the monsters.
        old: the monsters before.
        player: int32[2], the position of the player.
        chances: the chance of each kind, in 65536ths.
        square: the bounds of x and y of new ones, in map units.
        health: int32[N], of new ones.
        bits: uint32[K, W], random, of the shape `words`.

    Returns:
        The monsters, and bool[N], which have appeared.
    """
    kinds, low, high = len(horde.kinds), *square
    wants = sample_index(bits[:, 0], _CHANCES).astype(jnp.float32) < jnp.asarray(chances)
    places = sample_index(bits[:, 2:], (high - low) * ONE + 1) + low * ONE
    place, room = _roomy(horde, old, player, places.reshape(kinds, TRIES, 2))
    free = ~old.present[None] & (horde.kind_of[None] == np.arange(kinds)[:, None])
    index = np.arange(len(horde), dtype=np.int32)
    here = index[None] == jnp.argmax(free, axis=1)[:, None]
    here = here & (wants & room)[:, None] & free
    comes = jnp.any(here, axis=0)
    facing = (bits[:, 1] >> 24) << 24
    fresh = place[horde.kind_of], facing[horde.kind_of], health
    return arrived(horde, old, comes, fresh), comes


def _roomy(
    horde: Horde, old: Monsters, player: jax.Array, places: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """For each kind the first of int32[K, T, 2] with room; bool[K], whether one has room."""
    widths = np.array([kind.half_width for kind in horde.kinds], np.int32)
    bodies = jnp.concatenate([old.position, player[None]])
    sizes = np.append(horde.half_width, np.int32(RADIUS))
    met = overlap(places[:, :, None], widths[:, None, None], bodies[None, None], sizes[None, None])
    free = ~jnp.any(met & jnp.append(old.living, True)[None, None], axis=-1)
    first = jnp.argmax(free, axis=1)
    place = jnp.take_along_axis(places, first[:, None, None], axis=1)[:, 0]
    # If two appear at once at the same position, the later one does not appear.
    beside = overlap(place[:, None], widths[:, None], place[None], widths[None])
    later = jnp.any(beside & np.tri(len(widths), k=-1, dtype=bool), axis=1)
    return place, jnp.any(free, axis=1) & ~later
