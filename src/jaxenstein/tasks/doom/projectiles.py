"""Projectiles: things that fly straight on until they meet a body or a wall."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from ...pytree import PyTreeNode
from .bodies import crosses, overlap
from .fixed import ONE
from .shots import offsets, ranked

# A projectile looks around so often on its way of a tic.
_PARTS = 3


class Projectiles(PyTreeNode):
    """The projectiles of a state; M is how many there can be, and a new one takes the oldest place.

    Attributes:
        position: int32[M, 2], map units in 16.16.
        velocity: int32[M, 2], units a tic.
        flies: bool[M], whether it is on its way.
        bursts: int32[M], tics for which its end is still seen.
        owner: int32[M], the monster that it passes by.
        next: int32[], the place of the next one.
    """

    position: jax.Array
    velocity: jax.Array
    flies: jax.Array
    bursts: jax.Array
    owner: jax.Array
    next: jax.Array


def no_projectiles(count: int) -> Projectiles:
    """None, and room for so many."""
    pairs = jnp.zeros((count, 2), jnp.int32)
    nothing = jnp.zeros(count, jnp.int32)
    return Projectiles(pairs, pairs, jnp.zeros(count, bool), nothing, nothing, jnp.int32(0))


def throw(
    projectiles: Projectiles, throws: jax.Array, origin: jax.Array, target: jax.Array, speed: int
) -> Projectiles:
    """New ones, from each place that throws to a target; half a tic's way ahead already.

    Args:
        projectiles: those so far.
        throws: bool[N].
        origin: int32[N, 2].
        target: int32[2].
        speed: map units a tic.
    """
    count = projectiles.flies.shape[0]
    way = offsets(origin, target[None])
    length = jnp.maximum(jnp.sqrt(jnp.sum(way**2, axis=-1, keepdims=True)), 1)
    velocity = (way / length * jnp.float32(speed * ONE)).astype(jnp.int32)
    order = jnp.cumsum(throws.astype(jnp.int32)) - 1
    slot = jnp.where(throws, (projectiles.next + order) % count, count)
    index = np.arange(throws.shape[0], dtype=np.int32)

    def put(values: jax.Array, new: jax.Array) -> jax.Array:
        return values.at[slot].set(new, mode="drop")

    return Projectiles(
        position=put(projectiles.position, origin + (velocity >> 1)),
        velocity=put(projectiles.velocity, velocity),
        flies=put(projectiles.flies, throws),
        bursts=put(projectiles.bursts, jnp.zeros_like(slot)),
        owner=put(projectiles.owner, jnp.asarray(index)),
        next=(projectiles.next + jnp.sum(throws, dtype=jnp.int32)) % count,
    )


def fly(
    projectiles: Projectiles,
    half_width: int,
    player: tuple[jax.Array, int],
    others: tuple[jax.Array, np.ndarray, jax.Array],
    walls: np.ndarray,
    bursts: int,
) -> tuple[Projectiles, jax.Array]:
    """A tic on: the projectiles, and bool[M] which of them have just hit the player.

    Args:
        projectiles: before it.
        half_width: of each, in map units.
        player: int32[2] where it is, and its half-width.
        others: int32[N, 2] places of monsters, int32[N] half-widths, bool[N] who lives.
        walls: float32[L, 4] of `shots.segments`.
        bursts: tics for which the end of one is seen.
    """
    part = np.arange(1, _PARTS + 1, dtype=np.int32)[None, :, None]
    way = projectiles.position[:, None] + projectiles.velocity[:, None] * part // _PARTS
    own = np.array(half_width, np.int32)
    target, width = player
    at_player = overlap(way, own, ranked(target, 3), np.array(width, np.int32))
    places, widths, living = others
    met = overlap(way[:, :, None], own, ranked(places, 4), ranked(jnp.asarray(widths), 3))
    index = np.arange(len(widths), dtype=np.int32)
    foreign = living[None] & (index[None] != projectiles.owner[:, None])
    at_other = jnp.any(met & foreign[:, None], axis=-1)
    size = jnp.full((1, 1), half_width, jnp.float32)
    ends = at_player | at_other | crosses(way, size, walls)
    first = jnp.argmax(ends, axis=1)
    stops = projectiles.flies & jnp.any(ends, axis=1)
    rows = np.arange(way.shape[0])
    hits = stops & at_player[rows, first] & ~at_other[rows, first]
    place = jnp.where(stops[:, None], way[rows, first], way[:, -1])
    after = projectiles.replace(
        position=jnp.where(projectiles.flies[:, None], place, projectiles.position),
        flies=projectiles.flies & ~stops,
        bursts=jnp.where(stops, bursts, jnp.maximum(projectiles.bursts - 1, 0)),
    )
    return after, hits
