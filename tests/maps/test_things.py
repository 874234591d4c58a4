"""The table of things: every row has all that those who draw, name and read it need."""

from __future__ import annotations

import pytest

from jaxenstein.engine.art import load_art
from jaxenstein.maps.symbols import DOOR_LABELS, LABEL_COLOURS, LABEL_NAMES, SYMBOLS
from jaxenstein.maps.things import COLOUR_NAMES, COLOURS, THING_OF, THINGS, Thing
from jaxenstein.view.glyphs import GLYPHS


def test_labels_follow_those_of_doors_without_gaps() -> None:
    labels = [label for thing in THINGS for label in thing.labels]
    assert labels == list(range(DOOR_LABELS.stop, len(LABEL_NAMES))) == list(THING_OF)
    for label, thing in THING_OF.items():
        assert LABEL_NAMES[label] in thing.names
        assert LABEL_NAMES[label].removesuffix(thing.name).strip() in ("", *COLOUR_NAMES)
        assert tuple(LABEL_COLOURS[label]) in [rgb for _, rgb in COLOURS] + [thing.colour]


@pytest.mark.parametrize("thing", THINGS, ids=lambda thing: thing.name)
def test_a_row_is_complete(thing: Thing) -> None:
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


def test_without_a_detail_the_second_colour_is_a_darker_first() -> None:
    key, apple = THINGS[0], THINGS[2]
    assert key.paints(key.labels[2]) == ((52, 96, 236), pytest.approx((28.6, 52.8, 129.8)))
    assert apple.paints(apple.label) == ((232, 24, 56), (60, 140, 40))
