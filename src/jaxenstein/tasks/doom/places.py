"""Where scripts of the game may put things: anywhere that they do not stick into a wall."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np

from ..draws import draw_index
from .fixed import FRACTION_BITS
from .walls import load_map

RADIUS = 20
"""Half-width of the things, in map units."""
GRAIN = 4
"""All borders of where things may lie stand on a lattice of this many map units."""


@dataclass(frozen=True, eq=False)
class Places:
    """Places for the centres of things: rectangles of R by a lattice of 4 map units.

    Attributes:
        corner: int32[R, 2], west and south end of each in map units.
        columns: int32[R], how many cells each is wide.
        before: int32[R], cells of all the rectangles up to and with this one.
    """

    corner: np.ndarray
    columns: np.ndarray
    before: np.ndarray

    def draw(self, bits: jax.Array) -> jax.Array:
        """int32[..., 2]: uniform places in map units (16.16) from uint32[..., 3] bits."""
        cell = draw_index(bits[..., 0], int(self.before[-1]))
        later = cell[..., None] >= jnp.asarray(self.before).reshape((1,) * cell.ndim + (-1,))
        row = jnp.sum(later, axis=-1, dtype=jnp.int32)
        first = np.concatenate([[0], self.before[:-1]]).astype(np.int32)
        corner, columns, start = (
            jnp.asarray(table).at[row].get(mode="promise_in_bounds")
            for table in (self.corner, self.columns, first)
        )
        within = cell - start
        offset = jnp.stack([within % columns, within // columns], axis=-1)
        fine = (bits[..., 1:] >> (32 - FRACTION_BITS - GRAIN.bit_length() + 1)).astype(jnp.int32)
        return ((corner + offset * GRAIN) << FRACTION_BITS) + fine


@functools.cache
def load_places(map_name: str) -> Places:
    """Where things of half-width 20 fit on a map."""
    walls = load_map(map_name).walls
    ends = np.array([(w.x0, w.y0, w.x1, w.y1) for w in walls], np.int64).reshape(-1, 2, 2)
    low, high = ends.min(axis=(0, 1)), ends.max(axis=(0, 1))
    axes = [np.arange(low[i], high[i], GRAIN) + GRAIN / 2 for i in (0, 1)]
    least, most = ends.min(axis=1), ends.max(axis=1)
    near = [
        (axis[None] < most[:, i, None] + RADIUS) & (axis[None] > least[:, i, None] - RADIUS)
        for i, axis in enumerate(axes)
    ]
    hit = np.einsum("wx,wy->xy", near[0].astype(np.int32), near[1].astype(np.int32)) > 0
    # Inside the walls there is no wall to touch, either: a line to the west tells.
    crossed = np.zeros(hit.shape, np.int32)
    for (x0, y0), (x1, y1) in ends:
        if x0 == x1:
            crossed += (
                (axes[0][:, None] > x0)
                & (axes[1][None] > min(y0, y1))
                & (axes[1][None] < max(y0, y1))
            )
    return _rectangles(~hit & (crossed % 2 == 1), low)


def _rectangles(free: np.ndarray, low: np.ndarray) -> Places:
    """Free cells bool[columns, rows] as rectangles: runs along x, joined over rows."""
    found: list[list[int]] = []
    live: dict[tuple[int, int], int] = {}
    for row in range(free.shape[1]):
        edges = np.flatnonzero(np.diff(np.pad(free[:, row].astype(np.int8), 1)))
        runs = [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]
        live = {run: live[run] if run in live else len(found) + i for i, run in enumerate(runs)}
        # Numbers of new rectangles must follow each other.
        for run in runs:
            if live[run] >= len(found):
                live[run] = len(found)
                found.append([run[0], row, run[1] - run[0], 0])
            found[live[run]][3] += 1
    table = np.array(found, np.int32)
    return Places(
        corner=(table[:, :2] * GRAIN + low).astype(np.int32),
        columns=table[:, 2],
        before=np.cumsum(table[:, 2] * table[:, 3]).astype(np.int32),
    )
