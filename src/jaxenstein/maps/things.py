"""The kinds of things that can be on a map, one row each.

A new thing of this package is a row of `THINGS` with the next free labels, and a picture in
`engine/art`. Users add a row with `own_things.register_thing`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ..errors import SettingError

RGB = tuple[int, int, int]
Glyph = Literal["star", "key", "apple", "medkit"]
Role = Literal["", "monster", "supply"]

# The colours of keys and doors; a colour index is an index into this table.
COLOURS: tuple[tuple[str, RGB], ...] = (
    ("red", (222, 44, 40)),
    ("green", (40, 176, 66)),
    ("blue", (52, 96, 236)),
    ("purple", (156, 62, 206)),
    ("yellow", (240, 206, 44)),
    ("grey", (152, 154, 160)),
)
# Without a colour of its own, a picture's detail has its colour times this factor.
DETAIL_SHADE = 0.55
COLOUR_NAMES: tuple[str, ...] = tuple(name for name, _ in COLOURS)
RED, GREEN, BLUE, PURPLE, YELLOW, GREY = range(len(COLOURS))


@dataclass(frozen=True)
class Thing:
    """A kind of thing, drawn as a billboard. Without a colour, it comes in all of `COLOURS`.

    Attributes:
        name: the name of the thing.
        label: its label id; if it comes in several colours, the first of six.
        colour: RGB in full light of its shape, of its label and on maps, or None.
        art: its picture: a file in `engine/art`, or the text of one.
        radius: half the billboard's side in tiles.
        drop: tiles from eye height down to the billboard's centre.
        detail: RGB of the picture's second colour, or None for a darker shade of the first.
        symbols: its character in text maps, or one for each colour; "" if texts cannot hold it.
        spawn_symbol: the character for the thing on a spawn, or "".
        glyph: its drawing on top-down maps in `view/glyphs.py`, or None for its art.
        role: for things that only maps of shooters have (`tasks.shooter`): their role there.
    """

    name: str
    label: int
    colour: RGB | None
    art: str
    radius: float
    drop: float
    detail: RGB | None = None
    symbols: str = ""
    spawn_symbol: str = ""
    glyph: Glyph | None = None
    role: Role = ""

    @property
    def coloured(self) -> bool:
        """Whether it comes in all of `COLOURS`."""
        return self.colour is None

    @property
    def labels(self) -> range:
        """Its label ids: one, or one for each colour."""
        return range(self.label, self.label + (len(COLOURS) if self.coloured else 1))

    @property
    def names(self) -> tuple[str, ...]:
        """The name of each label."""
        if self.coloured:
            return tuple(f"{colour} {self.name}" for colour in COLOUR_NAMES)
        return (self.name,)

    @property
    def colours(self) -> tuple[RGB, ...]:
        """The colour of each label."""
        return tuple(rgb for _, rgb in COLOURS) if self.colour is None else (self.colour,)

    def paints(self, label: int) -> tuple[RGB, tuple[float, ...]]:
        """The colours of the picture's shape and of its detail, for one of its labels."""
        shape = self.colours[label - self.label]
        return shape, self.detail or tuple(part * DETAIL_SHADE for part in shape)


def _monster(name: str, label: int, colour: RGB, art: str, detail: RGB, symbol: str) -> Thing:
    """A monster of shooters."""
    return Thing(name, label, colour, art, 0.4, 0.1, detail, symbol, role="monster")


KEY = Thing("key", 105, None, "key", 0.25, 0.15, symbols="rnbpye", glyph="key")
GOAL = Thing("goal", 111, (255, 216, 20), "goal", 0.32, 0.1, symbols="G", glyph="star")
# These two lie on the floor, below the horizon.
APPLE = Thing(
    "apple",
    112,
    (232, 24, 56),
    "apple",
    0.16,
    0.34,
    detail=(60, 140, 40),
    symbols="a",
    spawn_symbol="@",
    glyph="apple",
)
MEDKIT = Thing(
    "medkit",
    113,
    (240, 240, 236),
    "medkit",
    0.24,
    0.26,
    detail=(200, 24, 28),
    symbols="+",
    glyph="medkit",
    role="supply",
)

POISON = Thing("poison", 114, (96, 152, 86), "bottle", 0.24, 0.26, detail=(128, 160, 76))

# Things of MiniGrid's worlds other than keys. Lava covers its whole tile.
BALL = Thing("ball", 115, None, "ball", 0.2, 0.3)
BOX = Thing("box", 121, None, "box", 0.22, 0.28)
LAVA = Thing("lava", 127, (255, 106, 0), "lava", 0.5, 0.0, detail=(255, 196, 40))

# Doom's monsters.
CACODEMON = Thing("cacodemon", 128, (178, 62, 66), "cacodemon", 0.4, 0.1, detail=(240, 220, 120))
DEMON = _monster("demon", 129, (206, 96, 110), "demon-one", (240, 220, 210), "d")
MARINE = _monster("marine", 130, (92, 140, 80), "soldier-one", (190, 170, 80), "m")
IMP = _monster("imp", 131, (150, 96, 56), "imp-one", (230, 200, 60), "i")
FIREBALL = Thing("fireball", 132, (255, 150, 40), "fireball", 0.15, 0.1, detail=(255, 236, 160))
# From MiniWorld's sidewalk.
CONE = Thing("cone", 133, (240, 104, 24), "cone", 0.3, 0.2, detail=(240, 240, 236))

# Doom's zombies with guns, and rockets.
ZOMBIE = _monster("zombie", 134, (156, 138, 96), "soldier-one", (200, 180, 140), "z")
SHOTGUN_GUY = _monster("shotgun guy", 135, (116, 92, 112), "soldier-one", (220, 80, 60), "s")
CHAINGUN_GUY = _monster("chaingun guy", 136, (176, 60, 48), "soldier-one", (190, 190, 190), "c")
ROCKET = Thing("rocket", 137, (190, 186, 170), "rocket", 0.15, 0.1, detail=(255, 210, 120))
AMMUNITION = Thing(
    "ammunition",
    138,
    (122, 128, 88),
    "ammunition",
    0.2,
    0.3,
    detail=(228, 184, 80),
    symbols="=",
    role="supply",
)
HELL_KNIGHT = Thing("hell knight", 139, (196, 148, 112), "imp-one", 0.5, 0.0)
WEAPON = Thing("weapon", 140, (70, 78, 92), "gun", 0.3, 0.2, detail=(150, 158, 170))
ARMOUR = Thing("armour", 141, (60, 150, 90), "vest", 0.3, 0.2, detail=(30, 90, 60))

THINGS: tuple[Thing, ...] = (
    KEY,
    GOAL,
    APPLE,
    MEDKIT,
    POISON,
    BALL,
    BOX,
    LAVA,
    CACODEMON,
    DEMON,
    MARINE,
    IMP,
    FIREBALL,
    CONE,
    ZOMBIE,
    SHOTGUN_GUY,
    CHAINGUN_GUY,
    ROCKET,
    AMMUNITION,
    HELL_KNIGHT,
    WEAPON,
    ARMOUR,
)
"""All things, in the order of their labels."""

THING_OF: dict[int, Thing] = {}
"""The thing of each label id, including registered things; walls and doors have none."""


def enter(thing: Thing) -> Thing:
    """Add a thing to `THING_OF`; it replaces the thing with the same name and label.

    Raises:
        SettingError: another thing has its name or one of its labels.
    """
    for other in THING_OF.values():
        same = (other.name == thing.name) + (other.label == thing.label)
        if same == 1 or (same == 0 and set(other.labels) & set(thing.labels)):
            raise SettingError(
                f"{thing.name!r} cannot have the labels {list(thing.labels)}: {other.name!r} has "
                f"the labels {list(other.labels)}; names and labels must be unique"
            )
    for label in [label for label, other in THING_OF.items() if other.name == thing.name]:
        del THING_OF[label]
    THING_OF.update(dict.fromkeys(thing.labels, thing))
    return thing


for _thing in THINGS:
    enter(_thing)
