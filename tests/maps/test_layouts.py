"""The maps that come with the package."""

from __future__ import annotations

import numpy as np
import pytest

from jaxenstein.errors import MapError
from jaxenstein.maps import TileMap, layout_names, load_layout
from jaxenstein.maps.reach import flood, open_tiles
from jaxenstein.maps.symbols import DECAL_LABELS, SYMBOLS

# Map units of the scenario's sectors 0 to 7, its rooms: lowest and highest x, then y.
ROOMS = (
    (160, 320, -256, -96),
    (384, 544, -256, -96),
    (384, 544, -32, 128),
    (608, 768, -256, -96),
    (608, 768, -32, 128),
    (384, 544, -544, -384),
    (960, 1120, -32, 128),
    (960, 1120, -256, -96),
)
# The scenario's map spots 10 to 26, its starts.
SPOTS = (
    (240, -176),
    (464, -176),
    (470.331, -321.672),
    (466.983, -466.749),
    (460.326, -596.12),
    (543.986, -672.089),
    (575.372, -171.77),
    (686.83, -173.247),
    (686.646, -62.382),
    (464.098, -60.496),
    (460.326, 56.436),
    (571.6, 54.55),
    (694.19, 58.322),
    (871.474, 54.55),
    (1043.1, 60.208),
    (1039.737, -61.676),
    (1039.328, -169.884),
)
BRICK = SYMBOLS["9"].label
# Of the mazes of DeepMind Lab, as counted in its files: cells along and across, starts, apples,
# decals, corners between cells without any wall, and mean and greatest distance from start to goal.
MAZES = {
    "dmlab-static-01": (10, 5, 43, 5, 14, 2, 20.4, 36),
    "dmlab-static-02": (15, 9, 128, 13, 35, 19, 35.0, 55),
    "dmlab-static-03": (20, 13, 251, 26, 61, 44, 23.1, 45),
    "dmlab-random-goal-01": (10, 5, 1, 50, 14, 5, None, None),
    "dmlab-random-goal-02": (15, 9, 1, 135, 33, 23, None, None),
    "dmlab-random-goal-03": (20, 13, 1, 260, 54, 74, None, None),
}
GOALS = {"dmlab-static-01": (4, 0), "dmlab-static-02": (14, 4), "dmlab-static-03": (9, 12)}
# Cells at least 5 cells from the goal, in the mean over all goals, and their mean distance, and
# the greatest distance of two cells.
RANDOM_GOALS = {
    "dmlab-random-goal-01": (39, 14.2, 33),
    "dmlab-random-goal-02": (121, 19.7, 43),
    "dmlab-random-goal-03": (244, 32.4, 80),
}


def tile_of(x: float, y: float) -> tuple[int, int]:
    return int((x - 160) // 32 + 1), int((128 - y) // 32 + 1)


def test_layout_names() -> None:
    assert layout_names() == (*sorted(MAZES), "key-door", "my-way-home", "simple", "t-maze")
    with pytest.raises(MapError, match="did you mean 'simple'"):
        load_layout("simpel")
    with pytest.raises(MapError, match="unknown layout"):
        load_layout("../ascii")
    with pytest.raises(MapError, match="unknown layout"):
        load_layout("my-way-home.regions")
    with pytest.raises(MapError, match="unknown layout"):
        load_layout("dmlab-static-01.faces")


def test_my_way_home_matches_the_scenario_map() -> None:
    tilemap = load_layout("my-way-home")
    floor = open_tiles(tilemap)
    assert floor.sum() == 275
    assert len(tilemap.spawns) == 17
    assert set(tilemap.spawns) == {tile_of(x, y) for x, y in SPOTS}
    assert tilemap.goals == (tile_of(1040, -352),)
    np.testing.assert_array_equal(flood(floor, tilemap.goals), floor)


def test_my_way_home_rooms_have_their_own_walls() -> None:
    tilemap = load_layout("my-way-home")
    assert tilemap.faces is not None
    colours = np.full((tilemap.rows, tilemap.columns), BRICK)
    for room, (west, east, south, north) in enumerate(ROOMS):
        left, top = tile_of(west, north)
        right, bottom = tile_of(east, south)
        assert open_tiles(tilemap)[top:bottom, left:right].all()
        colours[top:bottom, left:right] = SYMBOLS[str(room + 1)].label
    seen: dict[int, int] = {}
    for row, column in np.argwhere(open_tiles(tilemap)):
        # The wall to the west is seen from its east face, and so on.
        for face, dx, dy in ((1, -1, 0), (0, 1, 0), (3, 0, -1), (2, 0, 1)):
            shown = tilemap.faces[face][row + dy][column + dx]
            if shown:
                assert shown == colours[row, column], (column, row)
                seen[shown] = seen.get(shown, 0) + 1
    assert sorted(seen) == [*(SYMBOLS[str(room)].label for room in range(1, 9)), BRICK]


def test_my_way_home_without_colours_is_the_same_map() -> None:
    plain = load_layout("my-way-home", regions=False)
    painted = load_layout("my-way-home")
    assert plain.faces is None
    assert set(np.unique(plain.walls)) == {0, 2}
    assert (plain.tiles, plain.spawns, plain.goals) == (
        painted.tiles,
        painted.spawns,
        painted.goals,
    )


def cells_of(tilemap: TileMap) -> list[tuple[int, int]]:
    return [(c, r) for r in range(1, tilemap.rows, 2) for c in range(1, tilemap.columns, 2)]


def distances(tilemap: TileMap, start: tuple[int, int]) -> dict[tuple[int, int], float]:
    """Distances in cells, of two tiles each, from a start to every reachable cell."""
    reached, front, steps = {start: 0.0}, [start], 0.0
    while front:
        steps += 0.5
        beside = [(c + x, r + y) for c, r in front for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1))]
        front = [tile for tile in dict.fromkeys(beside) if tilemap.is_floor(*tile)]
        front = [tile for tile in front if tile not in reached]
        reached |= dict.fromkeys(front, steps)
    return {cell: reached[cell] for cell in cells_of(tilemap)}


@pytest.mark.parametrize("name", MAZES)
def test_mazes_match_their_files(name: str) -> None:
    columns, rows, starts, apples, decals, free_corners, *_ = MAZES[name]
    tilemap = load_layout(name, goal_required=False)
    assert (tilemap.columns, tilemap.rows) == (2 * columns + 1, 2 * rows + 1)
    assert (len(tilemap.spawns), len(tilemap.apples)) == (starts, apples)
    floor = open_tiles(tilemap)
    assert floor[1::2, 1::2].all()
    assert floor[::2, ::2].sum() == free_corners
    np.testing.assert_array_equal(flood(floor, tilemap.spawns[:1]), floor)
    shown, counts = np.unique(tilemap.walls[tilemap.walls != 0], return_counts=True)
    drawn = {label: n for label, n in zip(shown, counts, strict=True) if label in DECAL_LABELS}
    assert drawn == dict.fromkeys(DECAL_LABELS[:decals], 1)


@pytest.mark.parametrize("name", MAZES)
def test_decals_face_floor(name: str) -> None:
    tilemap = load_layout(name, goal_required=False)
    beside = ((-1, 0), (1, 0), (0, -1), (0, 1))
    for face, row, column in np.argwhere(np.isin(tilemap.walls, DECAL_LABELS)):
        dx, dy = beside[face]
        cell = int(column) + dx, int(row) + dy
        assert tilemap.is_floor(*cell)
        assert cell in cells_of(tilemap)
        assert (tilemap.tiles[row][column]) in DECAL_LABELS


@pytest.mark.parametrize("name", GOALS)
def test_static_mazes_start_at_least_five_cells_from_the_goal(name: str) -> None:
    *_, mean, greatest = MAZES[name]
    tilemap = load_layout(name)
    column, row = GOALS[name]
    (goal,) = tilemap.goals
    assert goal == (2 * column + 1, tilemap.rows - 2 - 2 * row)
    away = distances(tilemap, goal)
    assert set(tilemap.spawns) == {cell for cell, distance in away.items() if distance >= 5}
    walked = [away[cell] for cell in tilemap.spawns]
    assert round(float(np.mean(walked)), 1) == mean
    assert max(walked) == greatest


@pytest.mark.parametrize("name", RANDOM_GOALS)
def test_random_goal_mazes_have_candidates_everywhere(name: str) -> None:
    tilemap = load_layout(name, goal_required=False)
    assert tilemap.goals == ()
    assert set(tilemap.apples) == set(cells_of(tilemap))
    assert set(tilemap.spawns) <= set(tilemap.apples)
    far = [[d for d in distances(tilemap, goal).values() if d >= 5] for goal in tilemap.apples]
    starts, mean, greatest = RANDOM_GOALS[name]
    assert round(float(np.mean([len(ways) for ways in far]))) == starts
    assert round(float(np.mean([np.mean(ways) for ways in far])), 1) == mean
    assert max(map(max, far)) == greatest
