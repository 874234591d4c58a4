"""My Way Home from the installed vizdoom package, as an exact map of 16-unit tiles.

Doom's y grows northwards and its angles counterclockwise; maps here have north up with rows and
headings running the other way. `Tiles.to_position` and `heading_of` convert poses.
"""

from __future__ import annotations

import importlib.util
import math
from pathlib import Path

from fidelity.wad import Block, parse_udmf, read_lump
from jaxenstein.errors import JAXensteinError, MapError
from jaxenstein.tasks.doom.lattice import Tiles, rasterise
from jaxenstein.tasks.doom.walls import DoomMap, Line, Thing

PLAYER_RADIUS = 16.0
"""Half the side of the player's box in map units (Doom's player actor)."""
MISSING = "vizdoom is not installed; it comes with the extra 'bench': pip install '.[bench]'"


class MissingViZDoomError(JAXensteinError, ImportError):
    """The script needs ViZDoom, which is not installed."""


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
