"""The vocabulary: which character of a text map means what, its label id, name and colour.

A label says what a tile or a pixel shows. This module is the only place that assigns label ids,
their names and their colours; `legend` prints it for people.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

Kind = Literal["floor", "wall", "spawn", "goal", "key", "door"]
RGB = tuple[int, int, int]

# Keys and doors share these colours; an index into this table is a colour index.
COLOURS: tuple[tuple[str, RGB, str, str, str], ...] = (
    # name, colour, symbols of: key, unlocked door, locked door
    ("red", (222, 44, 40), "r", "'", "R"),
    ("green", (40, 176, 66), "n", ",", "N"),
    ("blue", (52, 96, 236), "b", '"', "B"),
    ("purple", (156, 62, 206), "p", ";", "P"),
    ("yellow", (240, 206, 44), "y", "\\", "Y"),
    ("grey", (152, 154, 160), "e", ":", "E"),
)

# The first nine are as far apart as they can be, in hue as well as in lightness, since distance
# darkens walls. The others were chosen by their distance from all before them.
WALLS: tuple[tuple[str, str, RGB], ...] = (
    ("1", "red", (206, 38, 42)),
    ("2", "blue", (44, 70, 220)),
    ("3", "green", (28, 134, 52)),
    ("4", "yellow", (244, 208, 46)),
    ("5", "violet", (122, 40, 176)),
    ("6", "cyan", (44, 196, 222)),
    ("7", "magenta", (244, 72, 204)),
    ("8", "lime", (120, 240, 50)),
    ("9", "brick", (144, 70, 44)),
    ("A", "ultramarine", (10, 10, 170)),
    ("C", "claret", (130, 6, 70)),
    ("D", "teal", (25, 110, 128)),
    ("F", "emerald", (10, 204, 10)),
    ("H", "lavender", (200, 157, 242)),
    ("I", "salmon", (242, 121, 121)),
    ("J", "mint", (157, 242, 200)),
    ("K", "olive", (90, 106, 5)),
    ("L", "maroon", (108, 24, 6)),
    ("M", "indigo", (58, 6, 108)),
    ("O", "jade", (12, 242, 127)),
    ("Q", "slate", (80, 66, 106)),
    ("T", "azure", (85, 137, 242)),
    ("U", "moss", (112, 166, 58)),
    ("W", "ochre", (204, 139, 10)),
    ("X", "fuchsia", (204, 12, 242)),
    ("Z", "navy", (6, 58, 108)),
)

COLOUR_NAMES: tuple[str, ...] = tuple(name for name, *_ in COLOURS)

CEILING = 0
FLOOR = 1
DEFAULT_WALL = 2
_FIRST_COLOURED_WALL = 3
_FIRST_UNLOCKED_DOOR = _FIRST_COLOURED_WALL + len(WALLS)
_FIRST_LOCKED_DOOR = _FIRST_UNLOCKED_DOOR + len(COLOURS)
_FIRST_KEY = _FIRST_LOCKED_DOOR + len(COLOURS)
GOAL_LABEL = _FIRST_KEY + len(COLOURS)

WALL_LABELS = range(DEFAULT_WALL, _FIRST_UNLOCKED_DOOR)
"""Labels of static walls, the default one first."""
DOOR_LABELS = range(_FIRST_UNLOCKED_DOOR, _FIRST_KEY)
"""Labels of doors: the unlocked ones by colour, then the locked ones."""
KEY_LABELS = range(_FIRST_KEY, GOAL_LABEL)
"""Labels of keys by colour."""

LABEL_NAMES: tuple[str, ...] = (
    "ceiling",
    "floor",
    "wall",
    *(f"{name} wall" for _, name, _ in WALLS),
    *(f"unlocked {name} door" for name in COLOUR_NAMES),
    *(f"locked {name} door" for name in COLOUR_NAMES),
    *(f"{name} key" for name in COLOUR_NAMES),
    "goal",
)
"""Name of each label id."""


def _label_colours() -> np.ndarray:
    paints = [rgb for _, rgb, *_ in COLOURS]
    base = [(58, 66, 82), (104, 98, 92), (126, 120, 112)]
    table = [*base, *(rgb for *_, rgb in WALLS), *paints, *paints, *paints, (255, 216, 20)]
    colours = np.array(table, np.uint8)
    colours.setflags(write=False)
    return colours


LABEL_COLOURS: np.ndarray = _label_colours()
"""uint8[48, 3], RGB of each label id in full light; read-only."""


@dataclass(frozen=True)
class Symbol:
    """What one character of a text map means.

    Attributes:
        character: the character.
        kind: what it puts on the tile.
        label: label id of that thing; `FLOOR` for floor and spawns.
        meaning: the same in words.
        colour: colour index of a key or door, else -1.
        locked: whether it is a locked door.
    """

    character: str
    kind: Kind
    label: int
    meaning: str
    colour: int = -1
    locked: bool = False

    @property
    def tile(self) -> int:
        """What the tile holds in `TileMap.tiles`: a wall's or door's label, 0 if it is open."""
        return self.label if self.kind in ("wall", "door") else 0


def key_label(colour: int) -> int:
    """Label id of the key with a colour index."""
    return _FIRST_KEY + _checked(colour)


def door_label(colour: int, locked: bool) -> int:
    """Label id of a door with a colour index, locked or not."""
    return (_FIRST_LOCKED_DOOR if locked else _FIRST_UNLOCKED_DOOR) + _checked(colour)


def _checked(colour: int) -> int:
    if not 0 <= colour < len(COLOURS):
        raise ValueError(f"colour index {colour} is not in 0 to {len(COLOURS) - 1}")
    return colour


def _build_symbols() -> dict[str, Symbol]:
    symbols = [
        Symbol(".", "floor", FLOOR, "floor"),
        Symbol(" ", "floor", FLOOR, "floor"),
        Symbol("S", "spawn", FLOOR, "spawn: a place to start from"),
        Symbol("G", "goal", GOAL_LABEL, "goal"),
        Symbol("#", "wall", DEFAULT_WALL, "wall"),
    ]
    for label, (character, _, _) in enumerate(WALLS, start=_FIRST_COLOURED_WALL):
        symbols.append(Symbol(character, "wall", label, LABEL_NAMES[label]))
    for colour, (_, _, character, _, _) in enumerate(COLOURS):
        label = key_label(colour)
        symbols.append(Symbol(character, "key", label, LABEL_NAMES[label], colour))
    for locked in (False, True):
        for colour, (_, _, _, unlocked_door, locked_door) in enumerate(COLOURS):
            label = door_label(colour, locked)
            character = locked_door if locked else unlocked_door
            symbols.append(Symbol(character, "door", label, LABEL_NAMES[label], colour, locked))
    return {symbol.character: symbol for symbol in symbols}


SYMBOLS: dict[str, Symbol] = _build_symbols()
"""Every character that a text map may hold."""

TILE_CHARACTERS: dict[int, str] = {
    0: ".",
    **{symbol.tile: character for character, symbol in SYMBOLS.items() if symbol.tile},
}
"""The character of each value of `TileMap.tiles`."""


def key_character(colour: int) -> str:
    """The character of the key with a colour index."""
    return COLOURS[_checked(colour)][2]


def characters(*kinds: Kind) -> str:
    """The characters of some kinds, or of all if none is named, separated by blanks.

    The blank itself is written 'space'.
    """
    chosen = (s.character for s in SYMBOLS.values() if not kinds or s.kind in kinds)
    return " ".join("space" if character == " " else character for character in chosen)


def legend() -> str:
    """The symbols of text maps as a table for people, one symbol a line."""
    lines = []
    for character, symbol in SYMBOLS.items():
        shown = "space" if character == " " else character
        lines.append(f"{shown:<5}  {symbol.meaning}")
    return "\n".join(lines)
