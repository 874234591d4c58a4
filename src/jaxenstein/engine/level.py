"""Levels: tile maps compiled into the bit words that rays test.

Coordinates: x grows along a row of the map, y down the rows; tile (column, row) covers
[column, column + 1) x [row, row + 1). Everything outside the map is solid.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..pytree import PyTreeNode, static

WORD = 32
# The look of the margin: the first wall (see `scene.Theme`).
OUTSIDE = 2
Array = jax.Array | np.ndarray


class FreeWalls(PyTreeNode):
    """Walls at any place and angle, seen from one side; L of them.

    Attributes:
        left: float32[L, 2], (x, y) in tiles of the end on the left, as seen.
        right: float32[L, 2], and of the end on the right.
        wall: uint8[L], which wall each one is (see `scene.Theme`).
    """

    left: Array
    right: Array
    wall: Array


class Level(PyTreeNode):
    """The geometry of one map, either a constant of the program or part of a state.

    C and R are the columns and rows of the map including the margin, D is the number of doors.

    Attributes:
        column_bits: uint32[C, ceil(R / 32)], the solid rows of each column as bits, lowest first.
        row_bits: uint32[R, ceil(C / 32)], the solid columns of each row as bits.
        walls: uint8[F, R, C], the wall on each solid tile. F is 1, or 4 if the faces differ: the
            west, east, north and south faces.
        doors: int32[D, 2], (column, row) of each door, margin included. Doors are not solid in
            `column_bits` and `row_bits`; a closed door adds its bit.
        margin: solid tiles added on each side of the map: 0 if its border was solid already.
        free_walls: walls that rays meet instead of the tiles and doors, around every place where
            the eye may be; None if they meet the tiles. Bodies meet the tiles.
    """

    column_bits: Array
    row_bits: Array
    walls: Array
    doors: Array
    margin: int = static(default=0)
    free_walls: FreeWalls | None = None

    @property
    def size(self) -> tuple[int, int]:
        """(columns, rows) of the level, margin included."""
        return self.column_bits.shape[0], self.row_bits.shape[0]


def compile_level(walls: np.ndarray, doors: np.ndarray) -> Level:
    """Compile a fixed map on the host, in numpy, without using a device.

    Args:
        walls: uint8[rows, columns] or uint8[4, rows, columns] (see `Level.walls`), 0 where open.
        doors: int32[D, 2], (column, row) of each door; doors must not be 0 in `walls`.
    """
    faces = walls if walls.ndim == 3 else walls[None]
    doors = np.asarray(doors, np.int32).reshape(-1, 2)
    solid = (faces != 0).any(axis=0)
    solid[doors[:, 1], doors[:, 0]] = False
    border = np.concatenate([solid[0], solid[-1], solid[:, 0], solid[:, -1]])
    margin = 0 if border.all() else 1
    ring = ((margin, margin), (margin, margin))
    solid = np.pad(solid, ring, constant_values=True)
    faces = np.pad(faces, ((0, 0), *ring), constant_values=OUTSIDE).astype(np.uint8)
    return Level(
        column_bits=pack_bits(solid.T),
        row_bits=pack_bits(solid),
        walls=faces,
        doors=doors + np.int32(margin),
        margin=margin,
    )


def level_from_walls(walls: jax.Array, doors: jax.Array | None = None) -> Level:
    """Build a level in a traced program, for maps that are generated at reset.

    Args:
        walls: uint8[rows, columns], 0 where open; the border must be solid.
        doors: int32[D, 2], (column, row) of each door. A tile of the border, such as (0, 0),
            stands for a door that this layout does not have.
    """
    if doors is None:
        doors = jnp.zeros((0, 2), jnp.int32)
    solid = walls != 0
    border = jnp.zeros(solid.shape, bool).at[0].set(True).at[-1].set(True)
    border = border.at[:, 0].set(True).at[:, -1].set(True)
    if doors.shape[0]:
        solid = solid.at[doors[:, 1], doors[:, 0]].set(False)
    solid = solid | border
    return Level(
        column_bits=pack_bits(solid.T),
        row_bits=pack_bits(solid),
        walls=walls[None],
        doors=doors,
        margin=0,
    )


def pack_bits(bits: Any) -> Any:
    """bool[n, m] -> uint32[n, ceil(m / 32)]; entry j is bit j % 32 of word j // 32.

    Returns numpy arrays for numpy arrays, else JAX arrays. Bits past the end are set.
    """
    xp = np if isinstance(bits, np.ndarray) else jnp
    lines, length = bits.shape
    words = -(-length // WORD)
    padded = xp.pad(bits, ((0, 0), (0, words * WORD - length)), constant_values=True)
    weights = np.left_shift(np.uint32(1), np.arange(WORD, dtype=np.uint32))
    split = padded.reshape(lines, words, WORD)
    return xp.where(split, weights[None, None], np.uint32(0)).sum(axis=-1, dtype=np.uint32)


def unpack_bits(words: np.ndarray) -> np.ndarray:
    """uint32[n, k] -> bool[n, 32 k], on the host; the inverse of `pack_bits`, with bits past m."""
    bits = np.right_shift(words[:, :, None], np.arange(WORD, dtype=np.uint32)) & np.uint32(1)
    return bits.astype(bool).reshape(len(words), -1)


def occupancy(level: Level, closed: jax.Array) -> tuple[jax.Array, jax.Array]:
    """The words of `level.column_bits` and `level.row_bits` with the closed doors added.

    Args:
        level: the level.
        closed: bool[D], which doors are closed.
    """
    columns, rows = jnp.asarray(level.column_bits), jnp.asarray(level.row_bits)
    if level.doors.shape[0] == 0:
        return columns, rows
    column, row = jnp.asarray(level.doors[:, 0]), jnp.asarray(level.doors[:, 1])
    return (
        columns | _door_bits(column, row, closed, columns.shape),
        rows | _door_bits(row, column, closed, rows.shape),
    )


def _door_bits(
    line: jax.Array, place: jax.Array, closed: jax.Array, shape: tuple[int, ...]
) -> jax.Array:
    """uint32[shape]: bit `place` of word line `line` for each closed door."""
    lines, words = shape
    word = jnp.arange(lines * words, dtype=jnp.int32).reshape(1, *shape)
    here = word == (line * words + place // WORD)[:, None, None]
    bit = jnp.left_shift(jnp.uint32(1), (place % WORD).astype(jnp.uint32))
    bits = jnp.where(here & closed[:, None, None], bit[:, None, None], jnp.uint32(0))
    # Doors never share a tile, but absent doors may, so combine with or instead of adding.
    return jax.lax.reduce(bits, np.uint32(0), jax.lax.bitwise_or, (0,))


def is_solid(level: Level, closed: jax.Array, column: jax.Array, row: jax.Array) -> jax.Array:
    """bool[]: whether a tile stops a body: a wall, a closed door, or a tile outside the map.

    Args:
        level: the level.
        closed: bool[D], which doors are closed.
        column: int32[], column of the tile in map coordinates (without the margin).
        row: int32[], row of the tile.
    """
    column, row = column + level.margin, row + level.margin
    columns, rows = level.size
    inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    safe_column, safe_row = jnp.clip(column, 0, columns - 1), jnp.clip(row, 0, rows - 1)
    word = jnp.asarray(level.column_bits)[safe_column, safe_row // WORD]
    wall = (jnp.right_shift(word, (safe_row % WORD).astype(jnp.uint32)) & 1).astype(bool)
    return ~inside | wall | jnp.any(closed & door_at(level, column, row))


def door_at(level: Level, column: jax.Array, row: jax.Array) -> jax.Array:
    """bool[D]: which door is on a tile of the level (margin included)."""
    doors = jnp.asarray(level.doors)
    return (doors[:, 0] == column) & (doors[:, 1] == row)
