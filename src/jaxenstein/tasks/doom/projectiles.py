"""Projectiles: things that fly straight on until they meet a body or a wall."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from ..._jax.batching import varying
from ...pytree import PyTreeNode
from .bodies import crosses
from .fixed import ONE


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


def in_the_air(projectiles: Projectiles, things: np.ndarray) -> Projectiles:
    """Those of int64[M, 6] of the game's, as `DoomScenario.with_things` takes them."""
    count = len(projectiles.flies)
    # Those that burst stand still; if there are too many, they are left out.
    order = np.argsort(things[:, 5] == 0, kind="stable")[:count]
    place, speed = np.zeros((count, 2), np.int32), np.zeros(count)
    place[: len(order)], speed[: len(order)] = things[order, 1:3], things[order, 5]
    bursts = (np.arange(count) < len(order)) & (speed == 0)
    return projectiles.replace(position=place, flies=speed > 0, bursts=bursts.astype(np.int32))


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
    part = np.arange(1, looks + 1, dtype=np.int32)[:, None]
    way = [at[None] + _quotient(by[None] * part, looks) for at, by in _pairs(projectiles)]
    found = _met(way, half_width, bodies, projectiles.owner)
    size = np.full((1, 1), half_width, np.float32)
    ends = (found < len(bodies[1])) | crosses(jnp.stack(way, axis=-1), size, walls)
    stops = projectiles.flies & jnp.any(ends, axis=0)
    last = found[-1], way[0][-1], way[1][-1]
    for k in reversed(range(looks - 1)):
        values = found[k], way[0][k], way[1][k]
        last = [jnp.where(ends[k], value, later) for value, later in zip(values, last, strict=True)]
    index = np.arange(len(bodies[1]), dtype=np.int32)[None]
    hits = stops[:, None] & (last[0][:, None] == index)
    place = jnp.stack(last[1:], axis=-1)
    after = projectiles.replace(
        position=jnp.where(projectiles.flies[:, None], place, projectiles.position),
        flies=projectiles.flies & ~stops,
        bursts=jnp.where(stops, bursts, jnp.maximum(projectiles.bursts - 1, 0)),
    )
    return after, hits


def _pairs(projectiles: Projectiles) -> list[tuple[jax.Array, jax.Array]]:
    """int32[M] place and velocity along x, and along y."""
    return [(projectiles.position[:, i], projectiles.velocity[:, i]) for i in (0, 1)]


def _quotient(value: jax.Array, divisor: int) -> jax.Array:
    """int32: the quotient rounded down."""
    cut = jax.lax.div(value, np.int32(divisor))
    return cut - (cut * divisor > value).astype(jnp.int32)


def _met(
    way: list[jax.Array],
    half_width: int,
    bodies: tuple[jax.Array, np.ndarray, jax.Array],
    owner: jax.Array,
) -> jax.Array:
    """int32[looks, M]: the first body that is met at each look, or N; arguments as of `fly`."""
    places, widths, there = bodies
    reach = jnp.asarray((widths + half_width) * ONE)
    count = len(widths)

    # One body after the other, as walls in `crosses`.
    def visit(k: jax.Array, found: jax.Array) -> jax.Array:
        i = count - 1 - k
        close = [jnp.abs(way[axis] - places[i, axis]) < reach[i] for axis in (0, 1)]
        return jnp.where(close[0] & close[1] & there[i] & (owner != i)[None], i, found)

    none = varying(jnp.full(way[0].shape, count, jnp.int32), way, bodies, owner)
    return jax.lax.fori_loop(0, count, visit, none)
