"""The vocabulary: which character of a text map means what, its label id, name and colour.

A label says what a tile or a pixel shows. This module is the only place that assigns label ids,
their names and their colours; `legend` prints it for people.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

Kind = Literal["floor", "wall", "spawn", "goal", "apple", "key", "door"]
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

# Decals: 64 more walls, for landmarks that occur once, such as the pictures of DeepMind Lab. In
# hexadecimal; each was chosen as far as possible, in CIELAB, from all walls before it, among the
# colours that no light makes look like the walls of its mazes (`dmlab.WALL_SYMBOLS`).
_DECAL_BYTES = bytes.fromhex(
    """
    f6ec9c f60674 0606f6 f66a06 d8f606 c4cef6 f67eba ce9c6a 389c7e 924292 cef674 1aa6ec
    ba88a6 ce74f6 06f6ba 424c24 9cb074 ba107e b05606 06f6ec a6ba06 88e288 7488b0 ba2e4c
    f69256 6a56ba 7e2eec 06604c f6c460 6aba06 886a42 924c6a ba7e74 a6f6f6 1aba7e f6baec
    6aa6a6 baba56 567e4c 886aa6 ba1ac4 f6a6b0 9c1092 f67ee2 f6069c 386aec f66a42 f606e2
    92a6ec f64260 9260f6 cef6b0 066a9c f6f656 d8427e 889206 38c4ba c474ba 9c7ef6 6ab06a
    0692ba c4744c 6a2e60 b0ec42
    """
)
DECALS: tuple[RGB, ...] = tuple(
    zip(_DECAL_BYTES[0::3], _DECAL_BYTES[1::3], _DECAL_BYTES[2::3], strict=True)
)

COLOUR_NAMES: tuple[str, ...] = tuple(name for name, *_ in COLOURS)

CEILING = 0
FLOOR = 1
DEFAULT_WALL = 2
_FIRST_COLOURED_WALL = 3
_FIRST_DECAL = _FIRST_COLOURED_WALL + len(WALLS)
_FIRST_UNLOCKED_DOOR = _FIRST_DECAL + len(DECALS)
_FIRST_LOCKED_DOOR = _FIRST_UNLOCKED_DOOR + len(COLOURS)
_FIRST_KEY = _FIRST_LOCKED_DOOR + len(COLOURS)
GOAL_LABEL = _FIRST_KEY + len(COLOURS)
APPLE_LABEL = GOAL_LABEL + 1
MEDKIT_LABEL = APPLE_LABEL + 1

WALL_LABELS = range(DEFAULT_WALL, _FIRST_UNLOCKED_DOOR)
"""Labels of static walls: the default one, the coloured ones, the decals."""
DECAL_LABELS = range(_FIRST_DECAL, _FIRST_UNLOCKED_DOOR)
"""Labels of the decals 1 to 64."""
DOOR_LABELS = range(_FIRST_UNLOCKED_DOOR, _FIRST_KEY)
"""Labels of doors: the unlocked ones by colour, then the locked ones."""
KEY_LABELS = range(_FIRST_KEY, GOAL_LABEL)
"""Labels of keys by colour."""

LABEL_NAMES: tuple[str, ...] = (
    "ceiling",
    "floor",
    "wall",
    *(f"{name} wall" for _, name, _ in WALLS),
    *(f"decal {number}" for number, _ in enumerate(DECALS, start=1)),
    *(f"unlocked {name} door" for name in COLOUR_NAMES),
    *(f"locked {name} door" for name in COLOUR_NAMES),
    *(f"{name} key" for name in COLOUR_NAMES),
    "goal",
    "apple",
    "medkit",
)
"""Name of each label id."""


def _label_colours() -> np.ndarray:
    paints = [rgb for _, rgb, *_ in COLOURS]
    base = [(58, 66, 82), (104, 98, 92), (126, 120, 112)]
    walls = [*(rgb for *_, rgb in WALLS), *DECALS]
    things = [(255, 216, 20), (232, 24, 56), (240, 240, 236)]
    table = [*base, *walls, *paints, *paints, *paints, *things]
    colours = np.array(table, np.uint8)
    colours.setflags(write=False)
    return colours


LABEL_COLOURS: np.ndarray = _label_colours()
"""uint8[L, 3], RGB of each label id in full light; read-only."""


@dataclass(frozen=True)
class Symbol:
    """What one character of a text map means.

    Attributes:
        character: the character.
        kind: what it puts on the tile.
        label: label id of that thing; `FLOOR` for floor and spawns. Decals are walls.
        meaning: the same in words.
        colour: colour index of a key or door, else -1.
        locked: whether it is a locked door.
        spawn: whether an episode may start on the tile.
    """

    character: str
    kind: Kind
    label: int
    meaning: str
    colour: int = -1
    locked: bool = False
    spawn: bool = False

    @property
    def tile(self) -> int:
        """What the tile holds in `TileMap.tiles`: a wall's or door's label, 0 if it is open."""
        return self.label if self.kind in ("wall", "door") else 0


def decal_label(number: int) -> int:
    """Label id of decal `number`, from 1 to 64."""
    if not 1 <= number <= len(DECALS):
        raise ValueError(f"decal {number} is not in 1 to {len(DECALS)}")
    return DECAL_LABELS[number - 1]


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


# The block of Unicode (Latin Extended-A) whose character n stands for decal n.
_DECAL_PAGE = 0x100


def _build_symbols() -> dict[str, Symbol]:
    symbols = [
        Symbol(".", "floor", FLOOR, "floor"),
        Symbol(" ", "floor", FLOOR, "floor"),
        Symbol("S", "spawn", FLOOR, "spawn: a place to start from", spawn=True),
        Symbol("G", "goal", GOAL_LABEL, "goal"),
        Symbol("a", "apple", APPLE_LABEL, "apple"),
        Symbol("@", "apple", APPLE_LABEL, "apple on a spawn", spawn=True),
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
    for number, label in enumerate(DECAL_LABELS, start=1):
        symbols.append(Symbol(chr(_DECAL_PAGE + number), "wall", label, LABEL_NAMES[label]))
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

    The blank itself is written 'space', the decals as a range.
    """
    return " ".join(shown for shown, symbol in _shown() if not kinds or symbol.kind in kinds)


def legend() -> str:
    """The symbols of text maps as a table for people, one symbol a line, the decals in one."""
    last = SYMBOLS[TILE_CHARACTERS[DECAL_LABELS[-1]]]
    lines = []
    for shown, symbol in _shown():
        meaning = symbol.meaning
        if symbol.label in DECAL_LABELS:
            codes = f"U+{ord(symbol.character):04X} to U+{ord(last.character):04X}"
            meaning = f"{meaning} to {last.meaning}: walls for landmarks ({codes})"
        lines.append(f"{shown:<5}  {meaning}")
    return "\n".join(lines)


def _shown() -> Iterator[tuple[str, Symbol]]:
    """Each symbol with what to print for its character; of the decals the first alone."""
    last = TILE_CHARACTERS[DECAL_LABELS[-1]]
    for character, symbol in SYMBOLS.items():
        if symbol.label == DECAL_LABELS[0]:
            yield f"{character}-{last}", symbol
        elif symbol.label not in DECAL_LABELS:
            yield "space" if character == " " else character, symbol
