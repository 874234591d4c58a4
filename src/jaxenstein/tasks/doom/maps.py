"""Maps of ViZDoom's scenarios: their files in map units, and their tiles.

Doom's x grows eastwards and y northwards. Walls are visible from one side only, and floors are
flat. In a map of tiles, north is up, and rows run southwards.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources

import numpy as np

from ...engine.level import Level, compile_level
from ...errors import MapError

START, MAP_SPOT, ARMOUR = 1, 9001, 2018
"""Kinds of things: the player's start, map spots for scripts, the green armour."""
WALL = 2
"""The label of solid tiles without their own face (the engine's first wall)."""
THING_RADIUS = 20
"""Half-width of pickups, in map units."""
_WEST, _EAST, _NORTH, _SOUTH = range(4)


@dataclass(frozen=True)
class Line:
    """A wall from (x0, y0) to (x1, y1) in map units; the open side is on the right.

    `offset` is the column of the texture at the first end, and `row` the row at the ceiling.
    """

    x0: float
    y0: float
    x1: float
    y1: float
    texture: str
    offset: int = 0
    row: int = 0


@dataclass(frozen=True)
class MapThing:
    """An object on the map: its number in the game's list of kinds, its id and its position."""

    kind: int
    id: int
    x: float
    y: float


@dataclass(frozen=True)
class DoomMap:
    """A flat map with straight walls.

    Attributes:
        walls: in the order of the game's list, which breaks ties.
        things: by kind and id.
        floor: height of the floor in map units.
        ceiling: height of the ceiling.
        light: light level, 0 to 255.
        rails: lines that stop bodies, but neither bullets nor sight.
        flats: the names of the textures of floor and ceiling; empty if the map does not tell.
    """

    walls: tuple[Line, ...]
    things: tuple[MapThing, ...]
    floor: float
    ceiling: float
    light: float
    rails: tuple[Line, ...] = ()
    flats: tuple[str, ...] = ()

    def of_kind(self, kind: int) -> tuple[MapThing, ...]:
        """The things of a kind, by id."""
        return tuple(thing for thing in self.things if thing.kind == kind)

    def places(self, *kinds: int) -> np.ndarray:
        """float64[n, 2]: the positions of things of the first of these kinds that the map has."""
        found = next(filter(None, map(self.of_kind, kinds)), ())
        return np.array([(thing.x, thing.y) for thing in found], np.float64).reshape(-1, 2)

    def text(self) -> str:
        """The map as text, as in the files of `maps/` without the first comment."""
        lines = [f"height {self.floor:g} {self.ceiling:g}", f"light {self.light:g}"]
        lines += [f"flats {' '.join(self.flats)}"] if self.flats else []
        lines += [f"thing {t.kind} {t.id} {t.x:.9g} {t.y:.9g}" for t in self.things]
        lines += [f"wall {w.x0} {w.y0} {w.x1} {w.y1} {w.texture}{_told(w)}" for w in self.walls]
        lines += [f"rail {w.x0} {w.y0} {w.x1} {w.y1} {w.texture}" for w in self.rails]
        return "".join(line + "\n" for line in lines)


def _told(wall: Line) -> str:
    if wall.row:
        return f" {wall.offset} {wall.row}"
    return f" {wall.offset}" if wall.offset else ""


@functools.cache
def load_map(name: str) -> DoomMap:
    """Load a map of this package, by the name of its file without suffix."""
    folder = resources.files("jaxenstein.tasks.doom").joinpath("maps")
    return parse_map(folder.joinpath(f"{name}.txt").read_text("ascii"))


def parse_map(text: str) -> DoomMap:
    """Parse a map; see `DoomMap.text`. Lines that start with `#` are comments."""
    walls, rails, things, heights, light, flats = [], [], [], (0.0, 0.0), 0.0, ()
    for line in text.splitlines():
        word, *rest = line.split()
        if word in ("wall", "rail"):
            x0, y0, x1, y1 = (int(v) if v.is_integer() else v for v in map(float, rest[:4]))
            (walls if word == "wall" else rails).append(
                Line(x0, y0, x1, y1, rest[4], *map(int, rest[5:]))
            )
        elif word == "thing":
            things.append(MapThing(int(rest[0]), int(rest[1]), float(rest[2]), float(rest[3])))
        elif word == "height":
            heights = float(rest[0]), float(rest[1])
        elif word == "light":
            light = float(rest[0])
        elif word == "flats":
            flats = tuple(rest)
    return DoomMap(tuple(walls), tuple(things), *heights, light, tuple(rails), flats)


def ends_of(walls: Sequence[Line]) -> np.ndarray:
    """int64[L, 2, 2]: both ends of each wall, x and y in whole map units."""
    return np.rint(exact_ends_of(walls)).astype(np.int64)


def exact_ends_of(walls: Sequence[Line]) -> np.ndarray:
    """float64[L, 2, 2]: both ends of each wall, x and y in map units."""
    return np.array([(w.x0, w.y0, w.x1, w.y1) for w in walls], np.float64).reshape(-1, 2, 2)


@dataclass(frozen=True)
class TileGrid:
    """A map on a lattice.

    Attributes:
        solid: bool[rows, columns], first row in the north, with a border of solid tiles.
        faces: uint8[4, rows, columns] as in `engine.level.Level.walls`; 0 where open, `WALL` on
            invisible sides, else `WALL + 1` plus the index of the face's texture.
        textures: the names of the textures.
        west: x of the first column's west side in map units.
        north: y of the first row's north side in map units.
        unit: map units per tile.
    """

    solid: np.ndarray
    faces: np.ndarray
    textures: tuple[str, ...]
    west: int
    north: int
    unit: int

    def to_position(self, x: float, y: float) -> tuple[float, float]:
        """Convert map units to (x, y) in tiles."""
        return (x - self.west) / self.unit, (self.north - y) / self.unit

    def level(self) -> Level:
        """The map as a level of the engine."""
        return compile_level(self.faces, np.zeros((0, 2), np.int32))


def on_lattice(wall: Line, unit: int) -> bool:
    """Whether a wall runs along the sides of tiles of so many map units."""
    return not (exact_ends_of([wall]) % unit).any() and (wall.x0 == wall.x1) != (wall.y0 == wall.y1)


def is_tiled(doom_map: DoomMap, unit: int) -> bool:
    """Whether all walls of a map run along the sides of tiles of so many map units."""
    return all(on_lattice(wall, unit) for wall in doom_map.walls)


def tiled(doom_map: DoomMap, unit: int) -> TileGrid:
    """The tiles of a map: `rasterise` if all walls are on the lattice, else `fill`."""
    return (rasterise if is_tiled(doom_map, unit) else fill)(doom_map, unit)


def rasterise(doom_map: DoomMap, unit: int = 16) -> TileGrid:
    """The tiles of a map whose walls are all on a lattice.

    A tile is open if a line from its centre to the west crosses an odd number of walls.

    Args:
        doom_map: the map.
        unit: map units per tile.

    Raises:
        MapError: a wall is not on the lattice.
    """
    walls = doom_map.walls
    for wall in walls:
        if not on_lattice(wall, unit):
            ends = wall.x0, wall.y0, wall.x1, wall.y1
            raise MapError(f"the wall {ends} is not on a lattice of {unit} map units")
    (west, south), (east, north) = (
        f(ends_of(walls), axis=(0, 1)).tolist() for f in (np.min, np.max)
    )
    west, north = west - unit, north + unit
    columns, rows = (east - west) // unit + 1, (north - south) // unit + 1
    inside = np.zeros((rows, columns), bool)
    for (x0, y0), (x1, y1) in ends_of(walls).tolist():
        if x0 == x1:
            first, last = sorted((north - y) // unit for y in (y0, y1))
            inside[first:last, (x0 - west) // unit :] ^= True
    textures = tuple(sorted({wall.texture for wall in walls}))
    faces = np.where(inside, 0, WALL).astype(np.uint8)[None].repeat(4, axis=0)
    for wall in walls:
        _show(wall, faces, textures.index(wall.texture) + WALL + 1, west, north, unit)
    return TileGrid(~inside, faces, textures, west, north, unit)


def fill(doom_map: DoomMap, unit: int) -> TileGrid:
    """Approximate a map with walls at any angle by tiles: solid where the centre is not inside.

    Every face shows the first wall's texture.
    """
    ends = ends_of(doom_map.walls)
    low, high = ends.min(axis=(0, 1)), ends.max(axis=(0, 1))
    west, south = (math.floor(v / unit) * unit - unit for v in low)
    east, north = (math.ceil(v / unit) * unit + unit for v in high)
    x = np.arange(west, east, unit) + unit / 2
    y = np.arange(north, south, -unit)[:, None] - unit / 2
    inside = np.zeros((len(y), len(x)), bool)
    for (x0, y0), (x1, y1) in ends[ends[:, 0, 1] != ends[:, 1, 1]]:
        crossing = x0 + (y - y0) * (x1 - x0) / (y1 - y0)
        inside ^= ((y0 > y) != (y1 > y)) & (x > crossing)
    faces = np.where(inside, 0, WALL + 1).astype(np.uint8)[None].repeat(4, axis=0)
    return TileGrid(~inside, faces, (doom_map.walls[0].texture,), west, north, unit)


def wall_faces(
    wall: Line, west: int, north: int, unit: int
) -> tuple[int, slice | int, slice | int]:
    """The faces of the solid tiles behind a wall: side, rows and columns (see `TileGrid`)."""
    (x0, y0), (x1, y1) = ends_of([wall])[0].tolist()
    left, right = sorted((x - west) // unit for x in (x0, x1))
    top, bottom = sorted((north - y) // unit for y in (y0, y1))
    if left == right:
        # Going north, the open side on the right is the east side.
        face, column = (_EAST, left - 1) if y1 > y0 else (_WEST, left)
        return face, slice(top, bottom), column
    # Going east, the open side on the right is the south side.
    face, row = (_SOUTH, top - 1) if x1 > x0 else (_NORTH, top)
    return face, row, slice(left, right)


def _show(wall: Line, faces: np.ndarray, label: int, west: int, north: int, unit: int) -> None:
    """Write a wall's label onto the faces of the solid tiles behind it."""
    target = faces[wall_faces(wall, west, north, unit)]
    if (target == 0).any():
        raise MapError(f"the wall {wall} has its open side on the left")
    target[:] = label


def outline(solid: np.ndarray, unit: int) -> tuple[Line, ...]:
    """The walls of a map of tiles: a segment along each straight run of solid tiles.

    The origin is the map's south-western corner, and everything outside is solid.

    Args:
        solid: bool[rows, columns], first row in the north.
        unit: map units per tile.
    """
    padded = np.pad(solid, 1, constant_values=True)
    rows = len(solid)
    lines = []
    # For a border between two rows: tiles that are solid on one side and open on the other.
    for row in range(rows + 1):
        above, below = padded[row, 1:-1], padded[row + 1, 1:-1]
        y = (rows - row) * unit
        lines += [Line(a * unit, y, b * unit, y, "-") for a, b in runs(above & ~below)]
        lines += [Line(b * unit, y, a * unit, y, "-") for a, b in runs(below & ~above)]
    for column in range(solid.shape[1] + 1):
        left, right = padded[1:-1, column], padded[1:-1, column + 1]
        x = column * unit
        for top, bottom in runs(left & ~right):
            lines.append(Line(x, (rows - bottom) * unit, x, (rows - top) * unit, "-"))
        for top, bottom in runs(right & ~left):
            lines.append(Line(x, (rows - top) * unit, x, (rows - bottom) * unit, "-"))
    return tuple(lines)


def runs(there: np.ndarray) -> list[tuple[int, int]]:
    """(first, after the last) of each run of true values."""
    edges = np.flatnonzero(np.diff(np.pad(there.astype(np.int8), 1)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]
