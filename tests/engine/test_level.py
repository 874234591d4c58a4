"""Levels: packing, occupancy and solidity against plain loops."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given

from jaxenstein.engine.level import compile_level, is_solid, level_from_walls, occupancy, pack_bits
from tests.reference.raycaster import solid_tiles
from tests.reference.search import SEEDS, search_settings
from tests.reference.worlds import draw_world

SHAPES = [(1, 1), (3, 3), (5, 31), (4, 32), (7, 33), (33, 64), (70, 65), (2, 130)]


def unpack(words: np.ndarray, line: int, place: int) -> bool:
    """Bit `place` of a line of words, by integer arithmetic."""
    return bool(int(words[line, place // 32]) // 2 ** (place % 32) % 2)


@pytest.mark.parametrize("shape", SHAPES)
def test_pack_bits(shape: tuple[int, int]) -> None:
    packed = jax.jit(pack_bits)

    @search_settings(5)
    @given(seed=SEEDS)
    def check(seed: int) -> None:
        bits = np.random.default_rng(seed).random(shape) < 0.5
        lines, length = shape
        words = -(-length // 32)
        on_host, on_device = pack_bits(bits), np.asarray(packed(jnp.asarray(bits)))
        assert isinstance(on_host, np.ndarray)
        assert on_host.dtype == on_device.dtype == np.uint32
        assert on_host.shape == (lines, words)
        np.testing.assert_array_equal(on_host, on_device)
        for line in range(lines):
            expected = [*bits[line], *[True] * (words * 32 - length)]
            assert [unpack(on_host, line, i) for i in range(words * 32)] == expected

    check()


@pytest.mark.parametrize("bordered", [True, False])
@pytest.mark.parametrize("shape", [(3, 3), (9, 12), (33, 70)])
def test_occupancy_and_solidity(shape: tuple[int, int], bordered: bool) -> None:
    """Words and `is_solid` against the map, with doors, and around it."""

    @jax.jit
    def solidity(level, closed, columns, rows):
        return jax.vmap(lambda c, r: is_solid(level, closed, c, r))(columns, rows)

    words = jax.jit(occupancy)

    @search_settings(8)
    @given(seed=SEEDS)
    def check(seed: int) -> None:
        world = draw_world(seed, shape, bordered=bordered, poses=1)
        level = compile_level(world.walls, world.doors)
        rows, columns = np.mgrid[-3 : shape[0] + 3, -3 : shape[1] + 3].astype(np.int32)
        wanted = np.pad(world.solid, 3, constant_values=True)
        got = solidity(level, world.closed, columns.ravel(), rows.ravel())
        np.testing.assert_array_equal(np.asarray(got).reshape(wanted.shape), wanted)

        by_column, by_row = (np.asarray(w) for w in words(level, world.closed))
        margin = level.margin
        assert level.size == (shape[1] + 2 * margin, shape[0] + 2 * margin)
        around = np.pad(world.solid, margin, constant_values=True)
        for row, column in np.ndindex(*around.shape):
            assert unpack(by_column, column, row) == around[row, column]
            assert unpack(by_row, row, column) == around[row, column]

    check()


@pytest.mark.parametrize("shape", [(5, 6), (33, 40)])
def test_levels_built_in_a_program_equal_compiled_ones(shape: tuple[int, int]) -> None:
    """Field by field, for a batch of maps at once."""
    build = jax.jit(jax.vmap(level_from_walls))

    @search_settings(5)
    @given(seed=SEEDS)
    def check(seed: int) -> None:
        worlds = [draw_world(seed + i, shape, bordered=True, poses=1) for i in range(3)]
        walls = np.stack([world.walls for world in worlds])
        doors = np.stack([world.doors for world in worlds])
        together = build(walls, doors)
        for i, world in enumerate(worlds):
            alone = compile_level(world.walls, world.doors)
            mine = jax.tree.map(lambda leaf, i=i: np.asarray(leaf[i]), together)
            assert jax.tree.structure(alone) == jax.tree.structure(mine)
            for one, other in zip(jax.tree.leaves(alone), jax.tree.leaves(mine), strict=True):
                assert one.dtype == other.dtype
                np.testing.assert_array_equal(one, other)

    check()


def test_closed_border_needs_no_margin() -> None:
    none = np.zeros((0, 2), np.int32)
    walls = np.full((4, 5), 3, np.uint8)
    walls[1:-1, 1:-1] = 0
    assert compile_level(walls, none).margin == 0
    assert compile_level(np.stack([walls] * 4), none).margin == 0
    for row, column in ((0, 2), (3, 2), (1, 0), (1, 4)):
        walls[row, column] = 0
        assert compile_level(walls, none).margin == 1
        walls[row, column] = 3
    walls[0, 2] = 30
    assert compile_level(walls, np.array([(2, 0)], np.int32)).margin == 1


def test_outside_looks_like_a_wall() -> None:
    """The outside must not have the id of the ceiling (0) or the floor (1)."""
    level = compile_level(np.zeros((2, 3), np.uint8), np.zeros((0, 2), np.int32))
    ring = np.asarray(level.walls)[0]
    assert (ring[[0, -1]] >= 2).all()
    assert (ring[:, [0, -1]] >= 2).all()


@pytest.mark.parametrize(("present", "absent"), [(1, 0), (1, 3), (4, 1), (4, 3)])
def test_several_absent_doors_leave_no_trace(present: int, absent: int) -> None:
    walls = np.full((7, 8), 2, np.uint8)
    walls[1:-1, 1:-1] = 0
    real = [(2, 2), (3, 4), (6, 5), (1, 1)][:present]
    for column, row in real:
        walls[row, column] = 30
    doors = np.array(real + [(0, 0)] * absent, np.int32)
    for closed in (np.zeros(len(doors), bool), np.ones(len(doors), bool)):
        level = level_from_walls(jnp.asarray(walls), jnp.asarray(doors))
        by_column, by_row = (np.asarray(w) for w in occupancy(level, jnp.asarray(closed)))
        expected = solid_tiles(walls, np.array(real), closed[:present])
        for row, column in np.ndindex(*walls.shape):
            assert unpack(by_column, column, row) == expected[row, column]
            assert unpack(by_row, row, column) == expected[row, column]
