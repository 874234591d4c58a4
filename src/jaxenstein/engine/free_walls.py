"""Rays against walls at any place and angle: every ray against every wall, and the nearest wins.

In the view of the eye, a place has a depth and is `side` to the right. A ray of slope s (see
`raycast`) passes right of it if `s * depth > side`, also if it is behind the eye. It meets a wall
that is seen from its front if it passes right of the wall's left end and left of its right end. Its
nearness there, one over the depth, is linear in s. So a ray and a wall take three products.
"""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from .._jax.batching import varying
from .._jax.staging import staged
from ..pytree import PyTreeNode
from .level import FreeWalls

# More walls than this are looked at in a loop over blocks of this size, to bound the program.
BLOCK = 32
# Walls reach this share of an end's distance beyond that end, so that no ray slips through a corner.
OVERLAP = 1e-6
# The least nearness, and the least area between the eye and a wall of which it sees the front.
FAR, EDGEWISE = 1e-6, 1e-9


class Met(PyTreeNode):
    """The wall that each of W rays meets.

    Attributes:
        number: int32[W], which wall.
        side: float32[2, W], how far its left and its right end are to the right, in tiles.
        depth: float32[2, W], their depths.
    """

    number: jax.Array
    side: jax.Array
    depth: jax.Array

    def passes(self, slopes: np.ndarray | float) -> tuple[jax.Array, jax.Array]:
        """float32[W] twice: how far right of each end rays pass, times their length."""
        left, right = (slopes * self.depth[i] - self.side[i] for i in (0, 1))
        return left, right

    def nearness(self, slopes: np.ndarray | float) -> jax.Array:
        """float32[W]: one over the depth at which rays meet the whole line of the wall."""
        left, right = self.passes(slopes)
        return (left - right) / _area(self.side, self.depth)

    def share(self, slopes: np.ndarray | float) -> jax.Array:
        """float32[W] in [0, 1]: where rays meet the wall, from its left end to its right one."""
        left, right = self.passes(slopes)
        return jnp.clip(left / (left - right), 0, 1)

    def length(self) -> jax.Array:
        """float32[W]: of the wall in tiles."""
        return jnp.sqrt((self.side[1] - self.side[0]) ** 2 + (self.depth[1] - self.depth[0]) ** 2)


def meet(
    position: jax.Array, direction: tuple[jax.Array, jax.Array], walls: FreeWalls, slopes: np.ndarray
) -> Met:
    """Find the wall that each ray meets first.

    Args:
        position: float32[2], (x, y) of the eye in tiles; walls must enclose it.
        direction: float32[] twice, cosine and sine of the heading.
        walls: the walls.
        slopes: float32[W], of the rays.
    """
    seen = staged(_seen)(position, *direction, walls)
    number = staged(partial(_nearest, slopes=slopes))(seen)
    return staged(_looked_up)(number, position, *direction, walls)


def _view(place: jax.Array, cos: jax.Array, sin: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Side and depth of [..., 2] relative to the eye."""
    x, y = place[..., 0], place[..., 1]
    return y * cos - x * sin, x * cos + y * sin


def _area(side: jax.Array, depth: jax.Array) -> jax.Array:
    """Twice the area between the eye and each wall, positive if the eye sees its front."""
    return side[1] * depth[0] - side[0] * depth[1]


def _seen(position: jax.Array, cos: jax.Array, sin: jax.Array, walls: FreeWalls) -> jax.Array:
    """float32[6, L]: what rays are compared with.

    Nearness at slope 0 and how it grows with the slope; then depth and side of the left end and of
    the right one.
    """
    ends = [_view(jnp.asarray(end) - position, cos, sin) for end in (walls.left, walls.right)]
    side, depth = (jnp.stack(part) for part in zip(*ends, strict=True))
    area = _area(side, depth)
    front = area > EDGEWISE
    area = jnp.where(front, area, 1)
    beyond = jnp.float32(OVERLAP) * (jnp.abs(side) + jnp.abs(depth))
    return jnp.stack(
        [
            (side[1] - side[0]) / area,
            (depth[0] - depth[1]) / area,
            depth[0],
            jnp.where(front, side[0] - beyond[0], jnp.inf),
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
) -> Met:
    """Where the walls are that were met."""
    ends = []
    for end in (walls.left, walls.right):
        place = [jnp.asarray(end)[:, i].at[number].get(mode="promise_in_bounds") for i in (0, 1)]
        ends.append(_view(jnp.stack(place, axis=-1) - position, cos, sin))
    side, depth = (jnp.stack(part) for part in zip(*ends, strict=True))
    return Met(number, side, depth)
