"""Bodies: boxes with sides along the axes, which block each other and do not cross walls."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

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
    centre = place.astype(jnp.float32)[..., None, :] * jnp.float32(1 / ONE)
    rank = place.ndim + 1
    sides = ranked(jnp.asarray(half_width, jnp.float32)[..., None, None], rank)
    ends = walls.reshape((1,) * (rank - 2) + (-1, 2, 2))
    low, high = ends.min(axis=-2), ends.max(axis=-2)
    near = (centre + sides > low) & (centre - sides < high)
    way, gap = ends[..., 1, :] - ends[..., 0, :], centre - ends[..., 0, :]
    beside = jnp.abs(gap[..., 0] * way[..., 1] - gap[..., 1] * way[..., 0])
    reach = sides[..., 0] * np.abs(way).sum(axis=-1)
    return jnp.any(jnp.all(near, axis=-1) & (beside < reach), axis=-1)
