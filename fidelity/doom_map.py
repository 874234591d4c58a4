"""My Way Home from the installed vizdoom package, as an exact map of 16-unit tiles.

Doom's y grows northwards and its angles counterclockwise; maps here have north up with rows and
headings running the other way. `Tiles.to_position` and `heading_of` convert poses.
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fidelity.wad import Block, parse_udmf, read_lump
from jaxenstein.engine.level import Level, compile_level
from jaxenstein.errors import JAXensteinError, MapError
from jaxenstein.tasks.doom.walls import DoomMap, Line, Thing

UNIT = 16
"""Map units a tile: every vertex of My Way Home stands on this lattice."""
PLAYER_RADIUS = 16.0
"""Half the side of the player's box in map units (Doom's player actor)."""
MAP_SPOT = 9001
ARMOUR = 2018
WALL = 2
"""The label of solid tiles without a face of their own (the engine's first wall)."""
WEST, EAST, NORTH, SOUTH = range(4)
MISSING = "vizdoom is not installed; it comes with the extra 'bench': pip install '.[bench]'"


class MissingViZDoomError(JAXensteinError, ImportError):
    """The script needs ViZDoom, which is not installed."""


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

    def is_free(self, x: float, y: float, radius: float) -> bool:
        """Whether a square of half-width `radius`, all in map units, touches no solid tile."""
        left, top = self.to_position(x - radius, y + radius)
        right, bottom = self.to_position(x + radius, y - radius)
        columns = slice(max(math.floor(left), 0), math.ceil(right))
        rows = slice(max(math.floor(top), 0), math.ceil(bottom))
        return not self.solid[rows, columns].any()


def heading_of(angle: float) -> float:
    """Doom's angle (degrees, counterclockwise from east) as a heading in radians, 0 to 2 pi."""
    return math.radians(-angle % 360.0)


def scenario(name: str) -> Path:
    """A scenario file of the installed vizdoom package, found without loading the game.

    Raises:
        MissingViZDoomError: if the package or its file is missing.
    """
    package = importlib.util.find_spec("vizdoom")
    if package is None or not package.submodule_search_locations:
        raise MissingViZDoomError(MISSING)
    path = Path(next(iter(package.submodule_search_locations))) / "scenarios" / name
    if not path.exists():
        raise MissingViZDoomError(f"the installed vizdoom has no file {path}")
    return path


def load_my_way_home() -> tuple[DoomMap, Tiles]:
    """The map of My Way Home, and its tiles of 16 units."""
    path = scenario("my_way_home.wad")
    doom_map = read_map(read_lump(path, "TEXTMAP").decode("utf-8", "replace"), path.name)
    return doom_map, rasterise(doom_map)


def read_map(text: str, source: str = "TEXTMAP") -> DoomMap:
    """Read a UDMF text.

    Raises:
        MapError: if the text is malformed, or the map is none that flat tiles can hold: floors
            or ceilings of several heights, lines that block without being walls.
    """
    blocks = parse_udmf(text, source)
    vertices, sectors, sides = (blocks.get(kind, []) for kind in ("vertex", "sector", "sidedef"))
    walls = []
    for line in blocks.get("linedef", []):
        front = sides[line.index_of("sidefront", len(sides))]
        if line.number_of("sideback", -1) < 0:
            walls.append(_wall(line, front, vertices))
        elif line.flag("blocking"):
            raise MapError(f"{line} blocks, but both its sides are open", line=line.line)
    if not walls:
        raise MapError("no walls: not a single linedef has one side only", source=source)
    things = tuple(
        Thing(
            int(thing.number_of("type")),
            int(thing.number_of("id", 0)),
            thing.number_of("x"),
            thing.number_of("y"),
        )
        for thing in blocks.get("thing", [])
    )
    floor, ceiling = (_common(sectors, f"height{part}", source) for part in ("floor", "ceiling"))
    light = _common(sectors, "lightlevel", source, default=160.0)
    return DoomMap(tuple(walls), things, floor, ceiling, light)


def _wall(line: Block, side: Block, vertices: list[Block]) -> Line:
    ends = [vertices[line.index_of(key, len(vertices))] for key in ("v1", "v2")]
    places = [end.number_of(axis) for end in ends for axis in ("x", "y")]
    whole = [round(place) for place in places]
    if whole != places:
        raise MapError(f"{line} ends off whole map units, at {places}", line=line.line)
    x0, y0, x1, y1 = whole
    if (x0 == x1) == (y0 == y1):
        raise MapError(
            f"{line} from ({x0}, {y0}) to ({x1}, {y1}) runs along neither axis", line=line.line
        )
    return Line(x0, y0, x1, y1, side.text_of("texturemiddle", "-"))


def _common(sectors: list[Block], key: str, source: str, default: float = 0.0) -> float:
    """The height or the light that all sectors share."""
    heights = {sector.number_of(key, default) for sector in sectors}
    if len(heights) != 1:
        shown = ", ".join(f"{height:g}" for height in sorted(heights)) or "none"
        raise MapError(f"the sectors need one {key} in common, not {shown}", source=source)
    return heights.pop()


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
