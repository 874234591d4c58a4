"""Which tiles a step enters, and what stops it, against exact arithmetic."""

from __future__ import annotations

import math
from fractions import Fraction

import jax
import jax.numpy as jnp
import numpy as np

from jaxenstein.engine.level import compile_level
from jaxenstein.engine.motion import path_tiles, walk

Tile = tuple[int, int]


def entered(start: np.ndarray, end: np.ndarray) -> list[Tile]:
    """The tiles of a segment in their order, the start's first; none where it meets a corner."""
    (x, y), (u, v) = ([Fraction(float(part)) for part in place] for place in (start, end))
    crossings = []
    for axis, (a, b) in enumerate(((x, u), (y, v))):
        for line in range(math.floor(min(a, b)) + 1, math.floor(max(a, b)) + 1):
            crossings.append(((line - a) / (b - a), axis, 1 if b > a else -1))
    if len({when for when, _, _ in crossings}) < len(crossings):
        return []
    tiles = [(math.floor(x), math.floor(y))]
    for _, axis, way in sorted(crossings):
        column, row = tiles[-1]
        tiles.append((column + way, row) if axis == 0 else (column, row + way))
    return tiles


def segments(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Starts in the tile (3, 3) and ends less than a tile away, float32[count, 2]."""
    rng = np.random.default_rng(0)
    starts = rng.uniform(3, 4, (count, 2)).astype(np.float32)
    angle, length = rng.uniform(0, 2 * np.pi, count), rng.uniform(0, 0.999, count)
    steps = np.stack([np.cos(angle), np.sin(angle)], -1) * length[:, None]
    return starts, starts + steps.astype(np.float32)


def test_tiles_of_a_step() -> None:
    starts, ends = segments(4000)
    firsts, lasts = jax.jit(jax.vmap(path_tiles))(starts, ends)
    corners = 0
    for start, end, first, last in zip(
        starts, ends, np.asarray(firsts).tolist(), np.asarray(lasts).tolist(), strict=True
    ):
        tiles = entered(start, end)
        assert tiles
        assert tuple(last) == tiles[-1]
        # Between start and end there is a tile only where two lines are crossed.
        assert tuple(first) in (tiles[1:2] if len(tiles) == 3 else tiles)
        corners += len(tiles) == 3
    assert corners > 300


def test_a_step_is_stopped_by_any_tile_that_it_enters() -> None:
    """Around a corner the order counts: one way round is free, the other is not."""
    starts, ends = segments(2000)
    rng = np.random.default_rng(1)
    stopped = passed = 0
    for walls in rng.integers(0, 2, (6, 7, 7)).astype(np.uint8):
        walls[3, 3] = 0
        walls[[0, -1]] = walls[:, [0, -1]] = 1
        level = compile_level(walls, np.zeros((0, 2), np.int32))

        def go(start: jax.Array, step: jax.Array, level=level) -> jax.Array:
            return walk(level, jnp.zeros(0, bool), start, step)

        steps = ends - starts
        after = np.asarray(jax.jit(jax.vmap(go))(starts, steps))
        # The same sum as the engine's: in floats, start + (end - start) need not be the end.
        for start, target, place in zip(starts, starts + steps, after, strict=True):
            tiles = entered(start, target)
            if not tiles:
                continue
            free = all(walls[row, column] == 0 for column, row in tiles)
            np.testing.assert_array_equal(place, target if free else start)
            stopped, passed = stopped + (not free), passed + free
    assert min(stopped, passed) > 2000
