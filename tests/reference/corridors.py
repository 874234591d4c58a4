"""Check a tile map against the rules of MiniGrid's KeyCorridor.

The grid has three columns of rooms, which share their walls. In rooms of S tiles (walls included),
walls are at multiples of S - 1, so size and number of rows of rooms follow from the map.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from jaxenstein.maps.reach import flood, open_tiles, problems
from jaxenstein.maps.tilemap import Cell, Door, Key, TileMap

STEPS = ((1, 0), (0, 1), (-1, 0), (0, -1))


@dataclass(frozen=True)
class Layout:
    """One layout of KeyCorridor.

    Attributes:
        tilemap: the map.
        start: the agent's tile.
        heading: quarter turns clockwise from east.
    """

    tilemap: TileMap
    start: Cell
    heading: int

    @property
    def pitch(self) -> int:
        """Tiles from one wall to the next: the size of a room minus one."""
        return (self.tilemap.columns - 1) // 3

    @property
    def locked(self) -> Door:
        """The (first) locked door."""
        return next(door for door in self.tilemap.doors if door.locked)

    @property
    def unlocked(self) -> list[Door]:
        """The doors that need no key."""
        return [door for door in self.tilemap.doors if not door.locked]

    def room(self, column: int, row: int) -> Cell:
        """(column, row) of the room of a tile; for a wall, the room to its east or south."""
        return column // self.pitch, row // self.pitch


def from_tilemap(tilemap: TileMap, position: np.ndarray, heading: float) -> Layout:
    """The layout of one of our states.

    Args:
        tilemap: the map of the state.
        position: (x, y) in tiles; must be the centre of a tile.
        heading: radians; must be a whole number of quarter turns.
    """
    column, row = (math.floor(value) for value in position)
    turns = float(heading) / (math.pi / 2)
    off = max(abs(float(position[0]) - column - 0.5), abs(float(position[1]) - row - 0.5))
    if off > 1e-4 or abs(turns - round(turns)) > 1e-4:
        raise ValueError(f"the start {position}, {heading} lies between tiles or quarter turns")
    return Layout(tilemap, (column, row), round(turns) % 4)


def wall_of(layout: Layout, door: Door) -> str:
    """The wall of a door, by column and row of its two rooms: "1,0-2,0"."""
    column, row = layout.room(door.column, door.row)
    before = (column - 1, row) if door.column % layout.pitch == 0 else (column, row - 1)
    return f"{before[0]},{before[1]}-{column},{row}"


def _cell(thing: Key | Door) -> Cell:
    return thing.column, thing.row


def _in_front(layout: Layout) -> Door | None:
    """The door directly in front of the start, if there is one."""
    ahead = tuple(np.add(layout.start, STEPS[layout.heading]).tolist())
    return next((door for door in layout.tilemap.doors if _cell(door) == ahead), None)


def broken_rules(layout: Layout) -> list[str]:
    """The rules of KeyCorridor that a layout breaks."""
    tilemap = layout.tilemap
    locked = [door for door in tilemap.doors if door.locked]
    if [len(locked), len(tilemap.keys), len(tilemap.goals)] != [1, 1, 1]:
        return ["one locked door, one key, one goal"]
    room, key = layout.room(*_cell(locked[0])), tilemap.keys[0]
    everywhere = open_tiles(tilemap)
    found = {
        "walls and hallway": np.array_equal(~everywhere, _solid(layout)),
        "locked door west of a room of the last column": locked[0].column == 2 * layout.pitch,
        "goal in the locked room": layout.room(*tilemap.goals[0]) == room,
        "no other door to the locked room": all(
            "{},{}".format(*room) not in wall_of(layout, door).split("-")
            for door in layout.unlocked
        ),
        "key in the first column": layout.room(*_cell(key))[0] == 0,
        "key in the door's colour": key.colour == locked[0].colour,
        "start in the middle": layout.start in _middle(layout),
        "locked door not in front": _in_front(layout) != layout.locked,
        "all rooms connected": bool(flood(everywhere, [layout.start]).sum() == everywhere.sum()),
        "solvable": tilemap.is_floor(*layout.start)
        and not problems(tilemap.with_spawns([layout.start])),
    }
    return [rule for rule, kept in found.items() if not kept]


def _solid(layout: Layout) -> np.ndarray:
    """bool[rows, columns]: the walls that a layout with these doors must have."""
    row, column = np.indices((layout.tilemap.rows, layout.tilemap.columns))
    pitch = layout.pitch
    solid = (row % pitch == 0) | (column % pitch == 0)
    solid[1:-1, pitch + 1 : 2 * pitch] = False
    for door in layout.tilemap.doors:
        solid[door.row, door.column] = False
    return solid


def _middle(layout: Layout) -> set[Cell]:
    """The tiles where an episode can start: the middle column of rooms, without inner walls."""
    pitch, rows = layout.pitch, (layout.tilemap.rows - 1) // layout.pitch
    top = rows // 2 * pitch
    inner = range(max(top, 1), min(top + pitch, layout.tilemap.rows - 2) + 1)
    return {(column, row) for column in range(pitch + 1, 2 * pitch) for row in inner}
