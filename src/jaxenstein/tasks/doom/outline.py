"""The walls of a map of tiles in map units: a segment along each straight run of solid tiles."""

from __future__ import annotations

import numpy as np

from .walls import Line


def outline(solid: np.ndarray, unit: int) -> tuple[Line, ...]:
    """The walls between open and solid tiles, as long as they go.

    The map's south-western corner is the origin, and everything outside is solid.

    Args:
        solid: bool[rows, columns], first row in the north.
        unit: map units a tile.
    """
    padded = np.pad(solid, 1, constant_values=True)
    rows = len(solid)
    lines = []
    # Of a border between two rows: what is solid on one side of it and open on the other.
    for row in range(rows + 1):
        above, below = padded[row, 1:-1], padded[row + 1, 1:-1]
        y = (rows - row) * unit
        lines += [Line(a * unit, y, b * unit, y, "-") for a, b in _runs(above & ~below)]
        lines += [Line(b * unit, y, a * unit, y, "-") for a, b in _runs(below & ~above)]
    for column in range(solid.shape[1] + 1):
        left, right = padded[1:-1, column], padded[1:-1, column + 1]
        x = column * unit
        for top, bottom in _runs(left & ~right):
            lines.append(Line(x, (rows - bottom) * unit, x, (rows - top) * unit, "-"))
        for top, bottom in _runs(right & ~left):
            lines.append(Line(x, (rows - top) * unit, x, (rows - bottom) * unit, "-"))
    return tuple(lines)


def _runs(there: np.ndarray) -> list[tuple[int, int]]:
    """(first, past the last) of each run of true values."""
    edges = np.flatnonzero(np.diff(np.pad(there.astype(np.int8), 1)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]
