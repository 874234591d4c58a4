"""The characters of text maps, with their label ids, names and colours.

A label is what a tile or a pixel shows. Label ids, names and colours are assigned here and, for
things, in `things`; `legend` prints the characters.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np

from ..errors import SettingError
from .things import COLOUR_NAMES, COLOURS, RGB, THING_OF, THINGS, Role

# What is on a tile: "floor", "spawn", "wall", "door" or the name of a thing.
Kind = str
UNLOCKED_DOORS, LOCKED_DOORS = "',\";\\:", "RNBPYE"
"""The characters of doors, by colour."""

# The first nine differ as much as possible, in hue as well as in lightness, because distance
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

# Decals: 64 more walls for landmarks that occur once, such as the pictures of DeepMind Lab, in
# hexadecimal. Each is as far as possible, in CIELAB, from all walls before it, among the colours
# that no light makes look like the walls of DeepMind Lab's mazes (`dmlab.WALL_SYMBOLS`).
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

CEILING = 0
FLOOR = 1
DEFAULT_WALL = 2
_FIRST_COLOURED_WALL = 3
_FIRST_DECAL = _FIRST_COLOURED_WALL + len(WALLS)
_FIRST_UNLOCKED_DOOR = _FIRST_DECAL + len(DECALS)
_FIRST_LOCKED_DOOR = _FIRST_UNLOCKED_DOOR + len(COLOURS)

WALL_LABELS = range(DEFAULT_WALL, _FIRST_UNLOCKED_DOOR)
"""Labels of static walls: the default wall, the coloured walls, the decals."""
DECAL_LABELS = range(_FIRST_DECAL, _FIRST_UNLOCKED_DOOR)
"""Labels of the decals 1 to 64."""
DOOR_LABELS = range(_FIRST_UNLOCKED_DOOR, _FIRST_LOCKED_DOOR + len(COLOURS))
"""Labels of doors: first the unlocked ones by colour, then the locked ones. Things follow."""

LABEL_NAMES: tuple[str, ...] = (
    "ceiling",
    "floor",
    "wall",
    *(f"{name} wall" for _, name, _ in WALLS),
    *(f"decal {number}" for number, _ in enumerate(DECALS, start=1)),
    *(f"unlocked {name} door" for name in COLOUR_NAMES),
    *(f"locked {name} door" for name in COLOUR_NAMES),
    *(name for thing in THINGS for name in thing.names),
)
"""Names of the label ids of this package; `label_name` also knows registered things."""


def _label_colours() -> np.ndarray:
    base = [(58, 66, 82), (104, 98, 92), (126, 120, 112)]
    walls = [*(rgb for *_, rgb in WALLS), *DECALS]
    doors = [rgb for _, rgb in COLOURS] * 2
    things = [rgb for thing in THINGS for rgb in thing.colours]
    colours = np.array([*base, *walls, *doors, *things], np.uint8)
    colours.setflags(write=False)
    return colours


LABEL_COLOURS: np.ndarray = _label_colours()
"""uint8[L, 3], RGB of each of these label ids in full light; read-only."""


def label_name(label: int) -> str:
    """The name of a label id, including registered things.

    Raises:
        SettingError: the label does not exist.
    """
    if 0 <= label < len(LABEL_NAMES):
        return LABEL_NAMES[label]
    if label not in THING_OF:
        raise SettingError(
            f"there is no label {label}: labels are 0 to {len(LABEL_NAMES) - 1}, and those of "
            "jaxenstein.maps.register_thing"
        )
    thing = THING_OF[label]
    return thing.names[label - thing.label]


def label_colours() -> np.ndarray:
    """uint8[256, 3]: RGB of each label id in full light, including registered things; else 0."""
    colours = np.zeros((256, 3), np.uint8)
    colours[: len(LABEL_COLOURS)] = LABEL_COLOURS
    for label, thing in THING_OF.items():
        colours[label] = thing.colours[label - thing.label]
    return colours


@dataclass(frozen=True)
class Symbol:
    """A character of a text map.

    Attributes:
        character: the character.
        kind: what it puts on the tile.
        label: label id of what it puts there; `FLOOR` for floor and spawns. Decals are walls.
        meaning: a description.
        colour: colour index of a door or of a thing in several colours, else -1.
        locked: whether it is a locked door.
        spawn: whether an episode may start on the tile.
        role: for things that only shooters have, `things.Thing.role`.
    """

    character: str
    kind: Kind
    label: int
    meaning: str
    colour: int = -1
    locked: bool = False
    spawn: bool = False
    role: Role = ""

    @property
    def tile(self) -> int:
        """The value in `TileMap.tiles`: the label of a wall or door, 0 for an open tile."""
        return self.label if self.kind in ("wall", "door") else 0


def door_label(colour: int, locked: bool) -> int:
    """The label id of a door with a colour index."""
    if not 0 <= colour < len(COLOURS):
        raise ValueError(f"colour index must be from 0 to {len(COLOURS) - 1}, not {colour}")
    return (_FIRST_LOCKED_DOOR if locked else _FIRST_UNLOCKED_DOOR) + colour


# The Unicode block (Latin Extended-A) whose character n stands for decal n.
_DECAL_PAGE = 0x100


def _build_symbols() -> dict[str, Symbol]:
    symbols = [
        Symbol(".", "floor", FLOOR, "floor"),
        Symbol(" ", "floor", FLOOR, "floor"),
        Symbol("S", "spawn", FLOOR, "spawn: a place to start from", spawn=True),
        *_thing_symbols(coloured=False),
        Symbol("#", "wall", DEFAULT_WALL, "wall"),
    ]
    for label, (character, _, _) in enumerate(WALLS, start=_FIRST_COLOURED_WALL):
        symbols.append(Symbol(character, "wall", label, LABEL_NAMES[label]))
    symbols += _thing_symbols(coloured=True)
    for locked, doors in ((False, UNLOCKED_DOORS), (True, LOCKED_DOORS)):
        for colour, character in enumerate(doors):
            label = door_label(colour, locked)
            symbols.append(Symbol(character, "door", label, LABEL_NAMES[label], colour, locked))
    for number, label in enumerate(DECAL_LABELS, start=1):
        symbols.append(Symbol(chr(_DECAL_PAGE + number), "wall", label, LABEL_NAMES[label]))
    return {symbol.character: symbol for symbol in symbols}


def _thing_symbols(*, coloured: bool) -> Iterator[Symbol]:
    for thing in THINGS:
        if thing.coloured != coloured:
            continue
        for index, character in enumerate(thing.symbols):
            name, label = thing.names[index], thing.labels[index]
            colour = index if coloured else -1
            yield Symbol(character, thing.name, label, name, colour, role=thing.role)
        if thing.spawn_symbol:
            meaning = f"{thing.name} on a spawn"
            yield Symbol(thing.spawn_symbol, thing.name, thing.label, meaning, spawn=True)


SYMBOLS: dict[str, Symbol] = _build_symbols()
"""All characters of text maps."""

TILE_CHARACTERS: dict[int, str] = {
    0: ".",
    **{symbol.tile: character for character, symbol in SYMBOLS.items() if symbol.tile},
}
"""The character for each value of `TileMap.tiles`."""


PEACEFUL = frozenset(character for character, symbol in SYMBOLS.items() if not symbol.role)
"""The characters of maps without monsters."""


def characters(known: Collection[str]) -> str:
    """List characters, separated by spaces; a space is shown as 'space', the decals as a range.

    Args:
        known: the characters; either all decals or none.
    """
    return " ".join(shown for shown, symbol in _printed_symbols() if symbol.character in known)


def legend() -> str:
    """The symbols of text maps as a table, one per line, with one line for all decals."""
    last = SYMBOLS[TILE_CHARACTERS[DECAL_LABELS[-1]]]
    lines = []
    for shown, symbol in _printed_symbols():
        meaning = f"in shooters: {symbol.meaning}" if symbol.role else symbol.meaning
        if symbol.label in DECAL_LABELS:
            codes = f"U+{ord(symbol.character):04X} to U+{ord(last.character):04X}"
            meaning = f"{meaning} to {last.meaning}: walls for landmarks ({codes})"
        lines.append(f"{shown:<5}  {meaning}")
    return "\n".join(lines)


def _printed_symbols() -> Iterator[tuple[str, Symbol]]:
    """Each symbol with the printed form of its character; only the first decal."""
    last = TILE_CHARACTERS[DECAL_LABELS[-1]]
    for character, symbol in SYMBOLS.items():
        if symbol.label == DECAL_LABELS[0]:
            yield f"{character}-{last}", symbol
        elif symbol.label not in DECAL_LABELS:
            yield "space" if character == " " else character, symbol
