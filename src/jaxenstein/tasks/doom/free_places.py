"""Where things can appear on a map without touching its walls."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np

from ..draws import sample_index
from .fixed import FRACTION_BITS
from .maps import THING_RADIUS, ends_of, load_map, runs

# The size in map units of the cells in which free places are found.
_GRAIN = 4


@dataclass(frozen=True, eq=False)
class FreePlaces:
    """Places for the centres of things: R rectangles of cells of `_GRAIN` map units.

    Attributes:
        corner: int32[R, 2], west and south end of each in map units.
        columns: int32[R], the width of each in cells.
        ends: int32[R], the number of cells of all rectangles up to and including this one.
    """

    corner: np.ndarray
    columns: np.ndarray
    ends: np.ndarray

    def sample(self, bits: jax.Array) -> jax.Array:
        """int32[..., 2]: uniform positions in map units (16.16), from random uint32[..., 3]."""
        cell = sample_index(bits[..., 0], int(self.ends[-1]))
        later = cell[..., None] >= jnp.asarray(self.ends).reshape((1,) * cell.ndim + (-1,))
        row = jnp.sum(later, axis=-1, dtype=jnp.int32)
        first = np.concatenate([[0], self.ends[:-1]]).astype(np.int32)
        corner, columns, start = (
            jnp.asarray(table).at[row].get(mode="promise_in_bounds")
            for table in (self.corner, self.columns, first)
        )
        within = cell - start
        offset = jnp.stack([within % columns, within // columns], axis=-1)
        fine = (bits[..., 1:] >> (32 - FRACTION_BITS - _GRAIN.bit_length() + 1)).astype(jnp.int32)
        return ((corner + offset * _GRAIN) << FRACTION_BITS) + fine


@functools.cache
def load_free_places(map_name: str) -> FreePlaces:
    """The places on a map for things of half-width 20 that do not stick into a wall."""
    walls = load_map(map_name).walls
    ends = ends_of(walls)
    low, high = ends.min(axis=(0, 1)), ends.max(axis=(0, 1))
    axes = [np.arange(low[i], high[i], _GRAIN) + _GRAIN / 2 for i in (0, 1)]
    least, most = ends.min(axis=1), ends.max(axis=1)
    near = [
        (axis[None] < most[:, i, None] + THING_RADIUS)
        & (axis[None] > least[:, i, None] - THING_RADIUS)
        for i, axis in enumerate(axes)
    ]
    hit = np.einsum("wx,wy->xy", near[0].astype(np.int32), near[1].astype(np.int32)) > 0
    # Places inside walls do not touch them either, so a line to the west tells inside from outside.
    crossed = np.zeros(hit.shape, np.int32)
    for (x0, y0), (x1, y1) in ends:
        if x0 == x1:
            crossed += (
                (axes[0][:, None] > x0)
                & (axes[1][None] > min(y0, y1))
                & (axes[1][None] < max(y0, y1))
            )
    return _rectangles(~hit & (crossed % 2 == 1), low)


def _rectangles(free: np.ndarray, low: np.ndarray) -> FreePlaces:
    """Free cells bool[columns, rows] as rectangles: runs along x, joined over rows."""
    found: list[list[int]] = []
    live: dict[tuple[int, int], int] = {}
    for row in range(free.shape[1]):
        here = runs(free[:, row])
        live = {run: live[run] if run in live else len(found) + i for i, run in enumerate(here)}
        # Numbers of new rectangles must be consecutive.
        for run in here:
            if live[run] >= len(found):
                live[run] = len(found)
                found.append([run[0], row, run[1] - run[0], 0])
            found[live[run]][3] += 1
    table = np.array(found, np.int32)
    return FreePlaces(
        corner=(table[:, :2] * _GRAIN + low).astype(np.int32),
        columns=table[:, 2],
        ends=np.cumsum(table[:, 2] * table[:, 3]).astype(np.int32),
    )
