"""Detours of corridors pulled straight: the last step of a random maze."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from .._jax.batching import varying

# (row, column) of the side of a detour that is taken away, in the original's order.
_UP = np.array(((1, 0), (-1, 0), (0, 1), (0, -1)), np.int32)
# Quarter turns, counter-clockwise, that bring each of them up.
_TURNS = (2, 0, 1, 3)


def shift(grid: jax.Array, rows: int, columns: int) -> jax.Array:
    """What lies so many rows and columns from each place; 0 or false past the border."""
    (height, width), far = grid.shape, max(abs(rows), abs(columns))
    wide = jnp.pad(grid, far)
    return wide[far + rows : far + rows + height, far + columns : far + columns + width]


def straighten(corridor: jax.Array, wall: jax.Array) -> jax.Array:
    """Pull detours around three sides of a rectangle straight, one after another.

    As the original does it, smallest first, and among equals the first by row, column and
    direction, each as far as it goes; after every one the search begins anew, but after one of
    size 1 with size 2, so that further ones of size 1 may stay.

    Args:
        corridor: bool[N, N], the cells that can be walked on; what is neither is a doorway.
        wall: bool[N, N].
    """
    size = corridor.shape[0]
    row, column = np.indices(corridor.shape, np.int32)

    def pull(carry: tuple[jax.Array, ...]) -> tuple[jax.Array, ...]:
        corridor, wall, least, place, _ = carry
        found = _detours(corridor, wall)
        here = (row * size + column == place)[..., None]
        further = jnp.any((found == least) & here)
        least = jnp.where(further | (place < 0), least, jnp.where(least == 1, 2, 1))
        fits = jnp.where(further, here & (found == least), found >= least)
        width = jnp.min(jnp.where(fits, found, size))
        chosen = jnp.argmax((fits & (found == width)).reshape(-1)).astype(jnp.int32)
        some = width < size
        cell, way = chosen // 4, chosen % 4
        # Up and along of the detour, as steps of (row, column).
        up = jnp.asarray(_UP)[way]
        down_by, right_by = row - cell // size, column - cell % size
        height = down_by * up[0] + right_by * up[1]
        along = down_by * up[1] - right_by * up[0]
        opened = (height == 0) & (along >= 0) & (along < width) & some
        closed = (height == 1) & (along >= -1) & (along <= width) & some
        corridor, wall = (corridor | opened) & ~closed, (wall | closed) & ~opened
        return corridor, wall, width, cell - up[0] * size - up[1], some

    start = corridor, wall, jnp.int32(1), jnp.int32(-1), jnp.bool_(True)
    start = varying(start, corridor, wall)
    return jax.lax.while_loop(lambda carry: carry[4], pull, start)[0]


def _detours(corridor: jax.Array, wall: jax.Array) -> jax.Array:
    """int32[N, N, 4]: the size of the detour that a wall's cell is the left lower corner of, or 0.

    Seen with `_UP` on top, a detour of size 3 leads from the left o to the right one around
    walls, and is pulled down by one row:

        x*****x
        *ooooo*
        ?o***o?     the first * of this row is the cell
        ??***??
    """
    sizes = jax.vmap(_detours_down)(_turned(corridor), _turned(wall))
    back = [jnp.rot90(found, -turns) for found, turns in zip(sizes, _TURNS, strict=True)]
    return jnp.stack(back, axis=-1)


def _turned(grid: jax.Array) -> jax.Array:
    """[4, N, N]: the grid with each of `_UP` on top."""
    return jnp.stack([jnp.rot90(grid, turns) for turns in _TURNS])


def _detours_down(way: jax.Array, stone: jax.Array) -> jax.Array:
    """int32[N, N]: as `_detours`, for those that are pulled down."""
    above = shift(way, -1, 0) & shift(stone, -2, 0)
    inner, side = stone & shift(stone, 1, 0) & above, way & above
    first = shift(side, 0, -1) & shift(stone, -1, -2)
    fits, length = side & shift(stone, -1, 1), jnp.zeros(way.shape, jnp.int32)
    for size in range(1, way.shape[0] - 3):
        fits = inner & shift(fits, 0, 1)
        length = jnp.where(fits & first, size, length)
    return length
