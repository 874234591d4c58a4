"""The fewest moves to solve a level, counted by hand."""

from __future__ import annotations

import pytest

from fidelity.minigrid_moves import fewest_moves

KINDS = {"k": "key", "G": "goal", "~": "lava", "o": "ball", "x": "box"}
DOORS = {"D": "door", "L": "locked"}


def layout_of(text: str, heading: int = 0) -> dict[str, list[str]]:
    """The contents of a level that is given as text."""
    marks = [(f"{c},{r}", m) for r, line in enumerate(text.split()) for c, m in enumerate(line)]
    column, row = next(place for place, mark in marks if mark == "S").split(",")
    return {
        "walls": [place for place, mark in marks if mark == "#"],
        "doors": [f"{DOORS[mark]} {place}" for place, mark in marks if mark in DOORS],
        "things": [f"{KINDS[mark]} {place}" for place, mark in marks if mark in KINDS],
        "start": [f"({column}, {row}, {heading})"],
    }


@pytest.mark.parametrize(
    ("text", "heading", "end", "moves"),
    [
        ("##### #S.G# #####", 0, "goal", 2),
        ("##### #S.G# #####", 2, "goal", 4),
        # A door is opened, and then walked through.
        ("##### #SDG# #####", 0, "goal", 3),
        # Around the lava: a turn, a step, a turn, two steps, a turn, a step.
        ("##### #S~G# #...# #####", 0, "goal", 7),
        ("##### #S~G# #####", 0, "goal", -1),
        # Turn round, take the key, turn round, open, walk.
        ("###### #kSLG# ######", 0, "goal", 2 + 1 + 2 + 3),
        ("##### #SLG# #####", 0, "goal", -1),
        ("###### #kSL.# ######", 2, "locked", 1 + 2 + 1),
        # With the key in hand, one more move to drop it.
        ("####### #kSL.x# #######", 2, "box", 1 + 2 + 3 + 2),
        ("##### #S.o# #####", 0, "ball", 2),
        # Things are in the way.
        ("##### #SoG# #####", 0, "goal", -1),
    ],
)
def test_moves(text: str, heading: int, end: str, moves: int) -> None:
    assert fewest_moves(layout_of(text, heading), end) == moves
