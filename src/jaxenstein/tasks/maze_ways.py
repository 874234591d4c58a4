"""Paths through a maze: straightened detours, random paths, and doors that leave a path open."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from .._jax.batching import varying
from ..engine.level import Array
from .draws import sample_index

# (row, column) directions from which detours are removed, in the order of the original.
_UP = np.array(((1, 0), (-1, 0), (0, 1), (0, -1)), np.int32)
# (row, column) offsets of neighbouring cells.
AROUND = ((0, 1), (0, -1), (1, 0), (-1, 0))
# Quarter turns, counter-clockwise, that rotate each direction up.
_TURNS = (2, 0, 1, 3)


def shift(grid: jax.Array, rows: int, columns: int) -> jax.Array:
    """The grid shifted by a number of rows and columns; 0 or False from outside the border."""
    (height, width), far = grid.shape, max(abs(rows), abs(columns))
    wide = jnp.pad(grid, far)
    return wide[far + rows : far + rows + height, far + columns : far + columns + width]


def straighten(corridor: jax.Array, wall: jax.Array) -> jax.Array:
    """Straighten detours around three sides of a rectangle, one after another.

    As in the original, the smallest detour comes first, among equals the first by row, column and
    direction, and each is pulled as far as possible. After each one the search restarts. After a
    detour of size 1 it restarts at size 2, so that some detours of size 1 may remain.

    Args:
        corridor: bool[N, N], walkable cells; a cell that is neither corridor nor wall is a doorway.
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
        # Directions up and along the detour, as steps of (row, column).
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
    """int32[N, N, 4]: the size of the detour whose lower left corner is a wall cell, or 0.

    With the direction `_UP` on top, a detour of size 3 leads from the left o to the right one
    around walls, and is pulled down by one row:

        x*****x
        *ooooo*
        ?o***o?     the first * of this row is the cell
        ??***??
    """
    sizes = jax.vmap(_detours_down)(_turned(corridor), _turned(wall))
    back = [jnp.rot90(found, -turns) for found, turns in zip(sizes, _TURNS, strict=True)]
    return jnp.stack(back, axis=-1)


def _turned(grid: jax.Array) -> jax.Array:
    """[4, N, N]: the grid rotated so that each direction of `_UP` is on top."""
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


def sample_path(
    bits: jax.Array, walkable: jax.Array, start: jax.Array, end: jax.Array
) -> jax.Array:
    """bool[N, N]: the cells of a random path, including both ends.

    From each cell, the path continues to a random unvisited neighbour, or to the end as soon as
    that is a neighbour. In a dead end it goes back. This is the rule of DeepMind Lab's
    `visitRandomPath`.

    Args:
        bits: uint32[N * N], random.
        walkable: bool[N, N], False on the border; it must connect start and end.
        start: int32[2], (column, row) of a cell.
        end: int32[2], another cell, or the same.
    """
    size = walkable.shape[0]
    index = np.arange(size * size, dtype=np.int32).reshape(size, size)
    last = end[1] * size + end[0]
    first = jnp.where(index == start[1] * size + start[0], 1, 0)

    def there(depth: jax.Array) -> jax.Array:
        return jnp.any((index == last) & (depth > 0))

    def go(carry: tuple[jax.Array, ...]) -> tuple[jax.Array, ...]:
        time, depth, left = carry
        deepest = jnp.max(depth)
        here = depth == deepest
        ways = jnp.stack([shift(here, *step) for step in AROUND]) & left[None]
        beside = jnp.any(ways, axis=(1, 2))
        upto = jnp.cumsum(beside, dtype=jnp.int32)
        way = jnp.argmax(upto > sample_index(bits[time], jnp.maximum(upto[-1], 1)))
        final = jnp.any(ways, axis=0) & (index == last)
        target = jnp.where(jnp.any(final), final, ways[way]) & (upto[-1] > 0)
        # In a dead end, the path goes back.
        depth = jnp.where(here & (upto[-1] == 0), 0, depth)
        depth = jnp.where(target, deepest + 1, depth)
        # Only new cells use up a random number.
        return time + (upto[-1] > 0).astype(jnp.int32), depth, left & ~target

    carry = jnp.int32(0), first.astype(jnp.int32), walkable & (first == 0)
    carry = varying(carry, bits, walkable, start, end)
    return jax.lax.while_loop(lambda c: ~there(c[1]) & (jnp.max(c[1]) > 0), go, carry)[1] > 0


def sample_closed(
    bits: jax.Array, walkable: jax.Array, doors: Array, start: jax.Array, end: jax.Array
) -> jax.Array:
    """bool[D]: which doors are closed: half (rounded up) of those off a random path.

    Args:
        bits: uint32[N * N + D], random.
        walkable: as in `sample_path`, including doors.
        doors: int32[D, 2], (column, row) of each; in column 0 if it is absent.
        start: as in `sample_path`.
        end: as in `sample_path`.
    """
    column, row = jnp.asarray(doors).T
    path = sample_path(bits[: walkable.size], walkable, start, end)
    shut = (column > 0) & ~path[row, column]
    # A door's rank in a random order of the doors that are not on the path.
    drawn = jnp.where(shut, bits[walkable.size :] >> 1, jnp.uint32(2**32 - 1))
    rank = jnp.argsort(jnp.argsort(drawn))
    return shut & (rank >= jnp.sum(shut, dtype=jnp.int32) // 2)
