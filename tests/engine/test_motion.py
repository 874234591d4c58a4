"""The tiles that a step enters and the walls that stop it, in exact arithmetic."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.extend.core import Literal

from jaxenstein.engine.level import compile_level
from jaxenstein.engine.motion import DRIFT, length, path_tiles, turn, walk

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
    """Starts in tile (3, 3), and ends less than a tile away, float32[count, 2]."""
    rng = np.random.default_rng(0)
    starts = rng.uniform(3, 4, (count, 2)).astype(np.float32)
    angle, length = rng.uniform(0, 2 * np.pi, count), rng.uniform(0, 0.999, count)
    steps = np.stack([np.cos(angle), np.sin(angle)], -1) * length[:, None]
    return starts, starts + steps.astype(np.float32)


def test_tiles_entered_by_a_step() -> None:
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


def test_step_is_stopped_by_any_solid_tile_it_enters() -> None:
    """Around a corner the order matters: one way is free, the other is not."""
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


def fused_length(offsets: np.ndarray, side: int | None) -> np.ndarray:
    """`length` as computed by a compiler that fuses products and sums into one rounding.

    Args:
        offsets: float32[N, 2].
        side: which summand is joined, where both are products; None joins nothing.
    """
    program = jax.make_jaxpr(length)(offsets).jaxpr
    values = {program.invars[0]: offsets}
    products = {}

    def value(name: Any) -> Any:
        return np.asarray(name.val) if isinstance(name, Literal) else values[name]

    for line in program.eqns:
        given = [value(name) for name in line.invars]
        assert line.primitive.name not in ("reduce_sum", "dot_general", "pjit", "jit")
        if line.primitive.name == "mul":
            # Of two float32 exact in float64.
            products[line.outvars[0]] = given[0].astype(np.float64) * given[1]
        exact = [None if isinstance(name, Literal) else products.get(name) for name in line.invars]
        out = np.asarray(line.primitive.bind(*given, **line.params))
        if line.primitive.name == "add" and side is not None and any(e is not None for e in exact):
            joined = side if exact[side] is not None else 1 - side
            total = exact[joined] + given[1 - joined].astype(np.float64)
            out = total.astype(np.float32)
        values[line.outvars[0]] = out
    return values[program.outvars[0]]


def test_length_does_not_depend_on_fusion() -> None:
    rng = np.random.default_rng(2)
    scale = rng.choice([1e-3, 0.3, 5, 60], (4000, 1))
    offsets = (rng.normal(size=(4000, 2)) * scale).astype(np.float32)
    plain = fused_length(offsets, None)
    for side in (0, 1):
        np.testing.assert_array_equal(fused_length(offsets, side), plain)
    np.testing.assert_array_equal(jax.jit(length)(offsets), plain)
    np.testing.assert_array_equal([jax.jit(length)(one) for one in offsets[:50]], plain[:50])
    true = np.hypot(*offsets.astype(np.float64).T)
    assert (np.abs(plain - true) <= 1.5 * np.spacing(plain)).all()


def test_gradient_of_length() -> None:
    offset = jnp.array([-3.0, 4.0]) * 1.1
    np.testing.assert_allclose(jax.grad(length)(offset), [-0.6, 0.8], rtol=1e-6)


def turned(start: Any, angle: Any, count: int) -> np.ndarray:
    """float32[count, ...]: headings after 1 to `count` turns."""

    def once(heading: jax.Array, _: None) -> tuple[jax.Array, jax.Array]:
        heading = turn(heading, angle)
        return heading, heading

    start = jnp.asarray(start, jnp.float32)
    return np.asarray(jax.jit(lambda h: jax.lax.scan(once, h, None, length=count)[1])(start))


def angle_between(headings: np.ndarray, others: np.ndarray) -> np.ndarray:
    """The smaller angle between headings in radians."""
    off = np.abs(headings.astype(np.float64) - others)
    return np.minimum(off, 2 * math.pi - off)


@pytest.mark.parametrize("degrees", [15, 45, 90, 22.5, 21.5, 8.8, 7])
@pytest.mark.parametrize("way", [1, -1])
def test_turns_never_drift(degrees: float, way: int) -> None:
    chance = np.random.default_rng(0).uniform(0, 360 * 4000, 200)
    parts = np.append(np.floor(chance), [0, 90 * 4000, 360 * 4000 - 1])
    headings = turned(np.radians(parts / 4000), jnp.float32(way * math.radians(degrees)), 3000)
    assert (headings >= 0).all()
    assert (headings < 2 * np.float32(math.pi)).all()
    counts = np.arange(1, 3001)[:, None]
    true = np.radians((parts / 4000 + way * counts * degrees) % 360)
    # And half of the last bit.
    assert angle_between(headings, true).max() <= DRIFT + 2.4e-7


def test_24000_turns_end_where_they_began() -> None:
    starts = np.random.default_rng(1).uniform(0, 2 * math.pi, 50).astype(np.float32)
    headings = turned(starts, jnp.float32(math.radians(15)), 24_000)
    # A start between two parts of a degree takes the nearer one, at most 2.2e-6 away.
    assert angle_between(headings[-1], starts).max() <= 2.2e-6 + DRIFT
    assert angle_between(headings[-1], headings[23]).max() <= 2 * DRIFT


def test_walk_with_turns_never_drifts() -> None:
    ways = np.random.default_rng(3).choice([-1, 0, 1], 5000).astype(np.float32)
    angle = np.float32(math.radians(15))

    def once(heading: jax.Array, way: jax.Array) -> tuple[jax.Array, jax.Array]:
        heading = turn(heading, way * angle)
        return heading, heading

    headings = np.asarray(jax.lax.scan(once, jnp.float32(0), jnp.asarray(ways))[1])
    true = np.radians((15 * np.cumsum(ways.astype(int))) % 360)
    assert angle_between(headings, true).max() <= DRIFT + 2.4e-7


def test_few_turns_equal_plain_sums() -> None:
    """A few turns give exactly the sum of their angles."""
    angle, heading = np.float32(math.radians(15)), np.float32(0)
    for found in turned(0.0, jnp.float32(angle), 24):
        heading = np.mod(heading + angle, np.float32(2 * math.pi))
        assert found == heading


def test_right_angles_from_the_axes_are_exact() -> None:
    angles = np.float32(np.radians([90, 180, 270, 0]))
    np.testing.assert_array_equal(turned(0.0, jnp.float32(math.pi / 2), 4), angles)


@pytest.mark.parametrize("angle", [0.1, 1.0, -0.3, 0.0, 1e-5])
def test_other_angles_add_up(angle: float) -> None:
    starts = np.random.default_rng(1).uniform(0, 6.28, 500).astype(np.float32)
    wanted = np.mod(starts + np.float32(angle), np.float32(2 * math.pi))
    np.testing.assert_array_equal(jax.jit(turn)(starts, jnp.float32(angle)), wanted)


def test_turns_are_equal_alone_and_in_a_batch() -> None:
    starts = np.random.default_rng(2).uniform(0, 6.28, 40).astype(np.float32)
    angle = jnp.float32(math.radians(15))
    batch = jax.jit(jax.vmap(turn, (0, None)))(starts, angle)
    np.testing.assert_array_equal([jax.jit(turn)(start, angle) for start in starts], batch)
    slopes = jax.jit(jax.vmap(jax.grad(turn, (0, 1)), (0, None)))(starts, angle)
    np.testing.assert_array_equal(slopes, np.ones((2, 40)))
