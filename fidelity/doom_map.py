"""Compare the maps of ViZDoom's scenarios with ours.

    python -m fidelity.doom_map

Needs the extra `vizdoom`. The exit status is 1 if a map of `tasks/doom/maps` differs from the
game's. Those of Predict Position and Deathmatch are left out: the game's have steps, ours are flat.

The lump `TEXTMAP` of a scenario's WAD file has its map in the Universal Doom Map Format: blocks
`name { key = value; ... }`, each kind numbered from 0 in the order of the text.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TypeVar

from fidelity.commands import run_command
from jaxenstein.adapters.vizdoom_buffers import load_vizdoom
from jaxenstein.errors import MapError
from jaxenstein.tasks.doom.maps import DoomMap, Line, MapThing, load_map
from jaxenstein.tasks.doom.wad import Wad

NAMES = (
    "my-way-home",
    "health-gathering",
    "health-gathering-supreme",
    "basic",
    "simpler-basic",
    "take-cover",
    "defend-the-line",
    "defend-the-center",
    "deadly-corridor",
)
_COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)
_BLOCK = re.compile(r"(\w+)\s*\{([^{}]*)\}")
_FIELD = re.compile(r'(\w+)\s*=\s*("[^"]*"|[^;"\s]+)\s*;')

Block = dict[str, str]
T = TypeVar("T", float, str)


def parse_udmf(text: str, source: str = "TEXTMAP") -> dict[str, list[Block]]:
    """Parse the blocks of a UDMF text by kind, with lower-case names; global fields are skipped.

    Raises:
        MapError: a part of the text is neither a block nor a field.
    """
    text, blocks = _COMMENT.sub("", text), dict[str, list[Block]]()
    left = [_FIELD.sub("", _BLOCK.sub("", text))]
    for kind, body in _BLOCK.findall(text):
        fields = {key.lower(): value.strip('"') for key, value in _FIELD.findall(body)}
        blocks.setdefault(kind.lower(), []).append(fields)
        left.append(_FIELD.sub("", body))
    if wrong := " ".join("".join(left).split()):
        raise MapError(f"neither a block nor a field: {wrong[:60]}", source=source)
    return blocks


def read_map(text: str, source: str = "TEXTMAP") -> DoomMap:
    """Read a UDMF text.

    Raises:
        MapError: the text is malformed, or the map is not supported: it has several heights of
            floors or ceilings, or broken offsets.
    """
    blocks = parse_udmf(text, source)
    walls, rails = [], []
    for number, line in enumerate(blocks.get("linedef", [])):
        vertices = (blocks["vertex"][int(line[end])] for end in ("v1", "v2"))
        ends = [float(vertex[axis]) for vertex in vertices for axis in "xy"]
        x0, y0, x1, y1 = (int(end) if end.is_integer() else end for end in ends)
        side = blocks["sidedef"][int(line["sidefront"])]
        offset = float(side.get("offsetx", 0))
        if int(line.get("sideback", -1)) < 0:
            if not offset.is_integer():
                raise MapError(f"linedef {number} has an offset of {offset:g}", source=source)
            row = int(float(side.get("offsety", 0)))
            walls.append(Line(x0, y0, x1, y1, side.get("texturemiddle", "-"), int(offset), row))
        elif line.get("blocking") == "true":
            rails.append(Line(x0, y0, x1, y1, "-"))
    things = sorted(
        (int(t["type"]), int(t.get("id", 0)), float(t["x"]), float(t["y"]))
        for t in blocks.get("thing", [])
    )
    sectors = blocks.get("sector", [])
    floor, ceiling, light = (
        _common(sectors, key, default, source)
        for key, default in (("heightfloor", 0.0), ("heightceiling", 0.0), ("lightlevel", 160.0))
    )
    flats = (_common(sectors, key, "-", source) for key in ("texturefloor", "textureceiling"))
    placed = tuple(MapThing(*thing) for thing in things)
    return DoomMap(tuple(walls), placed, floor, ceiling, light, tuple(rails), tuple(flats))


def _common(sectors: list[Block], key: str, default: T, source: str) -> T:
    """The height, light or texture that all sectors share."""
    found = {type(default)(sector.get(key, default)) for sector in sectors}
    if len(found) != 1:
        shown = ", ".join(map(_word, sorted(found))) or "none"
        raise MapError(f"the sectors need one {key} in common, not {shown}", source=source)
    return found.pop()


def _word(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:g}"


def main() -> int:
    """Compare all maps; return the exit code."""
    folder, differ = Path(load_vizdoom().scenarios_path), False
    for name in NAMES:
        path = folder / f"{name.replace('-', '_')}.wad"
        same = read_map(Wad(path).lump("TEXTMAP").decode(), path.name) == load_map(name)
        print(f"{name}: {'the same' if same else 'NOT the same'} as {path.name}")
        differ |= not same
    return int(differ)


if __name__ == "__main__":
    run_command(main)
