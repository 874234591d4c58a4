"""The vocabulary: ids without gaps, symbols without doubles, colours that can be told apart."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from jaxenstein.maps import symbols
from jaxenstein.maps.symbols import (
    COLOUR_NAMES,
    LABEL_COLOURS,
    LABEL_NAMES,
    SYMBOLS,
    door_label,
    key_label,
)


def test_label_ids_are_those_of_the_contract() -> None:
    assert COLOUR_NAMES == ("red", "green", "blue", "purple", "yellow", "grey")
    assert (symbols.CEILING, symbols.FLOOR, symbols.DEFAULT_WALL) == (0, 1, 2)
    coloured = [SYMBOLS[c].label for c in "123456789ACDFHIJKLMOQTUWXZ"]
    assert coloured == list(range(3, 29))
    assert [door_label(c, locked=False) for c in range(6)] == list(range(29, 35))
    assert [door_label(c, locked=True) for c in range(6)] == list(range(35, 41))
    assert [key_label(c) for c in range(6)] == list(range(41, 47))
    assert symbols.GOAL_LABEL == 47
    assert len(LABEL_NAMES) == len(set(LABEL_NAMES)) == 48
    assert LABEL_COLOURS.shape == (48, 3)
    assert LABEL_COLOURS.dtype == np.uint8
    assert not LABEL_COLOURS.flags.writeable


def test_symbols_of_the_paper() -> None:
    def meaning(character: str) -> str:
        return LABEL_NAMES[SYMBOLS[character].label]

    assert [meaning(c) for c in "rnbpye"] == [f"{name} key" for name in COLOUR_NAMES]
    assert [meaning(c) for c in "RNBPYE"] == [f"locked {name} door" for name in COLOUR_NAMES]
    assert [meaning(c) for c in "',\";\\:"] == [f"unlocked {name} door" for name in COLOUR_NAMES]
    assert [meaning(c) for c in "#. SG"] == ["wall", "floor", "floor", "floor", "goal"]
    assert len(SYMBOLS) == 5 + 26 + 18


def test_door_labels_name_their_door() -> None:
    for colour, locked in itertools.product(range(6), (False, True)):
        state = "locked" if locked else "unlocked"
        assert LABEL_NAMES[door_label(colour, locked)] == f"{state} {COLOUR_NAMES[colour]} door"


@pytest.mark.parametrize("colour", [-1, 6])
def test_no_label_for_an_unknown_colour(colour: int) -> None:
    with pytest.raises(ValueError, match="colour index"):
        key_label(colour)
    with pytest.raises(ValueError, match="colour index"):
        door_label(colour, locked=True)


def test_legend_explains_every_symbol() -> None:
    lines = symbols.legend().splitlines()
    assert len(lines) == len(SYMBOLS)
    for line, (character, symbol) in zip(lines, SYMBOLS.items(), strict=True):
        assert line.split()[0] == ("space" if character == " " else character)
        assert line.endswith(symbol.meaning)


def oklab(rgb: np.ndarray) -> np.ndarray:
    """Björn Ottosson's OKLab, in which distances follow what eyes see."""
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
    # A distance of 0.02 is about what one just sees side by side.
    assert closest(list(range(2, 29)), 1.0) > 0.06
    assert closest(list(range(2, 29)), 0.25) > 0.02
    assert closest(list(range(2, 12)), 1.0) > 0.1
    assert closest(list(range(2, 12)), 0.25) > 0.03


def test_first_walls_differ_in_more_than_brightness() -> None:
    """A wall in the distance must not pass for another one nearby."""
    colours = LABEL_COLOURS[2:12].astype(float)
    hue = colours / np.linalg.norm(colours, axis=1, keepdims=True)
    angles = np.degrees(np.arccos([a @ b for a, b in itertools.combinations(hue, 2)]))
    assert angles.min() > 14


def test_key_and_door_colours_can_be_told_apart() -> None:
    assert closest([key_label(c) for c in range(6)], 1.0) > 0.15
    assert closest([key_label(c) for c in range(6)], 0.25) > 0.05
