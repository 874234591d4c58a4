"""Bodies: boxes with sides along the axes, which block each other and do not cross walls."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from ..._jax.batching import varying
from .fixed import ONE
from .shots import ranked


def overlap(
    place: jax.Array,
    half_width: jax.Array | np.ndarray,
    others: jax.Array,
    half_widths: jax.Array | np.ndarray,
) -> jax.Array:
    """bool[...]: whether boxes overlap; those that touch do not.

    Args:
        place: int32[..., 2], the centre of one, map units in 16.16.
        half_width: int32[...], of it, in map units.
        others: int32[..., 2], the centre of the other.
        half_widths: int32[...], of it.
    """
    gap = place - others
    reach = ranked(jnp.asarray(half_width + half_widths) * ONE, gap.ndim - 1)
    return jnp.all(jnp.abs(gap) < reach[..., None], axis=-1)


def crosses(place: jax.Array, half_width: jax.Array | np.ndarray, walls: np.ndarray) -> jax.Array:
    """bool[...]: whether a box crosses a wall; touching one is free.

    Args:
        place: int32[..., 2], its centre.
        half_width: float32[...], in map units.
        walls: float32[L, 4] of `shots.segments`.
    """
    if not len(walls):
        return jnp.zeros(place.shape[:-1], bool)
    # In one row, which vectorises where the last axis is short.
    shape = place.shape[:-1]
    x, y = (place[..., i].reshape(-1).astype(jnp.float32) * jnp.float32(1 / ONE) for i in (0, 1))
    side = ranked(jnp.asarray(half_width, jnp.float32), len(shape))
    side = jnp.broadcast_to(side, shape).reshape(-1)
    table = jnp.asarray(walls)

    # One wall after the other: a reduction along a short axis takes several times as long.
    def visit(i: jax.Array, found: jax.Array) -> jax.Array:
        x0, y0, x1, y1 = table[i]
        near_x = (x + side > jnp.minimum(x0, x1)) & (x - side < jnp.maximum(x0, x1))
        near_y = (y + side > jnp.minimum(y0, y1)) & (y - side < jnp.maximum(y0, y1))
        way_x, way_y = x1 - x0, y1 - y0
        beside = jnp.abs((x - x0) * way_y - (y - y0) * way_x)
        return found | (near_x & near_y & (beside < side * (jnp.abs(way_x) + jnp.abs(way_y))))

    none = varying(jnp.zeros(x.shape, bool), place, side)
    return jax.lax.fori_loop(0, len(walls), visit, none).reshape(shape)
