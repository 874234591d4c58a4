"""Random mazes: rules by search on the host, and straightening against a slow implementation."""

import functools

import jax
import numpy as np
import pytest

from fidelity.labmaze_layouts import PLANS, broken_rules, observe
from jaxenstein.errors import SettingError
from jaxenstein.tasks.maze_ways import straighten
from jaxenstein.tasks.random_maze import MazePlan, _rectangles, sample_in_rooms, sample_maze

SMALL, LARGE = MazePlan(11, 6, fewest=4), PLANS["memory-15"]


@functools.cache
def drawn(plan, count):
    def draw(key):
        maze = sample_maze(key, plan)
        bits = jax.random.bits(key, (plan.size**2,), "uint32")
        return maze, sample_in_rooms(bits, maze, plan.rooms, 3)

    keys = jax.random.split(jax.random.key(3), count)
    return jax.device_get(jax.jit(jax.vmap(draw))(keys))


def check(plan, count):
    mazes, cells = drawn(plan, count)
    for i in range(count):
        maze = mazes.open[i], mazes.room[i]
        assert broken_rules(maze, plan) == []
        assert observe(maze)["dead ends"] == ["0"]
        assert mazes.room[i].max() == mazes.rooms[i] >= plan.fewest
        doorway = mazes.doorways[i]
        assert (mazes.open[i] & ~mazes.room[i].astype(bool))[doorway].all()
        # A doorway has a wall on two opposite sides and a way on the two others.
        for row, column in np.argwhere(doorway):
            sides = mazes.open[i][
                [row - 1, row + 1, row, row], [column, column, column - 1, column + 1]
            ]
            assert sides.tolist() in ([True, True, False, False], [False, False, True, True])
        for number in range(1, mazes.rooms[i] + 1):
            columns, rows = cells[i, number - 1].T
            assert (mazes.room[i][rows, columns] == number).all()
            assert len(set(zip(rows, columns, strict=True))) == 3


@pytest.mark.parametrize("plan", [SMALL, LARGE], ids=["11", "17"])
def test_mazes_keep_the_rules(plan):
    check(plan, 256)


@pytest.mark.slow
@pytest.mark.parametrize("plan", [SMALL, LARGE], ids=["11", "17"])
def test_thousands_of_mazes_keep_the_rules(plan):
    check(plan, 4096)


def test_rectangles_have_the_probabilities_of_the_original():
    """Against the rule in words: draw a short side, then lengthen one of the two."""
    plan = MazePlan(15, 6)
    masks, weights = _rectangles(plan)
    rng = np.random.default_rng(0)
    counts = dict.fromkeys((mask.tobytes() for mask in masks), 0)
    draws = 40_000
    for _ in range(draws):
        height, width = 1, 1
        more = rng.integers(0, 2)
        height, width = (height + more, width) if rng.random() < 0.5 else (height, width + more)
        row, column = rng.integers(0, 7 - height), rng.integers(0, 7 - width)
        mask = np.zeros((7, 7), bool)
        mask[row : row + height + 1, column : column + width + 1] = True
        counts[mask.tobytes()] += 1
    expected = draws * weights / weights.sum()
    got = np.array(list(counts.values()))
    assert ((got - expected) ** 2 / expected).sum() < len(masks) + 5 * np.sqrt(2 * len(masks))


def straightened_step_by_step(corridor, wall):
    """The rule step by step, one cell after another."""
    corridor, wall = corridor.copy(), wall.copy()
    size, bend = len(corridor), 1
    while bend + 3 < size:
        removed = any(
            pulled_straight(corridor, wall, (r, c), bend) for r in range(size) for c in range(size)
        )
        bend = 1 if removed and bend != 1 else bend + 1
    return corridor


def pulled_straight(corridor, wall, place, bend):
    """Whether a detour begins at a place; it is pulled as far as it goes."""
    found = False
    while way := next(
        (v for v in ((1, 0), (-1, 0), (0, 1), (0, -1)) if fits(corridor, wall, place, bend, v)),
        None,
    ):
        for along in range(-1, bend + 1):
            above = at(place, along, 1, way)
            corridor[above], wall[above] = False, True
            if 0 <= along < bend:
                here = at(place, along, 0, way)
                corridor[here], wall[here] = True, False
        place, found = at(place, 0, -1, way), True
    return found


def at(place, along, up, way):
    return place[0] + along * way[1] + up * way[0], place[1] - along * way[0] + up * way[1]


def fits(corridor, wall, place, bend, way):
    def all_of(grid, cells):
        places = [at(place, along, up, way) for along, up in cells]
        return all(0 <= r < len(grid) and 0 <= c < len(grid) and grid[r, c] for r, c in places)

    inner, outer = range(bend), range(-1, bend + 1)
    walls = [(u, 0) for u in inner] + [(u, -1) for u in inner] + [(u, 2) for u in outer]
    ways = [(u, 1) for u in outer] + [(-1, 0), (bend, 0)]
    return all_of(wall, [*walls, (-2, 1), (bend + 1, 1)]) and all_of(corridor, ways)


def test_straightening_matches_the_slow_rule():
    """On loops, trees and noise, with doorways that are neither corridor nor wall."""
    rng = np.random.default_rng(1)
    grids, stones = [], []
    for number in range(60):
        lattice = np.zeros((13, 13), bool)
        lattice[1:-1, 1:-1] = rng.random((11, 11)) < 0.5
        lattice[2::2, 2::2] = False
        lattice[1:-1:2, 1:-1:2] = rng.random((6, 6)) < (0.8 if number % 2 else 0.95)
        doors = ~lattice & (rng.random((13, 13)) < 0.02)
        doors[[0, -1]] = doors[:, [0, -1]] = False
        grids.append(lattice)
        stones.append(~lattice & ~doors)
    mine = np.asarray(jax.jit(jax.vmap(straighten))(np.stack(grids), np.stack(stones)))
    slow = np.stack([straightened_step_by_step(g, s) for g, s in zip(grids, stones, strict=True)])
    np.testing.assert_array_equal(mine, slow)
    assert (slow != np.stack(grids)).any(axis=(1, 2)).sum() > 10


def test_weights_of_large_plans_do_not_overflow():
    """Draws from a sum above 2**24 are rounded, and from 2**31 on the sum itself wraps."""
    masks, weights = _rectangles(MazePlan(31, 9, 3, 9))
    assert weights.min() > 0
    assert weights.sum(dtype=np.int64) < 2**24
    shares = {}
    for mask, weight in zip(masks, weights, strict=True):
        shape = tuple(np.ptp(np.argwhere(mask), axis=0).tolist())
        shares[shape] = shares.get(shape, 0) + weight / weights.sum()
    # Both sides are drawn from two lengths, and one of them is extended by one of three lengths.
    assert shares[1, 1] == pytest.approx(1 / 4 / 3, rel=1e-3)


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ((10, 4), "must be odd"),
        ((11, 4, 5, 3), "least <= most"),
        ((11, 4, 3, 11), "size - 2"),
        ((11, 4, 3, 5, 5), "fewest must be a whole number from 1 to 4"),
    ],
)
def test_impossible_plans_are_refused(numbers, message):
    with pytest.raises(SettingError, match=message):
        MazePlan(*numbers)
