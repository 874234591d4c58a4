"""MiniWorld's rooms, a tile a metre: where their floor is, where episodes start, where boxes are.

Bodies keep 0.4 m from walls there, boxes half their diagonal, 0.57 m.
"""

from __future__ import annotations

import functools
import math
from typing import Any, NamedTuple

import numpy as np

from ...maps.symbols import DEFAULT_WALL
from ...maps.tilemap import TileMap
from .reach_box import BRICK, Area, BoxRooms

_BODY, _BOX = 0.4, 0.8 * math.sqrt(0.5)


class Rooms(NamedTuple):
    """One of the layouts.

    Attributes:
        floors: rectangles of floor: column, row, columns, rows.
        starts: where episodes start.
        boxes: where the box may be.
        settings: of `BoxRooms`.
        wall: label of the walls.
    """

    floors: tuple[tuple[int, int, int, int], ...]
    starts: tuple[Area, ...]
    boxes: tuple[Area, ...]
    settings: dict[str, Any] = {}  # noqa: RUF012, a tuple's default
    wall: int = DEFAULT_WALL


def _square(side: int) -> Rooms:
    def within(margin: float) -> Area:
        return 1 + margin, 1 + margin, 1 + side - margin, 1 + side - margin

    return Rooms(((1, 1, side, side),), (within(_BODY),), (within(_BOX),))


def _hallway() -> Rooms:
    # What MiniWorld says of the box' and the start's places is meant of their edges.
    starts = (1 + _BODY, 1 + _BODY, 11 + _BODY, 5 - _BODY)
    boxes = (11 - _BOX, 1 + _BOX, 13 - _BOX, 5 - _BOX)
    return Rooms(((1, 1, 12, 4),), (starts,), (boxes,), {"heading": (-45.0, 45.0)})


def _four_rooms() -> Rooms:
    corners = (1, 1), (9, 1), (1, 9), (9, 9)
    # Two metres wide and long: between the upper and the lower rooms, the left and the right ones.
    doors = (7, 3), (7, 11), (3, 7), (11, 7)

    def within(margin: float) -> tuple[Area, ...]:
        rooms = ((x + margin, y + margin, x + 6 - margin, y + 6 - margin) for x, y in corners)
        beside = ((x - margin, y + margin, x + 2 + margin, y + 2 - margin) for x, y in doors[:2])
        above = ((x + margin, y - margin, x + 2 - margin, y + 2 + margin) for x, y in doors[2:])
        return *rooms, *beside, *above

    floors = *((x, y, 6, 6) for x, y in corners), *((x, y, 2, 2) for x, y in doors)
    return Rooms(floors, within(_BODY), within(_BOX))


def _t_maze(*boxes: Area) -> Rooms:
    north = (10 + _BOX, 1 + _BOX, 14 - _BOX, 3 + _BOX)
    south = (10 + _BOX, 15 - _BOX, 14 - _BOX, 17 - _BOX)
    start = (1 + _BODY, 7 + _BODY, 10, 11 - _BODY)
    floors = (10, 1, 4, 16), (1, 7, 9, 4)
    return Rooms(floors, (start,), boxes or (north, south), {"heading": (-45.0, 45.0)})


def _wall_gap() -> Rooms:
    floors = (1, 1, 14, 8), (7, 9, 3, 1), (1, 10, 14, 8)
    starts = (1 + _BODY, 10 + _BODY, 15 - _BODY, 18 - _BODY)
    boxes = (1 + _BOX, 1 + _BOX, 15 - _BOX, 9 - _BOX)
    return Rooms(floors, (starts,), (boxes,), {"outside": True}, BRICK)


def _sidewalk() -> Rooms:
    starts = (1 + _BODY, 10 + _BODY, 4, 11.5 + _BODY)
    boxes = (1 + _BOX, 20 - _BOX, 4, 22 - _BOX)
    settings = {
        "street": (4, 1, 10, 31),
        "cones": tuple((5, 10 + 2 * i) for i in range(1, 6)),
        "outside": True,
    }
    return Rooms(((1, 10, 3, 12), (4, 1, 6, 30)), (starts,), (boxes,), settings, BRICK)


ROOMS = {
    "hallway": _hallway(),
    "one-room": _square(10),
    "one-room-s6": _square(6),
    "one-room-s6-fast": _square(6),
    "four-rooms": _four_rooms(),
    "t-maze": _t_maze(),
    "t-maze-left": _t_maze((12, 3, 12, 3)),
    "t-maze-right": _t_maze((12, 15, 12, 15)),
    "wall-gap": _wall_gap(),
    "sidewalk": _sidewalk(),
}
"""The layouts by the ids of their environments, without the prefix."""


def room(name: str) -> functools.partial[BoxRooms]:
    """One of the rooms, by the name of its environment."""
    rooms = ROOMS[name]
    return functools.partial(
        BoxRooms,
        tilemap=_map_of(name, rooms),
        starts=rooms.starts,
        boxes=rooms.boxes,
        **rooms.settings,
    )


def _map_of(name: str, rooms: Rooms) -> TileMap:
    last = np.max([(c + columns, r + rows) for c, r, columns, rows in rooms.floors], axis=0)
    walls = np.full((last[1] + 1, last[0] + 1), rooms.wall, np.uint8)
    for column, row, columns, rows in rooms.floors:
        walls[row : row + rows, column : column + columns] = 0
    return TileMap(name, tuple(bytes(line) for line in walls))
