"""Maps of the game with their nodes, which sort pieces of walls by distance.

Only one-sided walls, and one height of floors and of ceilings. Numbers are 16.16 map units.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from fidelity.doom_map import parse_udmf
from jaxenstein.tasks.doom.wad import Wad

from .doom import ONE, Point


@dataclass(frozen=True)
class Line:
    """A wall with its front on the right: its ends, its texture, and the offset of the texture."""

    start: Point
    end: Point
    texture: str
    offset: Point
    from_below: bool

    @property
    def length(self) -> int:
        """The length in whole map units."""
        return math.floor(math.dist(self.start, self.end) / ONE + 0.5)

    @property
    def contrast(self) -> int:
        """The change of the light level by the direction of the wall."""
        if self.start[0] == self.end[0]:
            return 16
        return -16 if self.start[1] == self.end[1] else 0


@dataclass(frozen=True)
class Seg:
    """A piece of a wall, as sorted by the nodes."""

    start: Point
    end: Point
    line: Line


@dataclass(frozen=True)
class Node:
    """A line that divides the map; `sides` are the nodes or pieces to its right and left."""

    place: Point
    way: Point
    sides: tuple[int, int]


@dataclass(frozen=True)
class GameMap:
    """A map with one floor and one ceiling height, in 16.16."""

    nodes: tuple[Node, ...]
    pieces: tuple[tuple[Seg, ...], ...]
    floor: int
    ceiling: int
    floor_flat: str
    ceiling_flat: str
    light: int

    def near_first(self, x: int, y: int) -> Iterator[Seg]:
        """All pieces of walls, from near to far."""
        left = [len(self.nodes) - 1 if self.nodes else 1 << 31]
        while left:
            number = left.pop()
            if number >> 31:
                yield from self.pieces[number & (1 << 31) - 1]
                continue
            node = self.nodes[number]
            (px, py), (dx, dy) = node.place, node.way
            behind = ((y - py) * dx + (px - x) * dy) >> 32 > 0
            left += [node.sides[not behind], node.sides[behind]]


def read_game_map(wad: Wad, flat: bool = False) -> GameMap:
    """The map of one of ViZDoom's scenarios, from the lumps TEXTMAP and ZNODES.

    Args:
        wad: its file.
        flat: whether to draw a map with several kinds of sectors as if all were like the first.
    """
    blocks = parse_udmf(wad.lump("TEXTMAP").decode("ascii"), wad.path.name)
    looks = "heightfloor", "heightceiling", "texturefloor", "textureceiling", "lightlevel"
    kinds = {tuple(sector.get(look) for look in looks) for sector in blocks["sector"]}
    if len(kinds) != 1 and not flat:
        raise ValueError(f"{wad.path.name} has sectors of {len(kinds)} kinds")
    sector = blocks["sector"][0]
    points = [(fixed(v["x"]), fixed(v["y"])) for v in blocks["vertex"]]
    lines = []
    for block in blocks["linedef"]:
        side = blocks["sidedef"][int(block["sidefront"])]
        one_sided = int(block.get("sideback", -1)) < 0
        # Textures begin at the ceiling of their own sector.
        above = blocks["sector"][int(side["sector"])]
        down = float(above.get("heightceiling", 0)) - float(sector.get("heightceiling", 0))
        down += float(side.get("offsety", 0))
        offset = fixed(side.get("offsetx", "0")), fixed(str(down))
        from_below = block.get("dontpegbottom") == "true"
        ends = points[int(block["v1"])], points[int(block["v2"])]
        line = Line(*ends, side.get("texturemiddle", "-"), offset, from_below)
        lines.append(line if one_sided else None)
    if "ZNODES" in wad.names():
        nodes, pieces = read_nodes(wad.lump("ZNODES"), points, lines)
    else:
        # The game makes its own when it loads such a map.
        nodes, pieces = build_nodes([line for line in lines if line is not None])
    return GameMap(
        nodes,
        pieces,
        floor=fixed(sector.get("heightfloor", "0")),
        ceiling=fixed(sector.get("heightceiling", "0")),
        floor_flat=sector["texturefloor"],
        ceiling_flat=sector["textureceiling"],
        light=int(sector.get("lightlevel", 160)),
    )


def fixed(number: str) -> int:
    """Parse a number as 16.16."""
    return round(float(number) * ONE)


def read_nodes(
    data: bytes, points: list[Point], lines: Sequence[Line | None]
) -> tuple[tuple[Node, ...], tuple[tuple[Seg, ...], ...]]:
    """Nodes and pieces of walls from a lump ZNODES of type XGLN; two-sided lines are None."""
    place = 0

    def take(form: str) -> tuple[int, ...]:
        nonlocal place
        found = struct.unpack_from("<" + form, data, place)
        place += struct.calcsize("<" + form)
        return found

    (kind,) = take("4s")
    if kind != b"XGLN":
        raise ValueError(f"nodes of the kind {kind!r}, not XGLN")
    old, new = take("II")
    points = points[:old] + [(x, y) for x, y in (take("ii") for _ in range(new))]
    counts = [take("I")[0] for _ in range(take("I")[0])]
    segs = [take("IIHB") for _ in range(take("I")[0])]
    pieces, first = [], 0
    for count in counts:
        own = segs[first : first + count]
        first += count
        ring = zip(own, own[1:] + own[:1], strict=True)
        pieces.append(
            tuple(
                Seg(points[here[0]], points[after[0]], line)
                for here, after in ring
                if here[2] != 0xFFFF and (line := lines[here[2]]) is not None
            )
        )
    nodes = []
    for _ in range(take("I")[0]):
        x, y, dx, dy, *_box, right, left = take("12hII")
        nodes.append(Node((x * ONE, y * ONE), (dx * ONE, dy * ONE), (right, left)))
    return tuple(nodes), tuple(pieces)


def build_nodes(
    lines: Sequence[Line],
) -> tuple[tuple[Node, ...], tuple[tuple[Seg, ...], ...]]:
    """Nodes and pieces of one-sided walls: each node divides the map along one of them."""
    nodes: list[Node] = []
    pieces: list[tuple[Seg, ...]] = []

    def build(segs: list[Seg]) -> int:
        """The number of the node or piece of walls."""
        for by in segs:
            front, behind = divided(segs, by)
            if behind:
                sides = build(front), build(behind)
                way = by.end[0] - by.start[0], by.end[1] - by.start[1]
                nodes.append(Node(by.start, way, sides))
                return len(nodes) - 1
        # No wall is behind another.
        pieces.append(tuple(segs))
        return len(pieces) - 1 | 1 << 31

    build([Seg(line.start, line.end, line) for line in lines])
    return tuple(nodes), tuple(pieces)


def divided(segs: Sequence[Seg], by: Seg) -> tuple[list[Seg], list[Seg]]:
    """The parts of walls in front of the line of one of them, which are on it or right of it."""

    def beside(point: Point) -> int:
        (x, y), (ax, ay), (bx, by_) = point, by.start, by.end
        return (x - ax) * (by_ - ay) - (y - ay) * (bx - ax)

    front, behind = [], []
    for seg in segs:
        a, b = beside(seg.start), beside(seg.end)
        if a >= 0 and b >= 0:
            front.append(seg)
        elif a <= 0 and b <= 0:
            behind.append(seg)
        else:
            share = a / (a - b)
            ends = zip(seg.start, seg.end, strict=True)
            x, y = (round(one + (other - one) * share) for one, other in ends)
            parts = Seg(seg.start, (x, y), seg.line), Seg((x, y), seg.end, seg.line)
            front.append(parts[a < 0])
            behind.append(parts[a > 0])
    return front, behind
