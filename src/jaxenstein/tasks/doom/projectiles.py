"""Projectiles: things that fly straight on until they meet a body or a wall."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from ...pytree import PyTreeNode
from .bodies import crosses, overlap
from .fixed import ONE
from .shots import ranked


class Projectiles(PyTreeNode):
    """The projectiles of a state; M is how many there can be, and a new one takes the oldest place.

    Attributes:
        position: int32[M, 2], map units in 16.16.
        velocity: int32[M, 2], units a tic.
        flies: bool[M], whether it is on its way.
        bursts: int32[M], tics for which its end is still seen.
        owner: int32[M], the body that it passes by.
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
    projectiles: Projectiles,
    throws: jax.Array,
    origin: jax.Array,
    way: jax.Array,
    speed: int | np.ndarray,
) -> Projectiles:
    """New ones, from each place that throws; half a tic's way ahead already.

    Args:
        projectiles: those so far.
        throws: bool[N].
        origin: int32[N, 2], of the bodies that throw, the first N of `fly`.
        way: float32[N, 2], the direction, of length one.
        speed: map units a tic, of all or int32[N].
    """
    count = projectiles.flies.shape[0]
    fixed = np.asarray(speed, np.float32).reshape(-1, 1) * np.float32(ONE)
    velocity = (way * fixed).astype(jnp.int32)
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
    bodies: tuple[jax.Array, np.ndarray, jax.Array],
    walls: np.ndarray,
    bursts: int,
    looks: int = 3,
) -> tuple[Projectiles, jax.Array]:
    """A tic on: the projectiles, and bool[M, N] the body that each has just hit.

    Args:
        projectiles: before it.
        half_width: of each, in map units.
        bodies: int32[N, 2] places, int32[N] half-widths, bool[N] who is there. Of two that are met
            at once the first is hit.
        walls: float32[L, 4] of `shots.segments`.
        bursts: tics for which the end of one is seen.
        looks: how often each looks around on its way of a tic.
    """
    part = np.arange(1, looks + 1, dtype=np.int32)[None, :, None]
    way = projectiles.position[:, None] + projectiles.velocity[:, None] * part // looks
    own = np.array(half_width, np.int32)
    places, widths, there = bodies
    met = overlap(way[:, :, None], own, ranked(places, 4), ranked(jnp.asarray(widths), 3))
    index = np.arange(len(widths), dtype=np.int32)[None]
    foreign = there[None] & (index != projectiles.owner[:, None])
    met = met & foreign[:, None]
    size = jnp.full((1, 1), half_width, jnp.float32)
    ends = jnp.any(met, axis=-1) | crosses(way, size, walls)
    first = jnp.argmax(ends, axis=1)
    stops = projectiles.flies & jnp.any(ends, axis=1)
    rows = np.arange(way.shape[0])
    found = met[rows, first]
    hits = found & (jnp.argmax(found, axis=1)[:, None] == index) & stops[:, None]
    place = jnp.where(stops[:, None], way[rows, first], way[:, -1])
    after = projectiles.replace(
        position=jnp.where(projectiles.flies[:, None], place, projectiles.position),
        flies=projectiles.flies & ~stops,
        bursts=jnp.where(stops, bursts, jnp.maximum(projectiles.bursts - 1, 0)),
    )
    return after, hits
