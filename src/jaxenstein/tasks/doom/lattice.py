"""Doom's maps as tiles: walls that stand on a lattice, filled up with solid tiles.

Doom's y grows northwards; maps here have north up, with rows running the other way.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ...engine.level import Level, compile_level
from ...errors import MapError
from .walls import ARMOUR, MAP_SPOT, DoomMap, Line, Thing

UNIT = 16
"""Map units a tile: every vertex of My Way Home stands on this lattice."""
WALL = 2
"""The label of solid tiles without a face of their own (the engine's first wall)."""
WEST, EAST, NORTH, SOUTH = range(4)


@dataclass(frozen=True)
class Tiles:
    """A map on a lattice.

    Attributes:
        solid: bool[rows, columns], first row in the north, with a border of solid tiles.
        faces: uint8[4, rows, columns] as in `engine.level.Level.walls`; 0 where open, `WALL` on
            sides that nobody sees, else `WALL + 1` plus the number of the face's texture.
        textures: their names.
        west: x of the first column's west side in map units.
        north: y of the first row's north side.
        unit: map units a tile.
    """

    solid: np.ndarray
    faces: np.ndarray
    textures: tuple[str, ...]
    west: int
    north: int
    unit: int

    def to_position(self, x: float, y: float) -> tuple[float, float]:
        """Map units to (x, y) in tiles."""
        return (x - self.west) / self.unit, (self.north - y) / self.unit

    def text(self, things: Iterable[Thing] = ()) -> str:
        """The map as text, with `S` for map spots and `G` for the armour."""
        lines = [["#" if solid else "." for solid in row] for row in self.solid]
        for thing in things:
            symbol = {MAP_SPOT: "S", ARMOUR: "G"}.get(thing.kind)
            if symbol:
                column, row = (math.floor(v) for v in self.to_position(thing.x, thing.y))
                lines[row][column] = symbol
        return "".join("".join(line) + "\n" for line in lines)

    def level(self) -> Level:
        """The map as the engine draws it."""
        return compile_level(self.faces, np.zeros((0, 2), np.int32))


def rasterise(doom_map: DoomMap, unit: int = UNIT) -> Tiles:
    """The tiles of a map whose walls all stand on a lattice.

    A tile is open if a line from its centre to the west crosses an odd number of walls.

    Args:
        doom_map: the map.
        unit: map units a tile.

    Raises:
        MapError: if a wall does not stand on the lattice.
    """
    walls = doom_map.walls
    for wall in walls:
        ends = wall.x0, wall.y0, wall.x1, wall.y1
        if any(end % unit for end in ends):
            raise MapError(f"the wall {ends} does not stand on a lattice of {unit} map units")
    west = min(min(wall.x0, wall.x1) for wall in walls) - unit
    north = max(max(wall.y0, wall.y1) for wall in walls) + unit
    columns = (max(max(wall.x0, wall.x1) for wall in walls) - west) // unit + 1
    rows = (north - min(min(wall.y0, wall.y1) for wall in walls)) // unit + 1
    inside = np.zeros((rows, columns), bool)
    for wall in walls:
        if wall.x0 == wall.x1:
            first, last = sorted((north - y) // unit for y in (wall.y0, wall.y1))
            inside[first:last, (wall.x0 - west) // unit :] ^= True
    textures = tuple(sorted({wall.texture for wall in walls}))
    faces = np.where(inside, 0, WALL).astype(np.uint8)[None].repeat(4, axis=0)
    for wall in walls:
        _show(wall, faces, textures.index(wall.texture) + WALL + 1, west, north, unit)
    return Tiles(~inside, faces, textures, west, north, unit)


def fill(doom_map: DoomMap, unit: int) -> Tiles:
    """The tiles nearest to a map whose walls run anywhere: solid where the centre is not inside.

    Every face shows the first wall's texture.
    """
    ends = np.array([(w.x0, w.y0, w.x1, w.y1) for w in doom_map.walls])
    low, high = ends.reshape(-1, 2).min(axis=0), ends.reshape(-1, 2).max(axis=0)
    west, south = (math.floor(v / unit) * unit - unit for v in low)
    east, north = (math.ceil(v / unit) * unit + unit for v in high)
    x = np.arange(west, east, unit) + unit / 2
    y = np.arange(north, south, -unit)[:, None] - unit / 2
    inside = np.zeros((len(y), len(x)), bool)
    for x0, y0, x1, y1 in ends[ends[:, 1] != ends[:, 3]]:
        crossing = x0 + (y - y0) * (x1 - x0) / (y1 - y0)
        inside ^= ((y0 > y) != (y1 > y)) & (x > crossing)
    faces = np.where(inside, 0, WALL + 1).astype(np.uint8)[None].repeat(4, axis=0)
    return Tiles(~inside, faces, (doom_map.walls[0].texture,), west, north, unit)


def _show(wall: Line, faces: np.ndarray, label: int, west: int, north: int, unit: int) -> None:
    """Write a wall's label onto the faces of the solid tiles behind it."""
    left, right = sorted((x - west) // unit for x in (wall.x0, wall.x1))
    top, bottom = sorted((north - y) // unit for y in (wall.y0, wall.y1))
    if left == right:
        # Going north, the open side on the right is the east one.
        face, column = (EAST, left - 1) if wall.y1 > wall.y0 else (WEST, left)
        target = faces[face, top:bottom, column]
    else:
        # Going east, the open side on the right is the south one.
        face, row = (SOUTH, top - 1) if wall.x1 > wall.x0 else (NORTH, top)
        target = faces[face, row, left:right]
    if (target == 0).any():
        raise MapError(f"the wall {wall} has its open side on the left")
    target[:] = label
