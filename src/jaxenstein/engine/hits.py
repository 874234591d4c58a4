"""What rays hit."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from ..pytree import PyTreeNode


class Ends(PyTreeNode):
    """The ends of the walls that W rays hit, as the eye sees them: the left one and the right one.

    Attributes:
        side: float32[2, W], how far to the right they are, in tiles.
        depth: float32[2, W].
    """

    side: jax.Array
    depth: jax.Array

    def passes(self, slopes: np.ndarray | float) -> tuple[jax.Array, jax.Array]:
        """float32[W] twice: how far right of each end rays pass, times their length."""
        left, right = np.atleast_1d(slopes).astype(np.float32)[None] * self.depth - self.side
        return left, right

    def nearness(self, slopes: np.ndarray | float) -> jax.Array:
        """float32[W]: one over the depth at which rays meet the whole line of the wall."""
        left, right = self.passes(slopes)
        return (left - right) / self.area()

    def share(self, slopes: np.ndarray | float) -> jax.Array:
        """float32[W] in [0, 1]: where rays meet the wall, from its left end to its right one."""
        left, right = self.passes(slopes)
        return jnp.clip(left / (left - right), 0, 1)

    def area(self) -> jax.Array:
        """float32[W]: twice the area between eye and wall; positive where its front is seen."""
        return self.side[1] * self.depth[0] - self.side[0] * self.depth[1]

    def length(self) -> jax.Array:
        """float32[W]: of the wall in tiles."""
        return jnp.sqrt((self.side[1] - self.side[0]) ** 2 + (self.depth[1] - self.depth[0]) ** 2)


class Hits(PyTreeNode):
    """The walls that the rays hit; W is the number of image columns.

    Attributes:
        depth: float32[W], perpendicular distance in tiles.
        wall: uint8[W], the entry of `Level.walls` of the face that was hit.
        along: float32[W] in [0, 1], the place on the face from its left to its right edge as seen.
        horizontal: bool[W], whether the face looks north or south. Of free walls float32[W]: 1 for
            those that do, 0 for those that look west or east, one half for the others.
        tile: int32[W, 2], (column, row) of the tile that was hit, without the margin.
        side: int32[W], where the face looks: west, east, north, south; None if nobody asked.
        face: int32[W], its place in an array [4, R, C] of the faces of a level, or among its free
            walls; likewise.
        ends: of the free walls that were hit, if the level has any; it then has neither tiles nor
            sides.
    """

    depth: jax.Array
    wall: jax.Array
    along: jax.Array
    horizontal: jax.Array
    tile: jax.Array | None
    side: jax.Array | None = None
    face: jax.Array | None = None
    ends: Ends | None = None
