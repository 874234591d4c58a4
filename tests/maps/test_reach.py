"""Reach, compared with searches that repeat one step over the map until nothing changes."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from jaxenstein.maps.reach import explore, flood, open_tiles, problems
from jaxenstein.maps.symbols import SYMBOLS
from jaxenstein.maps.tilemap import Door, Key, TileMap


def grown_by_one(reached: np.ndarray, walkable: np.ndarray) -> np.ndarray:
    """The tiles after one more step from every reached tile."""
    grown = np.pad(reached, 1)
    beside = grown[:-2, 1:-1] | grown[2:, 1:-1] | grown[1:-1, :-2] | grown[1:-1, 2:]
    return (reached | beside) & walkable


def brute_flood(walkable: np.ndarray, starts: list[tuple[int, int]]) -> np.ndarray:
    reached = np.zeros(walkable.shape, bool)
    for column, row in starts:
        reached[row, column] = walkable[row, column]
    while (grown := grown_by_one(reached, walkable)).sum() > reached.sum():
        reached = grown
    return reached


def brute_explore(grid: np.ndarray, start: tuple[int, int]) -> np.ndarray:
    """A search over (tiles reached, colours held) on the characters themselves."""
    held: set[str] = set()
    reached = np.zeros(grid.shape, bool)
    reached[start[1], start[0]] = True
    while True:
        before = reached.sum(), len(held)
        walkable = np.isin(grid, [*".SGrb'", *(key.upper() for key in held)])
        reached = grown_by_one(reached, walkable)
        held |= set(grid[reached].tolist()) & {"r", "b"}
        if (reached.sum(), len(held)) == before:
            return reached


def tilemap_of(grid: np.ndarray) -> TileMap:
    """Built without the parser."""
    cells = [((int(c), int(r)), SYMBOLS[str(grid[r, c])]) for r, c in np.ndindex(grid.shape)]
    return TileMap(
        "random",
        tuple(bytes(SYMBOLS[str(mark)].tile for mark in row) for row in grid),
        spawns=tuple(cell for cell, s in cells if s.kind == "spawn"),
        goals=tuple(cell for cell, s in cells if s.kind == "goal"),
        keys=tuple(Key(*cell, s.colour) for cell, s in cells if s.kind == "key"),
        doors=tuple(Door(*cell, s.colour, s.locked) for cell, s in cells if s.kind == "door"),
    )


@st.composite
def grids(draw: st.DrawFn, marks: str) -> np.ndarray:
    rows, columns = draw(st.integers(1, 6)), draw(st.integers(1, 7))
    text = draw(st.text(st.sampled_from(marks), min_size=rows * columns, max_size=rows * columns))
    return np.array(list(text)).reshape(rows, columns)


@settings(deadline=None)
@given(grids("#."), st.data())
def test_flood(grid: np.ndarray, data: st.DataObject) -> None:
    rows, columns = grid.shape
    cell = st.tuples(st.integers(0, columns - 1), st.integers(0, rows - 1))
    starts = data.draw(st.lists(cell, max_size=3))
    walkable = grid == "."
    np.testing.assert_array_equal(flood(walkable, starts), brute_flood(walkable, starts))


def test_flood_from_outside_reaches_nothing() -> None:
    assert not flood(np.ones((2, 2), bool), [(-1, 0), (2, 0), (0, 2)]).any()


@settings(deadline=None)
@given(grids("##...SrbRB'R"), st.data())
def test_explore(grid: np.ndarray, data: st.DataObject) -> None:
    floor = [(int(c), int(r)) for r, c in np.argwhere(np.isin(grid, list(".Srb")))]
    if not floor:
        return
    start = data.draw(st.sampled_from(floor))
    np.testing.assert_array_equal(explore(tilemap_of(grid), start), brute_explore(grid, start))


def stuck_with_open_doors(grid: np.ndarray, tilemap: TileMap) -> set[tuple[int, int]]:
    """Spawns that reach no goal with all doors open, unless no spawn does."""
    masks = {cell: brute_flood(grid != "#", [cell]) for cell in tilemap.spawns}
    stuck = {s for s, mask in masks.items() if not any(mask[g[1], g[0]] for g in tilemap.goals)}
    return stuck if len(stuck) < len(masks) else set()


@settings(deadline=None, max_examples=200)
@given(grids("##..SSGGrRbB'"))
def test_problems_name_exactly_the_unreachable_things(grid: np.ndarray) -> None:
    tilemap = tilemap_of(grid)
    found = problems(tilemap)
    if not tilemap.goals or not tilemap.spawns:
        assert found == []
        return
    masks = {cell: brute_explore(grid, cell) for cell in tilemap.spawns}
    lost = {g for g in tilemap.goals if not any(mask[g[1], g[0]] for mask in masks.values())}
    stuck = {s for s, mask in masks.items() if not any(mask[g[1], g[0]] for g in tilemap.goals)}
    if len(lost) == len(tilemap.goals):
        stuck = stuck_with_open_doors(grid, tilemap)
    assert {cell for _, cell in found} == lost | stuck
    assert len(found) == len(lost | stuck)
    ideal = brute_flood(grid != "#", list(tilemap.spawns))
    hopeless = {g for g in tilemap.goals if not ideal[g[1], g[0]]}
    said = {cell for text, cell in found if "all doors open" in text and cell in tilemap.goals}
    assert said == hopeless


def test_open_tiles() -> None:
    tilemap = tilemap_of(np.array([list("#.R'r")]))
    np.testing.assert_array_equal(open_tiles(tilemap), [[0, 1, 1, 1, 1]])
    np.testing.assert_array_equal(open_tiles(tilemap, locked=False), [[0, 1, 0, 1, 1]])
