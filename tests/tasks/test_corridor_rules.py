"""The rules of KeyCorridor on a layout drawn by hand, and on others that break each of them."""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np
import pytest

from jaxenstein.errors import MapWarning
from jaxenstein.maps import parse_ascii
from tests.reference.corridors import broken_rules, from_tilemap

DRAWN = """\
##########
#..#..#..#
#.r'..,..#
##'#..##;#
#..#.S:..#
#..#..#..#
#'##..####
#..#..#G.#
#..#..R..#
##########
"""


def layout(text: str = DRAWN, heading: float = 0.0) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MapWarning)
        tilemap = parse_ascii(text)
    return from_tilemap(tilemap, np.add(tilemap.spawns[0], 0.5), math.radians(heading))


def test_a_right_layout_breaks_no_rule() -> None:
    assert broken_rules(layout()) == []


def changed(*changes: tuple[int, int, str]) -> str:
    """The drawn text with other characters at some (column, row)."""
    lines = [list(line) for line in DRAWN.splitlines()]
    for column, row, character in changes:
        lines[row][column] = character
    return "\n".join("".join(line) for line in lines)


@pytest.mark.parametrize(
    ("changes", "rule"),
    [
        ([(4, 3, "#")], "walls and hallway"),
        ([(1, 3, ".")], "walls and hallway"),
        ([(7, 7, "."), (7, 5, "G")], "goal in the locked room"),
        ([(7, 6, "'")], "no other door to the locked room"),
        ([(2, 2, "."), (4, 7, "r")], "key in the first column"),
        ([(2, 2, "b")], "key in the door's colour"),
        ([(5, 4, "."), (5, 2, "S")], "start in the middle"),
        ([(5, 4, "."), (5, 7, "S")], "start in the middle"),
        ([(1, 6, "#")], "all rooms connected"),
        ([(6, 8, "#"), (6, 4, "R")], "goal in the locked room"),
        ([(6, 8, "#"), (8, 6, "R")], "locked door west of a room of the last column"),
        ([(6, 2, "R")], "one locked door, one key, one goal"),
        ([(2, 2, "."), (8, 8, "r")], "solvable"),
    ],
)
def test_broken_rules_are_found(changes: list[tuple[int, int, str]], rule: str) -> None:
    assert rule in broken_rules(layout(changed(*changes)))


def test_facing_the_locked_door_is_found() -> None:
    changes = changed((5, 4, "."), (6, 8, "#"), (6, 5, "R"), (6, 4, "#"), (5, 5, "S"))
    assert "locked door not in front" in broken_rules(layout(changes))
    assert "locked door not in front" not in broken_rules(layout(changes, heading=90))


@pytest.mark.parametrize(("position", "heading"), [((1.0, 1.5), 0.0), ((1.5, 1.5), 0.1)])
def test_starts_between_tiles_or_quarter_turns(
    position: tuple[float, float], heading: float
) -> None:
    with pytest.raises(ValueError, match="between tiles"):
        from_tilemap(parse_ascii(DRAWN), np.array(position), heading)
