"""Rays against walls at any place and angle: every ray against every wall, and the nearest wins.

As the eye sees it, a place is at a depth and so far to the right, at its side. A ray of slope s
(see `raycast`) passes right of it if `s * depth > side`, also if it is behind the eye. A ray meets
a wall whose front is seen if it passes right of the left end and left of the right end. Its
nearness there, one over the depth, is linear in s, so a ray and a wall take three products.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from .._jax.batching import varying
from .._jax.staging import staged
from .camera import Camera
from .hits import Ends, Hits
from .level import FreeWalls
from .textures import entry

# More walls than this are looked at in a loop over blocks of this size, to bound the program.
BLOCK = 32
# Walls reach beyond their ends by this share of the ends' distances: no ray slips through a corner.
OVERLAP = 1e-6
# The least nearness and the least `Ends.area` of a wall that is seen.
FAR, EDGEWISE = 1e-6, 1e-9


def meet(
    position: jax.Array, direction: tuple[jax.Array, jax.Array], walls: FreeWalls, camera: Camera
) -> Hits:
    """Cast the rays of one image.

    Args:
        position: float32[2], (x, y) of the eye in tiles.
        direction: float32[] twice, cosine and sine of the heading.
        walls: the walls.
        camera: width and field of view of the image.
    """
    slopes = camera.column_slopes()
    seen = staged(_seen)(position, *direction, walls)
    number = staged(partial(_nearest, slopes=slopes))(seen)
    ends = staged(_looked_up)(number, position, *direction, walls)
    return Hits(
        depth=1 / jnp.maximum(ends.nearness(slopes), jnp.float32(FAR)),
        wall=entry(walls.wall, number),
        along=ends.share(slopes),
        horizontal=entry(_horizontal(walls), number),
        tile=None,
        face=number,
        ends=ends,
    )


def _horizontal(walls: FreeWalls) -> Any:
    """float32[L]: `Hits.horizontal` of each wall."""
    xp = np if isinstance(walls.left, np.ndarray) else jnp
    along_x, along_y = (walls.left[:, i] == walls.right[:, i] for i in (1, 0))
    return xp.where(along_x, xp.float32(1), xp.where(along_y, xp.float32(0), xp.float32(0.5)))


def _as_seen(places: list[jax.Array], position: jax.Array, cos: jax.Array, sin: jax.Array) -> Ends:
    """Left and right ends float32[n, 2] as the eye sees them."""
    ways = [place - position[None] for place in places]
    return Ends(
        side=jnp.stack([way[:, 1] * cos - way[:, 0] * sin for way in ways]),
        depth=jnp.stack([way[:, 0] * cos + way[:, 1] * sin for way in ways]),
    )


def _seen(position: jax.Array, cos: jax.Array, sin: jax.Array, walls: FreeWalls) -> jax.Array:
    """float32[6, L]: what rays are compared with.

    Nearness at slope 0 and how it grows with the slope; then depth and side of the left end and of
    the right one.
    """
    places = [jnp.asarray(end) for end in (walls.left, walls.right)]
    ends = _as_seen(places, position, cos, sin)
    side, depth, area = ends.side, ends.depth, ends.area()
    # From behind, a wall is not near at all.
    area = jnp.where(area > EDGEWISE, area, jnp.inf)
    beyond = jnp.float32(OVERLAP) * (jnp.abs(side) + jnp.abs(depth))
    return jnp.stack(
        [
            (side[1] - side[0]) / area,
            (depth[0] - depth[1]) / area,
            depth[0],
            side[0] - beyond[0],
            depth[1],
            side[1] + beyond[1],
        ]
    )


def _nearest(seen: jax.Array, *, slopes: np.ndarray) -> jax.Array:
    """int32[W]: the wall that each ray meets first."""
    count = seen.shape[1]
    best = jnp.full(slopes.shape, FAR, jnp.float32), jnp.zeros(slopes.shape, jnp.int32)
    if count <= BLOCK:
        return _nearest_of(seen, jnp.int32(0), slopes, best)[1]
    blocks = -(-count // BLOCK)
    # The last block starts earlier, and looks at some walls again.
    starts = np.minimum(np.arange(blocks, dtype=np.int32) * BLOCK, count - BLOCK)

    def visit(i: jax.Array, best: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, jax.Array]:
        first = jnp.asarray(starts)[i]
        block = lax.dynamic_slice_in_dim(seen, first, BLOCK, axis=1)
        return _nearest_of(block, first, slopes, best)

    return lax.fori_loop(0, blocks, visit, varying(best, seen))[1]


def _nearest_of(
    seen: jax.Array, first: jax.Array, slopes: np.ndarray, best: tuple[jax.Array, jax.Array]
) -> tuple[jax.Array, jax.Array]:
    """Nearness and number of the nearest wall, of those before and of a block."""
    near, number = best
    for k in range(seen.shape[1]):
        here, rise, left_depth, left, right_depth, right = seen[:, k]
        here = here + rise * slopes
        met = (slopes * left_depth >= left) & (slopes * right_depth <= right) & (here > near)
        near, number = jnp.where(met, here, near), jnp.where(met, first + k, number)
    return near, number


def _looked_up(
    number: jax.Array, position: jax.Array, cos: jax.Array, sin: jax.Array, walls: FreeWalls
) -> Ends:
    """The ends of the walls that were met."""
    places = [
        jnp.stack([entry(end[:, i], number) for i in (0, 1)], axis=-1)
        for end in (walls.left, walls.right)
    ]
    return _as_seen(places, position, cos, sin)
