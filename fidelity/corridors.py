"""KeyCorridor layouts in one plain form, from MiniGrid or from a tile map, and what they show.

The grid is 3 columns of rooms wide; rooms share their walls. With rooms of S tiles (walls
included) the walls stand on the multiples of S - 1, so size and number of room rows follow from
the map. Facts of MiniGrid 3.2.0 (Apache 2.0): `Grid.encode` gives [columns, rows, 3] numbers:
object (1 empty, 2 wall, 4 door, 5 key, 6 ball), colour (0 to 5: red, green, blue, purple,
yellow, grey) and, for doors, 0 open, 1 closed, 2 locked; `agent_dir` counts quarter turns
clockwise from east.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from jaxenstein.maps.reach import flood, open_tiles, problems, walking_distances
from jaxenstein.maps.symbols import DEFAULT_WALL, door_label
from jaxenstein.maps.things import COLOUR_NAMES
from jaxenstein.maps.tilemap import Cell, Door, Key, TileMap

STEPS = ((1, 0), (0, 1), (-1, 0), (0, -1))
HEADINGS = ("east", "south", "west", "north")
_WALL, _DOOR, _KEY, _BALL = 2, 4, 5, 6
_CLOSED, _LOCKED = 1, 2


@dataclass(frozen=True)
class Layout:
    """One layout of KeyCorridor.

    Attributes:
        tilemap: the map, with the goal where MiniGrid has the ball.
        start: the agent's tile.
        heading: quarter turns clockwise from east.
    """

    tilemap: TileMap
    start: Cell
    heading: int

    @property
    def pitch(self) -> int:
        """Tiles from one wall to the next: the room size less one."""
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
        """(column, row) of the room of a tile; of a wall's tile, the room east or south of it."""
        return column // self.pitch, row // self.pitch

    def place(self, column: int, row: int) -> Cell:
        """A tile within its room, from 0; -1 on the room's western or northern wall."""
        return column % self.pitch - 1, row % self.pitch - 1


def from_minigrid(env: Any) -> Layout:
    """The layout of a KeyCorridor environment that has been reset."""
    env = env.unwrapped
    codes = env.grid.encode().astype(int).transpose(1, 0, 2)
    tiles = np.where(codes[..., 0] == _WALL, DEFAULT_WALL, 0)
    keys, doors, goals = [], [], []
    for row, column in np.argwhere(codes[..., 0] > _WALL).tolist():
        kind, colour, state = codes[row, column].tolist()
        if kind == _DOOR and state in (_CLOSED, _LOCKED):
            doors.append(Door(column, row, colour, state == _LOCKED))
            tiles[row, column] = door_label(colour, state == _LOCKED)
        elif kind == _KEY:
            keys.append(Key(column, row, colour))
        elif kind == _BALL:
            goals.append((column, row))
        else:
            raise ValueError(f"KeyCorridor has no object {kind} in state {state}")
    start = (int(env.agent_pos[0]), int(env.agent_pos[1]))
    tilemap = TileMap(
        "MiniGrid",
        tuple(bytes(line) for line in tiles.tolist()),
        spawns=(start,),
        goals=tuple(goals),
        keys=tuple(keys),
        doors=tuple(doors),
    )
    return Layout(tilemap, start, int(env.agent_dir))


def from_tilemap(tilemap: TileMap, position: np.ndarray, heading: float) -> Layout:
    """The layout of one of our states.

    Args:
        tilemap: its map.
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
    """The wall a door stands in, by its rooms: "1,0-2,0", column and row of each."""
    column, row = layout.room(door.column, door.row)
    before = (column - 1, row) if door.column % layout.pitch == 0 else (column, row - 1)
    return f"{before[0]},{before[1]}-{column},{row}"


def is_north_south(layout: Layout, door: Door) -> bool:
    """Whether a door joins two rooms of one column."""
    return door.row % layout.pitch == 0


def observe(layout: Layout) -> dict[str, list[str]]:
    """What a layout shows: for each table, the categories that it adds one to."""
    key, goal, locked = layout.tilemap.keys[0], layout.tilemap.goals[0], layout.locked
    unlocked = layout.unlocked
    walls = sorted(wall_of(layout, door) for door in unlocked)
    locked_row, key_row = layout.room(locked.column, locked.row)[1], layout.room(*_cell(key))[1]
    heading = HEADINGS[layout.heading]
    start = f"{layout.start[0]},{layout.start[1]}"
    upright = [door for door in unlocked if is_north_south(layout, door)]
    level = [door for door in unlocked if not is_north_south(layout, door)]
    return {
        "unlocked doors": [str(len(unlocked))],
        "of them between rows": [str(len(upright))],
        "unlocked doors by wall": walls,
        "western doors together": [" ".join(wall for wall in walls if wall.startswith("0"))],
        "eastern doors together": [
            " ".join([f"locked {locked_row}:", *(wall for wall in walls if "2," in wall)])
        ],
        "locked row": [str(locked_row)],
        "key row": [str(key_row)],
        "locked row, key row": [f"{locked_row},{key_row}"],
        "locked colour": [COLOUR_NAMES[locked.colour]],
        "unlocked colours": [COLOUR_NAMES[door.colour] for door in unlocked],
        "unlocked in the locked colour": [str(sum(d.colour == locked.colour for d in unlocked))],
        "locked door's place": [str(layout.place(*_cell(locked))[1])],
        "places of doors between columns": [str(layout.place(*_cell(door))[1]) for door in level],
        "places of doors between rows": [str(layout.place(*_cell(door))[0]) for door in upright],
        "key in its room": ["{},{}".format(*layout.place(*_cell(key)))],
        "goal in its room": ["{},{}".format(*layout.place(*goal))],
        "start": [start],
        "heading": [heading],
        "start, heading, locked row": [f"{start} {heading} {locked_row}"],
        "beside the locked door": [_beside(layout)],
        "in front": [_in_front(layout)],
        "steps by way of the key": [str(_steps(layout))],
    }


def _cell(thing: Key | Door) -> Cell:
    return thing.column, thing.row


def _beside(layout: Layout) -> str:
    """The heading if the start is the tile west of the locked door."""
    west = (layout.locked.column - 1, layout.locked.row)
    return HEADINGS[layout.heading] if layout.start == west else "no"


def _in_front(layout: Layout) -> str:
    column, row = np.add(layout.start, STEPS[layout.heading]).tolist()
    here = [door for door in layout.tilemap.doors if _cell(door) == (column, row)]
    if here:
        return "locked door" if here[0].locked else "unlocked door"
    return "floor" if layout.tilemap.is_floor(column, row) else "wall"


def _steps(layout: Layout) -> int:
    """Moves of the shortest way from start to key and on to the goal; -1 if there is none."""
    (key,), (goal,) = layout.tilemap.keys, layout.tilemap.goals
    to_key = walking_distances(open_tiles(layout.tilemap, locked=False), (_cell(key),))[0]
    to_goal = walking_distances(open_tiles(layout.tilemap), (goal,))[0]
    first, second = int(to_key[layout.start[::-1]]), int(to_goal[_cell(key)[::-1]])
    return first + second if min(first, second) >= 0 else -1


def broken_rules(layout: Layout) -> list[str]:
    """Rules of KeyCorridor that a layout breaks: none, of a right one."""
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
        "locked door not in front": _in_front(layout) != "locked door",
        "all rooms connected": bool(flood(everywhere, [layout.start]).sum() == everywhere.sum()),
        "solvable": tilemap.is_floor(*layout.start)
        and not problems(tilemap.with_spawns([layout.start])),
    }
    return [rule for rule, kept in found.items() if not kept]


def _solid(layout: Layout) -> np.ndarray:
    """bool[rows, columns], the walls that a layout with these doors must have."""
    row, column = np.indices((layout.tilemap.rows, layout.tilemap.columns))
    pitch = layout.pitch
    solid = (row % pitch == 0) | (column % pitch == 0)
    solid[1:-1, pitch + 1 : 2 * pitch] = False
    for door in layout.tilemap.doors:
        solid[door.row, door.column] = False
    return solid


def _middle(layout: Layout) -> set[Cell]:
    """Where an episode may start: the floor of the middle room, with the walls taken away."""
    pitch, rows = layout.pitch, (layout.tilemap.rows - 1) // layout.pitch
    top = rows // 2 * pitch
    inner = range(max(top, 1), min(top + pitch, layout.tilemap.rows - 2) + 1)
    return {(column, row) for column in range(pitch + 1, 2 * pitch) for row in inner}
