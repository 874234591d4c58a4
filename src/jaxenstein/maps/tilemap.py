"""Tile maps: maps as data on the host, hashable and independent of JAX.

Tile (column, row) covers [column, column + 1) x [row, row + 1); everything outside is solid.
"""

from __future__ import annotations

import dataclasses
import operator
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import MapError
from .symbols import DOOR_LABELS, TILE_CHARACTERS, WALL_LABELS, door_label
from .things import APPLE, COLOURS, GOAL, KEY, THING_OF

MAX_SIZE = 256
"""The most columns, and the most rows, of a map."""

FACES = ("west", "east", "north", "south")
"""The faces of a tile by the direction in which they look, in the order of `TileMap.faces`."""

Cell = tuple[int, int]
"""(column, row) of a tile."""
Tiles = tuple[bytes, ...]
"""One bytes object per row, one label id per tile, 0 where open."""


@dataclass(frozen=True)
class Key:
    """A key on the floor: its tile and colour index."""

    column: int
    row: int
    colour: int


@dataclass(frozen=True)
class Door:
    """A door that fills a tile: its tile, its colour index, and whether it needs a key."""

    column: int
    row: int
    colour: int
    locked: bool


@dataclass(frozen=True)
class Item:
    """A monster or a pickup on the map of a shooter: its tile and label id."""

    column: int
    row: int
    label: int


@dataclass(frozen=True)
class TileMap:
    """A map. Maps with the same content are equal.

    Attributes:
        name: the name of the map.
        tiles: label id of the wall or door on each tile, 0 where it is open.
        faces: None, or the label ids of the west, east, north and south faces of each tile, each
            laid out as `tiles` and nonzero at the same places.
        spawns: tiles where an episode may start.
        goals: tiles where the goal may be.
        keys: the keys, at most one per tile.
        doors: the doors; the tile of each holds its label.
        apples: tiles where an apple may be; they may be spawns.
        items: monsters, medkits and ammunition of a shooter, at most one per tile.

    Raises:
        MapError: the parts contradict each other, such as a goal inside a wall.
    """

    name: str
    tiles: Tiles
    faces: tuple[Tiles, ...] | None = None
    spawns: tuple[Cell, ...] = ()
    goals: tuple[Cell, ...] = ()
    keys: tuple[Key, ...] = ()
    doors: tuple[Door, ...] = ()
    apples: tuple[Cell, ...] = ()
    items: tuple[Item, ...] = ()

    def __post_init__(self) -> None:
        """Check that the parts are consistent."""
        _check_tiles(self.tiles)
        _check_doors(self)
        _check_faces(self)
        _check_cells(self, "spawn", self.spawns)
        _check_cells(self, "goal", self.goals)
        _check_cells(self, "apple", self.apples)
        _check_cells(self, "key", tuple((key.column, key.row) for key in self.keys))
        for key in self.keys:
            _check_colour(key.colour)
        _check_cells(self, "item", tuple((item.column, item.row) for item in self.items))
        for item in self.items:
            if item.label not in THING_OF or not THING_OF[item.label].role:
                raise MapError(f"label {item.label} is not a monster or pickup of a shooter")

    @property
    def rows(self) -> int:
        """The number of rows."""
        return len(self.tiles)

    @property
    def columns(self) -> int:
        """The number of columns."""
        return len(self.tiles[0])

    @property
    def walls(self) -> np.ndarray:
        """uint8[rows, columns], or uint8[4, rows, columns] if the faces differ; read-only."""
        if self.faces is None:
            return _as_array(self.tiles)
        faces = np.stack([_as_array(face) for face in self.faces])
        faces.setflags(write=False)
        return faces

    @property
    def door_tiles(self) -> np.ndarray:
        """int32[D, 2], (column, row) of each door."""
        cells = [(door.column, door.row) for door in self.doors]
        return np.array(cells, np.int32).reshape(-1, 2)

    def is_floor(self, column: int, row: int) -> bool:
        """Whether a tile is on the map and has neither a wall nor a door."""
        inside = 0 <= column < self.columns and 0 <= row < self.rows
        return inside and self.tiles[row][column] == 0

    def with_spawns(self, cells: Iterable[Sequence[int]]) -> TileMap:
        """The same map with other spawns.

        Args:
            cells: (column, row) of each.

        Raises:
            MapError: there are no cells, or one is not a floor tile.
            TypeError: a column or row is not a whole number.
        """
        spawns = tuple((operator.index(column), operator.index(row)) for column, row in cells)
        if not spawns:
            raise MapError("a map needs at least one spawn")
        return dataclasses.replace(self, spawns=spawns)

    def tile_text(self) -> str:
        """The map as text, one line per row.

        A tile with several things shows the first of these: monster or pickup, key, goal, apple
        (with its own symbol on a spawn). The text does not contain the faces.
        """
        lines = [[TILE_CHARACTERS[tile] for tile in row] for row in self.tiles]
        for column, row in self.spawns:
            lines[row][column] = "S"
        for column, row in self.apples:
            on_spawn = lines[row][column] == "S"
            lines[row][column] = APPLE.spawn_symbol if on_spawn else APPLE.symbols
        for column, row in self.goals:
            lines[row][column] = GOAL.symbols
        for key in self.keys:
            lines[key.row][key.column] = KEY.symbols[key.colour]
        for item in self.items:
            lines[item.row][item.column] = THING_OF[item.label].symbols
        return "".join("".join(line) + "\n" for line in lines)

    def faces_text(self) -> str | None:
        """The faces of the walls as text for `parse_ascii`; None if `faces` is None."""
        if self.faces is None:
            return None
        shown = TILE_CHARACTERS | dict.fromkeys(DOOR_LABELS, TILE_CHARACTERS[0])
        blocks = [
            f"{name}\n" + "".join("".join(shown[tile] for tile in row) + "\n" for row in face)
            for name, face in zip(FACES, self.faces, strict=True)
        ]
        return "\n".join(blocks)


def _as_array(tiles: Tiles) -> np.ndarray:
    return np.frombuffer(b"".join(tiles), np.uint8).reshape(len(tiles), -1)


def _check_tiles(tiles: Tiles) -> None:
    if not isinstance(tiles, tuple) or not all(isinstance(row, bytes) for row in tiles):
        raise MapError("the tiles of a map must be a tuple of bytes objects, one per row")
    if not tiles or not tiles[0]:
        raise MapError("the map is empty")
    columns = len(tiles[0])
    if any(len(row) != columns for row in tiles):
        raise MapError("the rows of a map must have equal lengths")
    if max(columns, len(tiles)) > MAX_SIZE:
        raise MapError(
            f"a map of {columns} columns and {len(tiles)} rows is too large: "
            f"the limit is {MAX_SIZE} of each"
        )
    unknown = set(b"".join(tiles)) - {0, *WALL_LABELS, *DOOR_LABELS}
    if unknown:
        raise MapError(f"label {min(unknown)} is neither a wall nor a door")


def _check_doors(tilemap: TileMap) -> None:
    listed = {}
    for door in _tuple_of(tilemap.doors, "doors"):
        _check_colour(door.colour)
        listed[door.column, door.row] = door_label(door.colour, door.locked)
    standing = {
        (column, row): tile
        for row, line in enumerate(tilemap.tiles)
        for column, tile in enumerate(line)
        if tile in DOOR_LABELS
    }
    if listed != standing or len(listed) != len(tilemap.doors):
        raise MapError("the list of doors does not match the doors among the tiles")


def _check_faces(tilemap: TileMap) -> None:
    if tilemap.faces is None:
        return
    if len(_tuple_of(tilemap.faces, "faces")) != 4:
        raise MapError("a map must have four kinds of faces: west, east, north and south")
    tiles = _as_array(tilemap.tiles)
    doors = tiles >= DOOR_LABELS.start
    for face in tilemap.faces:
        _check_tiles(face)
        shown = _as_array(face)
        if shown.shape != tiles.shape or ((shown != 0) != (tiles != 0)).any():
            raise MapError("faces must be nonzero on exactly the solid tiles of the map")
        if (shown >= DOOR_LABELS.start)[~doors].any() or (shown != tiles)[doors].any():
            raise MapError("all faces of a door must have its label, and no wall a door's")


def _check_cells(tilemap: TileMap, what: str, cells: tuple[Cell, ...]) -> None:
    for column, row in _tuple_of(cells, f"{what}s"):
        if not tilemap.is_floor(column, row):
            raise MapError(f"{what} at column {column}, row {row} (from 0) is not on a floor tile")
    if len(set(cells)) != len(cells):
        raise MapError(f"two {what}s of a map are on the same tile")


def _check_colour(colour: int) -> None:
    if not 0 <= colour < len(COLOURS):
        raise MapError(f"colour index must be from 0 to {len(COLOURS) - 1}, not {colour}")


def _tuple_of(values: tuple, what: str) -> tuple:
    """Return `values` if they are a tuple: a list would make the map unhashable."""
    if not isinstance(values, tuple):
        raise MapError(f"the {what} of a map must be a tuple, not {type(values).__name__}")
    return values
