"""The grid lines that rays are tested against; names describe the vertical lines.

If the map is a constant of the program, these are the lines that have a wall face. If the map is
in the state, these are all lines, in the order in which a ray crosses them.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from ..pytree import PyTreeNode, static
from .level import Level, unpack_bits


class Crossed(PyTreeNode):
    """All K lines in the order in which rays cross them.

    Attributes:
        ahead: int32[K, words], bits of the solid rows in the columns that forward rays enter.
        behind: int32[K, words], the same for the other rays.
    """

    ahead: jax.Array
    behind: jax.Array


class Fixed(PyTreeNode):
    """The lines of a constant map that have a wall face.

    Attributes:
        doors: int32[L, words] if the map has doors: bits of the solid rows of each column.
        columns: these columns.
        words: the bits, if the map has no doors.
        most: more lines than a ray can cross.
    """

    doors: jax.Array | None
    columns: tuple[int, ...] = static()
    words: tuple[tuple[int, ...], ...] = static()
    most: int = static()


def fixed_lines(level: Level) -> tuple[Fixed, Fixed] | None:
    """The vertical and horizontal lines that rays can hit; None if the map is not constant."""
    if not all(isinstance(part, np.ndarray) for part in (level.column_bits, level.doors)):
        return None
    doors = np.zeros(level.size, bool)
    doors[level.doors[:, 0], level.doors[:, 1]] = True
    solid = unpack_bits(np.asarray(level.column_bits))[:, : level.size[1]]
    return (
        _with_faces(np.asarray(level.column_bits), solid, doors),
        _with_faces(np.asarray(level.row_bits), solid.T, doors.T),
    )


def _with_faces(bits: np.ndarray, solid: np.ndarray, doors: np.ndarray) -> Fixed:
    """The lines of one kind where a tile that may stop a ray is next to one that may not."""
    entered, left = solid | doors, ~solid
    faces = np.zeros(len(solid), bool)
    faces[1:] |= (entered[1:] & left[:-1]).any(axis=1)
    faces[:-1] |= (entered[:-1] & left[1:]).any(axis=1)
    words = () if doors.any() else tuple(map(tuple, bits[faces].view(np.int32).tolist()))
    return Fixed(None, tuple(np.flatnonzero(faces).tolist()), words, len(solid))


def crossed(words: jax.Array, column: jax.Array) -> Crossed:
    """The words of all columns except the eye's, in each direction."""
    last = words.shape[0] - 1
    order = jnp.arange(last, dtype=jnp.int32)
    ahead, behind = jnp.minimum(column + 1 + order, last), jnp.maximum(column - 1 - order, 0)
    return Crossed(
        ahead=words.at[ahead].get(mode="promise_in_bounds"),
        behind=words.at[behind].get(mode="promise_in_bounds"),
    )


def shut(words: jax.Array, fixed: Fixed) -> Fixed:
    """The same lines with the currently closed doors, if the map has doors."""
    columns = np.asarray(fixed.columns, np.int32)
    return fixed if fixed.words else fixed.replace(doors=words[columns])
