"""Maps of ViZDoom's scenarios in map units, from the text files in `maps/`.

Doom's x grows eastwards and y northwards. Walls are seen from one side only, and the
floors are flat.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from importlib import resources

START, MAP_SPOT, ARMOUR = 1, 9001, 2018
"""Kinds of things: where the player starts, places that scripts know, the green armour."""


@dataclass(frozen=True)
class Line:
    """A wall: seen from (x0, y0) to (x1, y1) the open side lies on the right, in map units."""

    x0: int
    y0: int
    x1: int
    y1: int
    texture: str


@dataclass(frozen=True)
class Thing:
    """An object of the map: its number in the game's list of kinds, its id and its place."""

    kind: int
    id: int
    x: float
    y: float


@dataclass(frozen=True)
class DoomMap:
    """What a flat map with straight walls consists of.

    Attributes:
        walls: in the order of the game's own list, which decides between equals.
        things: by kind and id.
        floor: height of the floor in map units.
        ceiling: height of the ceiling.
        light: light level, 0 to 255.
        rails: what stops bodies and neither bullets nor eyes.
    """

    walls: tuple[Line, ...]
    things: tuple[Thing, ...]
    floor: float
    ceiling: float
    light: float
    rails: tuple[Line, ...] = ()

    def of_kind(self, kind: int) -> tuple[Thing, ...]:
        """The things of a kind by their ids."""
        return tuple(thing for thing in self.things if thing.kind == kind)

    def text(self) -> str:
        """The map as a file of `maps/` has it, without its first comment."""
        lines = [f"height {self.floor:g} {self.ceiling:g}", f"light {self.light:g}"]
        lines += [f"thing {t.kind} {t.id} {t.x:.9g} {t.y:.9g}" for t in self.things]
        lines += [f"wall {w.x0} {w.y0} {w.x1} {w.y1} {w.texture}" for w in self.walls]
        lines += [f"rail {w.x0} {w.y0} {w.x1} {w.y1} {w.texture}" for w in self.rails]
        return "".join(line + "\n" for line in lines)


@functools.cache
def load_map(name: str) -> DoomMap:
    """A map of this package, by the name of its file without suffix."""
    folder = resources.files("jaxenstein.tasks.doom").joinpath("maps")
    return parse_map(folder.joinpath(f"{name}.txt").read_text("ascii"))


def parse_map(text: str) -> DoomMap:
    """A map from its text; see `DoomMap.text`. Lines that begin with `#` are comments."""
    walls, rails, things, heights, light = [], [], [], (0.0, 0.0), 0.0
    for line in text.splitlines():
        word, *rest = line.split()
        if word in ("wall", "rail"):
            x0, y0, x1, y1 = map(int, rest[:4])
            line = Line(x0, y0, x1, y1, rest[4])
            (walls if word == "wall" else rails).append(line)
        elif word == "thing":
            things.append(Thing(int(rest[0]), int(rest[1]), float(rest[2]), float(rest[3])))
        elif word == "height":
            heights = float(rest[0]), float(rest[1])
        elif word == "light":
            light = float(rest[0])
    return DoomMap(tuple(walls), tuple(things), *heights, light, tuple(rails))
