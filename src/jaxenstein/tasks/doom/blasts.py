"""Rockets among monsters: what they hit, and the blast that hurts everybody around."""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from ..._jax.batching import where_few
from .creatures import FEW, Creatures
from .geometry import RADIUS
from .kinds import Roster
from .projectiles import Projectiles, fly, throw
from .shots import along, is_seen, offsets
from .weapons import Weapon

# Half-width of a rocket, and how many there can be; tics for which its end is seen; how often it
# looks around in a tic; the blast's damage, and how far it reaches in map units.
HALF_WIDTH, MOST, BURST, LOOKS, BLAST = 11, 3, 18, 3, 128


def launched(
    rockets: Projectiles, weapon: Weapon, fires: jax.Array, origin: jax.Array, angle: jax.Array
) -> Projectiles:
    """The rockets with one more from int32[2] along an angle uint32[], if bool[] it is fired."""
    return throw(rockets, fires[None], origin[None], along(angle)[None], weapon.speed)


def exploded(
    before: Projectiles,
    roster: Roster,
    creatures: Creatures,
    player: jax.Array,
    direct: jax.Array,
    walls: np.ndarray,
) -> tuple[Projectiles, jax.Array, jax.Array]:
    """A tic of the player's rockets.

    A rocket that ends, at a wall or at a monster, hurts by its hit and then all who are nearer than
    128 map units and not behind a wall: by that less the distance to their side.

    Args:
        before: the rockets.
        roster: the kinds of the monsters.
        creatures: the monsters.
        player: int32[2], where the player is, who is hurt as well.
        direct: int32[M], what a hit of each rocket does.
        walls: float32[L, 4].

    Returns:
        The rockets; int32[M] what each does to the player; int32[N] what all do to each monster.
    """
    places = jnp.concatenate([player[None], creatures.position])
    widths = np.append(np.int32(RADIUS), roster.half_widths)
    there = jnp.append(jnp.zeros(1, bool), creatures.living)
    rockets, hits = fly(before, HALF_WIDTH, (places, widths, there), walls, BURST, LOOKS)
    ends = before.flies & ~rockets.flies
    # A look earlier, a rocket was before the wall at which it ends. Few of a batch end in a tic.
    sources = rockets.position, rockets.position - before.velocity // LOOKS
    blasts = where_few(partial(_blasts, widths, walls), FEW)
    damage = jnp.where(hits, direct[:, None], 0) + blasts(jnp.any(ends), *sources, places)
    damage = jnp.where(ends[:, None], damage, 0)
    return rockets, damage[:, 0], jnp.sum(damage[:, 1:], axis=0, dtype=jnp.int32)


def _blasts(
    widths: np.ndarray, walls: np.ndarray, centres: jax.Array, eyes: jax.Array, places: jax.Array
) -> jax.Array:
    """int32[M, N]: what explosions at int32[M, 2] do to bodies at int32[N, 2] of int32[N] widths.

    They do nothing behind walls float32[L, 4], seen from int32[M, 2].
    """
    gap = jnp.max(jnp.abs(offsets(centres[:, None], places[None])), axis=-1)
    side = jnp.maximum(gap - widths[None].astype(np.float32), 0)
    shape = (eyes.shape[0], places.shape[0], 2)
    ways = jnp.broadcast_to(eyes[:, None], shape), jnp.broadcast_to(places[None], shape)
    return jnp.where(is_seen(*ways, walls), jnp.maximum(BLAST - side.astype(jnp.int32), 0), 0)
