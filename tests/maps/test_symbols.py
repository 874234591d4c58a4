"""Symbols: ids without gaps, unique characters, and distinguishable colours."""

from __future__ import annotations

import itertools
import re

import numpy as np
import pytest

from jaxenstein.engine.art import load_art
from jaxenstein.maps import symbols
from jaxenstein.maps.own_things import OWN_LABELS
from jaxenstein.maps.symbols import (
    DECAL_LABELS,
    DOOR_LABELS,
    LABEL_COLOURS,
    LABEL_NAMES,
    SYMBOLS,
    door_label,
)
from jaxenstein.maps.things import (
    AMMUNITION,
    APPLE,
    ARMOUR,
    BALL,
    BOX,
    CACODEMON,
    CHAINGUN_GUY,
    COLOUR_NAMES,
    COLOURS,
    DEMON,
    FIREBALL,
    GOAL,
    HELL_KNIGHT,
    IMP,
    KEY,
    LAVA,
    MARINE,
    MEDKIT,
    POISON,
    ROCKET,
    SHOTGUN_GUY,
    THING_OF,
    THINGS,
    WEAPON,
    ZOMBIE,
    Thing,
)
from jaxenstein.view.glyphs import GLYPHS


def test_label_ids_match_the_contract() -> None:
    assert COLOUR_NAMES == ("red", "green", "blue", "purple", "yellow", "grey")
    assert (symbols.CEILING, symbols.FLOOR, symbols.DEFAULT_WALL) == (0, 1, 2)
    coloured = [SYMBOLS[c].label for c in "123456789ACDFHIJKLMOQTUWXZ"]
    assert coloured == list(range(3, 29))
    assert list(DECAL_LABELS) == list(range(29, 93))
    assert [door_label(c, locked=False) for c in range(6)] == list(range(93, 99))
    assert [door_label(c, locked=True) for c in range(6)] == list(range(99, 105))
    assert KEY.labels == range(105, 111)
    assert (GOAL.label, APPLE.label, MEDKIT.label, POISON.label) == (111, 112, 113, 114)
    assert (BALL.labels, BOX.labels, LAVA.label) == (range(115, 121), range(121, 127), 127)
    assert (CACODEMON.label, DEMON.label, MARINE.label) == (128, 129, 130)
    assert (IMP.label, FIREBALL.label) == (131, 132)
    labels = ZOMBIE.label, SHOTGUN_GUY.label, CHAINGUN_GUY.label, ROCKET.label
    assert labels == (134, 135, 136, 137)
    assert AMMUNITION.label == 138
    assert (HELL_KNIGHT.label, WEAPON.label, ARMOUR.label) == (139, 140, 141)
    assert len(LABEL_NAMES) == len(set(LABEL_NAMES)) == 142
    assert LABEL_COLOURS.shape == (142, 3)
    assert LABEL_COLOURS.dtype == np.uint8
    assert not LABEL_COLOURS.flags.writeable


def test_symbols_match_the_paper() -> None:
    def meaning(character: str) -> str:
        return LABEL_NAMES[SYMBOLS[character].label]

    assert [meaning(c) for c in "rnbpye"] == [f"{name} key" for name in COLOUR_NAMES]
    assert [meaning(c) for c in "RNBPYE"] == [f"locked {name} door" for name in COLOUR_NAMES]
    assert [meaning(c) for c in "',\";\\:"] == [f"unlocked {name} door" for name in COLOUR_NAMES]
    assert [meaning(c) for c in "#. SG"] == ["wall", "floor", "floor", "floor", "goal"]
    assert len(symbols.PEACEFUL) == 5 + 26 + 18 + 64 + 2
    assert "".join(sorted(set(SYMBOLS) - symbols.PEACEFUL)) == "+=cdimsz"


def test_decals_are_the_characters_after_latin_1() -> None:
    for number in range(1, 65):
        symbol = SYMBOLS[chr(0x100 + number)]
        assert (symbol.kind, symbol.label) == ("wall", DECAL_LABELS[number - 1])
        assert symbol.meaning == LABEL_NAMES[symbol.label] == f"decal {number}"
        assert symbol.label in symbols.DECAL_LABELS
        assert symbol.label in symbols.WALL_LABELS
    assert max(map(ord, SYMBOLS)) == 0x140


def test_apples() -> None:
    apple, both = SYMBOLS["a"], SYMBOLS["@"]
    assert apple.kind == both.kind == "apple"
    assert apple.label == both.label == APPLE.label
    assert (apple.spawn, both.spawn) == (False, True)
    assert {c for c, symbol in SYMBOLS.items() if symbol.spawn} == {"S", "@"}


def test_unused_ascii_characters_stay_unknown() -> None:
    """Typing mistakes are found; no symbol but the decals is beyond ASCII."""
    free = {chr(code) for code in range(33, 127)} - set(SYMBOLS)
    assert free == set("fghjkloqtuvwx0V!$%&()*-/<>?[]^_`{|}~")
    beyond = {character for character in SYMBOLS if ord(character) > 126}
    assert beyond == {chr(0x100 + number) for number in range(1, 65)}


def test_door_labels_name_their_door() -> None:
    for colour, locked in itertools.product(range(6), (False, True)):
        state = "locked" if locked else "unlocked"
        assert LABEL_NAMES[door_label(colour, locked)] == f"{state} {COLOUR_NAMES[colour]} door"


@pytest.mark.parametrize("colour", [-1, 6])
def test_no_label_for_an_unknown_colour(colour: int) -> None:
    with pytest.raises(ValueError, match="colour index"):
        door_label(colour, locked=True)


def test_legend_explains_every_symbol() -> None:
    *lines, decals = symbols.legend().splitlines()
    single = {c: symbol for c, symbol in SYMBOLS.items() if ord(c) < 127}
    assert len(lines) == len(single)
    for line, (character, symbol) in zip(lines, single.items(), strict=True):
        assert line.split()[0] == ("space" if character == " " else character)
        assert line.endswith(symbol.meaning)
    assert decals.split()[0] == "\u0101-\u0140"
    assert re.search("decal 1 to decal 64: .*U\\+0101 to U\\+0140", decals)
    assert max(map(len, [*lines, decals])) < 80


def test_characters_lists_the_decals_as_a_range() -> None:
    assert symbols.characters(". a@") == ". space a @"
    walls = {character for character, symbol in SYMBOLS.items() if symbol.kind == "wall"}
    assert symbols.characters(walls) == "# " + " ".join("123456789ACDFHIJKLMOQTUWXZ") + (
        " \u0101-\u0140"
    )


def oklab(rgb: np.ndarray) -> np.ndarray:
    """Björn Ottosson's OKLab, in which distances match perceived differences."""
    share = rgb / 255
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    cones = np.array(
        [
            [0.4122214708, 0.5363325363, 0.0514459929],
            [0.2119034982, 0.6806995451, 0.1073969566],
            [0.0883024619, 0.2817188376, 0.6299787005],
        ]
    )
    opponents = np.array(
        [
            [0.2104542553, 0.7936177850, -0.0040720468],
            [1.9779984951, -2.4285922050, 0.4505937099],
            [0.0259040371, 0.7827717662, -0.8086757660],
        ]
    )
    return np.cbrt(linear @ cones.T) @ opponents.T


def closest(labels: list[int], light: float) -> float:
    """The least OKLab distance between two of the labels' colours under a light."""
    lab = oklab(np.floor(LABEL_COLOURS[labels] * light))
    return min(float(np.linalg.norm(a - b)) for a, b in itertools.combinations(lab, 2))


def test_wall_colours_can_be_told_apart_near_and_far() -> None:
    # A distance of 0.02 is just visible side by side.
    assert closest(list(range(2, 29)), 1.0) > 0.06
    assert closest(list(range(2, 29)), 0.25) > 0.02
    assert closest(list(range(2, 12)), 1.0) > 0.1
    assert closest(list(range(2, 12)), 0.25) > 0.03


def test_decals_can_be_told_apart_and_from_the_walls() -> None:
    assert closest(list(symbols.WALL_LABELS), 1.0) > 0.03
    assert closest(list(symbols.WALL_LABELS), 0.5) > 0.02


def test_decals_differ_from_their_walls_in_any_light() -> None:
    """Walls are darker in the distance and on two of their sides."""
    near = [1.0, 0.8, 0.64, 0.5]
    for walls in ("31", "3FI", "42T", "42W", "W#"):
        around = [SYMBOLS[character].label for character in walls]
        for light in near:
            decals = oklab(LABEL_COLOURS[list(symbols.DECAL_LABELS)] * light)
            for other in near:
                seen = oklab(LABEL_COLOURS[around] * other)
                distances = np.linalg.norm(decals[:, None] - seen, axis=-1)
                assert distances.min() > 0.015, (walls, light, other)


def test_first_walls_differ_in_more_than_brightness() -> None:
    """A distant wall must not look like a different wall nearby."""
    colours = LABEL_COLOURS[2:12].astype(float)
    hue = colours / np.linalg.norm(colours, axis=1, keepdims=True)
    angles = np.degrees(np.arccos([a @ b for a, b in itertools.combinations(hue, 2)]))
    assert angles.min() > 14


def test_key_and_door_colours_can_be_told_apart() -> None:
    assert closest(list(KEY.labels), 1.0) > 0.15
    assert closest(list(KEY.labels), 0.25) > 0.05


def test_thing_labels_follow_door_labels_without_gaps() -> None:
    labels = [label for thing in THINGS for label in thing.labels]
    assert labels == list(range(DOOR_LABELS.stop, len(LABEL_NAMES)))
    assert labels == [label for label in THING_OF if label not in OWN_LABELS]
    for label in labels:
        thing = THING_OF[label]
        assert LABEL_NAMES[label] in thing.names
        assert LABEL_NAMES[label].removesuffix(thing.name).strip() in ("", *COLOUR_NAMES)
        assert tuple(LABEL_COLOURS[label]) in [rgb for _, rgb in COLOURS] + [thing.colour]


@pytest.mark.parametrize("thing", THINGS, ids=lambda thing: thing.name)
def test_table_row_is_complete(thing: Thing) -> None:
    assert load_art(thing.art)[0].any()
    assert thing.glyph is None or thing.glyph in GLYPHS
    # The billboard lies between floor and ceiling, which are half a tile from the eye.
    assert thing.radius > 0
    assert abs(thing.drop) + thing.radius <= 0.5
    assert len(thing.symbols) in (0, len(thing.labels))
    for character, label in zip(thing.symbols, thing.labels, strict=bool(thing.symbols)):
        assert (SYMBOLS[character].kind, SYMBOLS[character].label) == (thing.name, label)
    if thing.spawn_symbol:
        assert SYMBOLS[thing.spawn_symbol].spawn


def test_default_detail_colour_is_a_darker_first() -> None:
    key, apple = THINGS[0], THINGS[2]
    assert key.paints(key.labels[2]) == ((52, 96, 236), pytest.approx((28.6, 52.8, 129.8)))
    assert apple.paints(apple.label) == ((232, 24, 56), (60, 140, 40))
