"""Rays: what a bullet meets first, and whether one place can be seen from another.

Places are int32 map units (16.16); what is measured from them is float32 map units. A body is a
box whose sides run along the axes, a wall is a segment, and a ray meets both exactly, without
sampling.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

from .fixed import ONE, direction
from .walls import Line

# A ray with a component below this runs along an axis.
_PARALLEL = 1e-9


def segments(walls: Sequence[Line]) -> np.ndarray:
    """float32[L, 4]: walls as x0, y0, x1, y1 in map units."""
    ends = [(wall.x0, wall.y0, wall.x1, wall.y1) for wall in walls]
    return np.array(ends, np.float32).reshape(-1, 4)


def along(angle: jax.Array) -> jax.Array:
    """float32[..., 2]: the unit vector of an angle (uint32), from Doom's table."""
    return jnp.stack(direction(angle), axis=-1).astype(jnp.float32) * jnp.float32(1 / ONE)


def bearing(offset: jax.Array) -> jax.Array:
    """int32[...]: the angle of int32[..., 2], 2**32 a circle, about as exact as float32."""
    x, y = offset[..., 0].astype(jnp.float32), offset[..., 1].astype(jnp.float32)
    return (jnp.arctan2(y, x) * jnp.float32(2**22 / math.pi)).astype(jnp.int32) << 9


def offsets(origin: jax.Array, places: jax.Array) -> jax.Array:
    """float32[..., 2]: from int32[..., 2] to int32[..., 2], in map units."""
    rank = max(origin.ndim, places.ndim)
    way = ranked(places, rank) - ranked(origin, rank)
    return way.astype(jnp.float32) * jnp.float32(1 / ONE)


def way_to(origin: jax.Array, places: jax.Array) -> jax.Array:
    """float32[..., 2]: the direction from int32[..., 2] to int32[..., 2], of length one."""
    way = offsets(origin, places)
    return way / jnp.maximum(jnp.sqrt(jnp.sum(way**2, axis=-1, keepdims=True)), 1)


def to_boxes(offset: jax.Array, ray: jax.Array, half_width: jax.Array | np.ndarray) -> jax.Array:
    """float32[...]: how far along a ray a box is, `inf` if the ray misses it.

    A ray that only touches a side hits, as in the game.

    Args:
        offset: float32[..., 2], from the ray's origin to the box's centre.
        ray: float32[..., 2], its direction.
        half_width: float32[...], of the box.
    """
    parallel = jnp.abs(ray) < _PARALLEL
    safe = jnp.where(parallel, jnp.float32(1), ray)
    sides = ranked(jnp.asarray(half_width, jnp.float32)[..., None], offset.ndim)
    one, other = (offset - sides) / safe, (offset + sides) / safe
    beside = jnp.where(jnp.abs(offset) <= sides, -jnp.inf, jnp.inf)
    enters = jnp.max(jnp.where(parallel, beside, jnp.minimum(one, other)), axis=-1)
    leaves = jnp.min(jnp.where(parallel, jnp.inf, jnp.maximum(one, other)), axis=-1)
    return jnp.where((enters <= leaves) & (leaves >= 0), jnp.maximum(enters, 0), jnp.inf)


def to_walls(origin: jax.Array, ray: jax.Array, walls: np.ndarray) -> jax.Array:
    """float32[...]: how far along rays the first wall is, `inf` if there is none.

    Args:
        origin: int32[..., 2].
        ray: float32[..., 2].
        walls: float32[L, 4] of `segments`.
    """
    if not len(walls):
        return jnp.full(ray.shape[:-1], jnp.inf, jnp.float32)
    first, way = walls[:, :2], walls[:, 2:] - walls[:, :2]
    rank = ray.ndim + 1
    first, way = ranked(jnp.asarray(first), rank), ranked(jnp.asarray(way), rank)
    gap = first - offsets(jnp.zeros_like(origin), origin)[..., None, :]
    turn = _cross(ray[..., None, :], way)
    safe = jnp.where(turn == 0, jnp.float32(1), turn)
    distance = _cross(gap, way) / safe
    part = _cross(gap, ray[..., None, :]) / safe
    met = (turn != 0) & (distance >= 0) & (part >= 0) & (part <= 1)
    return jnp.min(jnp.where(met, distance, jnp.inf), axis=-1)


def is_seen(origin: jax.Array, target: jax.Array, walls: np.ndarray) -> jax.Array:
    """bool[...]: whether no wall stands between places int32[..., 2]."""
    return to_walls(origin, offsets(origin, target), walls) > 1


def first_body(
    origin: jax.Array,
    ray: jax.Array,
    places: jax.Array,
    half_widths: np.ndarray,
    there: jax.Array,
    walls: np.ndarray,
    reach: float | np.ndarray = np.inf,
) -> jax.Array:
    """bool[..., N]: the body that each ray hits first; all false if it hits none, or a wall first.

    Args:
        origin: int32[..., 2].
        ray: float32[..., 2], of length one.
        places: int32[N, 2], of the bodies.
        half_widths: float32[N].
        there: bool[..., N], which of them can be hit.
        walls: float32[L, 4] that stop rays.
        reach: how far the rays go.
    """
    offset = offsets(origin[..., None, :], places)
    distance = to_boxes(offset, ray[..., None, :], half_widths)
    limit = to_walls(origin, ray, walls)
    limit = jnp.minimum(limit, ranked(jnp.asarray(reach, jnp.float32), limit.ndim))
    there = ranked(there, distance.ndim)
    distance = jnp.where(there & (distance <= limit[..., None]), distance, jnp.inf)
    nearest = jnp.argmin(distance, axis=-1)
    index = ranked(jnp.arange(places.shape[0]), distance.ndim)
    return (index == nearest[..., None]) & (distance < jnp.inf)


def ranked(values: jax.Array, rank: int) -> jax.Array:
    """The values with so many axes, the new ones in front."""
    return values.reshape((1,) * (rank - values.ndim) + values.shape)


def _cross(a: jax.Array, b: jax.Array) -> jax.Array:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
