"""Which tiles of a map a player can reach, on the host. Paths are 4-connected over open tiles."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from .things import COLOUR_NAMES
from .tilemap import Cell, TileMap

_STEPS = ((1, 0), (-1, 0), (0, 1), (0, -1))
# Groups of spawns that reach the same tiles, with these tiles: bool[rows, columns].
_Groups = list[tuple[np.ndarray, list[Cell]]]


def open_tiles(tilemap: TileMap, *, locked: bool = True) -> np.ndarray:
    """bool[rows, columns], the tiles that are walkable when doors are open.

    Args:
        tilemap: the map.
        locked: whether locked doors are open too.
    """
    walkable = np.array([list(row) for row in tilemap.tiles]) == 0
    for door in tilemap.doors:
        walkable[door.row, door.column] = locked or not door.locked
    return walkable


def flood(walkable: np.ndarray, starts: Iterable[Cell]) -> np.ndarray:
    """bool[rows, columns], the tiles connected to any start.

    Args:
        walkable: bool[rows, columns].
        starts: (column, row) of each start; a start that is not walkable reaches nothing.
    """
    seen = np.zeros(walkable.shape, bool)
    for _ in _walk(walkable, starts, seen):
        pass
    return seen


def walking_distances(walkable: np.ndarray, goals: tuple[Cell, ...]) -> np.ndarray:
    """int32[goals, rows, columns]: walking distance in tiles to each goal; -1 without a path."""
    steps = np.full((len(goals), *walkable.shape), -1, np.int32)
    columns, rows = np.array(goals).reshape(-1, 2).T
    front = np.zeros(steps.shape, bool)
    front[np.arange(len(goals)), rows, columns] = True
    time = 0
    while front.any():
        steps[front] = time
        wide = np.pad(front, ((0, 0), (1, 1), (1, 1)))
        spread = wide[:, 2:, 1:-1] | wide[:, :-2, 1:-1] | wide[:, 1:-1, 2:] | wide[:, 1:-1, :-2]
        front = spread & walkable[None] & (steps < 0)
        time += 1
    return steps


def explore(tilemap: TileMap, start: Cell) -> np.ndarray:
    """bool[rows, columns], the tiles that a player who uses every key can reach from a start.

    A locked door opens once a key of its colour has been reached; a key opens any number of doors.
    """
    walkable = open_tiles(tilemap, locked=False)
    seen = np.zeros(walkable.shape, bool)
    keys = {(key.column, key.row): key.colour for key in tilemap.keys}
    shut = [door for door in tilemap.doors if door.locked]
    held: set[int] = set()
    starts = [start]
    while starts:
        held.update(keys[cell] for cell in _walk(walkable, starts, seen) if cell in keys)
        opened = [(door.column, door.row) for door in shut if door.colour in held]
        shut = [door for door in shut if door.colour not in held]
        for column, row in opened:
            walkable[row, column] = True
        # A door that opens elsewhere is found later, as an open tile.
        starts = [cell for cell in opened if _touches(seen, cell)]
    return seen


def problems(tilemap: TileMap) -> list[tuple[str, Cell]]:
    """Unreachable goals, and spawns that reach no goal, as (problem, cell).

    Empty for a map without goals.
    """
    if not tilemap.goals or not tilemap.spawns:
        return []
    numbers = _numbered(open_tiles(tilemap))
    groups = [
        (numbers == number, spawns) for number, spawns in _by_number(tilemap, numbers).items()
    ]
    goals, spawns = _unreached(tilemap, groups)
    found = [("no path reaches this goal, even with all doors open", goal) for goal in goals]
    found += [("no path from here reaches a goal, even with all doors open", s) for s in spawns]
    if any(door.locked for door in tilemap.doors):
        found += _key_problems(tilemap, {cell for _, cell in found})
    return found


def summarised(found: Sequence[tuple[str, Cell]]) -> list[tuple[str, Cell]]:
    """The first problem of each kind, with the number of others."""
    cells: dict[str, list[Cell]] = {}
    for problem, cell in found:
        cells.setdefault(problem, []).append(cell)
    return [
        (problem + f"; the same for {len(places) - 1} more" * (len(places) > 1), places[0])
        for problem, places in cells.items()
    ]


def _key_problems(tilemap: TileMap, known: set[Cell]) -> list[tuple[str, Cell]]:
    """Problems that only arise because locked doors need keys, without the cells in `known`."""
    numbers = _numbered(open_tiles(tilemap, locked=False))
    groups = [
        (explore(tilemap, spawns[0]), spawns) for spawns in _by_number(tilemap, numbers).values()
    ]
    reached = np.logical_or.reduce([mask for mask, _ in groups])
    shut = {
        COLOUR_NAMES[door.colour]
        for door in tilemap.doors
        if not reached[door.row, door.column] and _touches(reached, (door.column, door.row))
    }
    keys = f"a key that cannot be reached ({', '.join(sorted(shut))})" if shut else "a missing key"
    goals, spawns = _unreached(tilemap, groups)
    goal_text = f"paths to this goal need {keys}"
    spawn_text = f"paths from here to a goal need {keys}"
    found = [(goal_text, goal) for goal in goals] + [(spawn_text, spawn) for spawn in spawns]
    return [(text, cell) for text, cell in found if cell not in known]


def _unreached(tilemap: TileMap, groups: _Groups) -> tuple[list[Cell], list[Cell]]:
    """The goals that no spawn reaches, and the spawns that reach no goal.

    If no spawn reaches any goal, only the goals are returned.
    """
    column, row = np.array(tilemap.goals).T
    reaches = [mask[row, column] for mask, _ in groups]
    reached = np.logical_or.reduce(reaches)
    goals = [goal for goal, some in zip(tilemap.goals, reached, strict=True) if not some]
    if len(goals) == len(tilemap.goals):
        return goals, []
    lost = zip(reaches, groups, strict=True)
    return goals, [spawn for reach, (_, spawns) in lost if not reach.any() for spawn in spawns]


def _by_number(tilemap: TileMap, numbers: np.ndarray) -> dict[int, list[Cell]]:
    """The spawns of each connected component."""
    parts: dict[int, list[Cell]] = {}
    for column, row in tilemap.spawns:
        parts.setdefault(int(numbers[row, column]), []).append((column, row))
    return parts


def _numbered(walkable: np.ndarray) -> np.ndarray:
    """int32[rows, columns], the connected component of each tile; -1 where not walkable."""
    numbers = np.full(walkable.shape, -1, np.int32)
    seen = np.zeros(walkable.shape, bool)
    for number, (row, column) in enumerate(np.argwhere(walkable).tolist()):
        for reached_column, reached_row in _walk(walkable, [(column, row)], seen):
            numbers[reached_row, reached_column] = number
    return numbers


def _walk(walkable: np.ndarray, starts: Iterable[Cell], seen: np.ndarray) -> Iterator[Cell]:
    """Yield each tile that paths from the starts newly reach, and mark it in `seen`."""
    rows, columns = walkable.shape
    pending = list(starts)
    while pending:
        column, row = pending.pop()
        inside = 0 <= column < columns and 0 <= row < rows
        if not inside or seen[row, column] or not walkable[row, column]:
            continue
        seen[row, column] = True
        yield column, row
        pending += [(column + dx, row + dy) for dx, dy in _STEPS]


def _touches(seen: np.ndarray, cell: Cell) -> bool:
    """Whether a neighbour of the cell has been seen."""
    rows, columns = seen.shape
    beside = [(cell[0] + dx, cell[1] + dy) for dx, dy in _STEPS]
    return any(seen[r, c] for c, r in beside if 0 <= c < columns and 0 <= r < rows)
