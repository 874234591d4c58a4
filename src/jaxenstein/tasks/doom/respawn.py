"""Monsters that come in the places of those who died."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from .bodies import crosses, overlap
from .creatures import Creatures, joined, placed
from .kinds import Roster


def respawned(
    roster: Roster,
    old: Creatures,
    killed: jax.Array,
    absence: jax.Array,
    fresh: tuple[jax.Array, jax.Array, jax.Array],
    walls: np.ndarray,
) -> tuple[Creatures, jax.Array]:
    """The monsters without the dead, and with those whose time has come and who find room.

    Args:
        roster: their kinds.
        old: the monsters.
        killed: bool[N], who has died in this tic.
        absence: int32[N], tics until there is another one in the place of each.
        fresh: int32[N, 2] places of those who come, uint32[N] where they look, int32[N] health.
        walls: float32[L, 4], walls that block monsters.

    Returns:
        The monsters, and bool[N] who has come.
    """
    place, facing, health = fresh
    present = old.present & ~killed
    width = roster.half_widths
    meets = overlap(place[:, None], width[:, None], old.position[None], width[None])
    later = overlap(place[:, None], width[:, None], place[None], width[None])
    due = ~present & (absence == 0)
    room = ~jnp.any(meets & present[None], axis=1) & ~crosses(place, width, walls)
    room = room & ~jnp.any(later & due[None] & np.tri(len(roster), k=-1, dtype=bool), axis=1)
    comes = due & room
    new = placed(roster, place, facing, present | comes, health)
    # They tick once in the tic in which they appear.
    new = new.replace(tics=new.tics - 1)
    return joined(old.replace(present=present), new, comes), comes


def absent(absence: jax.Array, killed: jax.Array, period: jax.Array | float) -> jax.Array:
    """int32[N]: tics until the next one, a tic later; `period` for who has just been killed."""
    return jnp.where(killed, jnp.asarray(period, jnp.int32), jnp.maximum(absence - 1, 0))
