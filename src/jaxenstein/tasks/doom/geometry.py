"""What a body meets on a map: tables for its box and for the traces of its corners."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np

from .fixed import ONE
from .walls import Line, load_map

RADIUS = 16
"""Half the side of the player's box in map units."""
CELL_BITS = 20
BLOCK_BITS = 23
"""A block of the game's index of lines is 128 map units wide, a cell here 16."""
LATTICE = 1 << (CELL_BITS - 16)
# Each body fits into 2 by 2 blocks with all that it may touch in a tic: a window.
WINDOW = 2
BLOCKS = WINDOW**2
# How many blocks a trace may visit, and bits of each of them for the same set of blocks.
VISITS = 5
_EACH_VISIT = sum(1 << BLOCKS * i for i in range(VISITS))
# Places in an axis of `Geometry.windows`.
SIGN, EDGE, PLACE, MEMBERS, ORDER = range(5)
_NEVER = 2**31 - 1


@dataclass(frozen=True, eq=False, repr=False)
class Geometry:
    """The walls of a map as tables; on the host, constants of a program.

    Attributes:
        origin: int32[2], west and south end of the map, 16.16 map units.
        cells: uint8[n, m], whether the box of a body whose centre is in a cell (x, y) overlaps a
            wall: bit 0 inside the cell, 1 on its west edge, 2 on its south edge, 3 on both.
        windows: int32[columns, rows, 2, 5, L], the walls of the 2 by 2 blocks from each block on,
            apart those with one x (running north and south) and those with one y: `SIGN` times
            a coordinate is at least `EDGE` behind the wall, which stands at `PLACE`; bit
            i + 2 j of `MEMBERS` says whether block (i, j) of the window has it, five times over
            at a distance of 4 bits; `ORDER` is its number. Where there are fewer than L walls,
            the last entries are never behind.
    """

    origin: np.ndarray
    cells: np.ndarray
    windows: np.ndarray

    def blocked(self, position: jax.Array) -> jax.Array:
        """bool: whether the body's box overlaps a wall at a position int32[2]."""
        place = position - self.origin
        column, row = (
            jnp.clip(place[i] >> CELL_BITS, 0, size - 1) for i, size in enumerate(self.cells.shape)
        )
        on_edge = (place & ((1 << CELL_BITS) - 1)) == 0
        bit = on_edge[0].astype(jnp.uint8) + 2 * on_edge[1].astype(jnp.uint8)
        flat = jnp.asarray(self.cells.reshape(-1))
        code = flat.at[column * self.cells.shape[1] + row].get(mode="promise_in_bounds")
        return (code >> bit) & 1 == 1


@functools.cache
def load_geometry(name: str) -> Geometry:
    """The tables of a map of `maps/`."""
    return build_geometry(load_map(name).walls)


def build_geometry(walls: Sequence[Line]) -> Geometry:
    """The tables of walls that stand on a lattice of 16 map units.

    Raises:
        ValueError: a wall does not.
    """
    ends = np.array([(w.x0, w.y0, w.x1, w.y1) for w in walls], np.int64).reshape(-1, 2, 2)
    if (ends % LATTICE).any():
        raise ValueError(f"walls must stand on a lattice of {LATTICE} map units")
    low, high = ends.min(axis=(0, 1)), ends.max(axis=(0, 1))
    return Geometry(
        origin=(low * ONE).astype(np.int32),
        cells=_cells(ends, low, high),
        windows=_windows(ends, low, high),
    )


def _cells(ends: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """`Geometry.cells`; halves of a cell stand for what lies inside."""
    least, most = ends.min(axis=1), ends.max(axis=1)
    counts = (high - low) // LATTICE + 1
    axes = [low[i] + np.arange(2 * counts[i]) * (LATTICE / 2) for i in (0, 1)]
    # Strictly between, for each wall and coordinate: bool[walls, 2 * count].
    near = [
        (axis[None] < most[:, i, None] + RADIUS) & (axis[None] > least[:, i, None] - RADIUS)
        for i, axis in enumerate(axes)
    ]
    hit = np.einsum("wx,wy->xy", near[0].astype(np.int32), near[1].astype(np.int32)) > 0
    edges = hit.reshape(counts[0], 2, counts[1], 2)
    inside, west, south, both = (edges[:, 1 - i, :, 1 - j] for j in (0, 1) for i in (0, 1))
    return (inside + 2 * west + 4 * south + 8 * both).astype(np.uint8)


def _windows(ends: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """`Geometry.windows`."""
    shift = BLOCK_BITS - 16
    first, last = (ends.min(axis=1) - low) >> shift, (ends.max(axis=1) - low) >> shift
    counts = ((high - low) >> shift) + 1
    lists: dict[tuple[int, int, int], list[list[int]]] = {}
    for column in range(counts[0]):
        for row in range(counts[1]):
            for number, line in enumerate(ends):
                members = sum(
                    1 << (i + WINDOW * j)
                    for i in range(WINDOW)
                    for j in range(WINDOW)
                    if (first[number] <= (column + i, row + j)).all()
                    and ((column + i, row + j) <= last[number]).all()
                )
                if members:
                    axis = int(line[0, 0] != line[1, 0])
                    entry = [*_side(line, axis), members * _EACH_VISIT, number]
                    lists.setdefault((column, row, axis), []).append(entry)
    longest = max(map(len, lists.values()))
    table = np.zeros((*counts, 2, longest, 5), np.int32)
    table[..., EDGE] = _NEVER
    for place, entries in lists.items():
        table[place][: len(entries)] = entries
    return np.ascontiguousarray(np.swapaxes(table, -1, -2))


def _side(line: np.ndarray, axis: int) -> tuple[int, int, int]:
    """(sign, edge, place) of a wall whose points share the coordinate `axis`.

    The game finds a point behind a wall if a product of 64 bits reaches 2**32, which is so from
    a certain distance on, a fraction of a map unit that depends on the wall's length.
    """
    run = int(line[1, 1 - axis] - line[0, 1 - axis])
    # The back of walls that go north is west, of those that go east it is north.
    sign = -1 if (run > 0) == (axis == 0) else 1
    place = int(line[0, axis]) * ONE
    slack = -(-(1 << 32) // (abs(run) * ONE))
    return sign, sign * place + slack, place
