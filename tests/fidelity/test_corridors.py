"""What is read off a KeyCorridor layout, on one drawn by hand, and what each broken rule shows."""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np
import pytest

from fidelity.corridors import broken_rules, from_minigrid, from_tilemap, observe
from jaxenstein.errors import MapWarning
from jaxenstein.maps import parse_ascii

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


def test_what_the_drawn_layout_shows() -> None:
    found = observe(layout())
    assert {table: found[table] for table in found if len(found[table]) == 1} == {
        "unlocked doors": ["6"],
        "of them between rows": ["3"],
        "western doors together": ["0,0-0,1 0,0-1,0 0,1-0,2"],
        "eastern doors together": ["locked 2: 1,0-2,0 1,1-2,1 2,0-2,1"],
        "locked row": ["2"],
        "key row": ["0"],
        "locked row, key row": ["2,0"],
        "locked colour": ["red"],
        "unlocked in the locked colour": ["3"],
        "locked door's place": ["1"],
        "key in its room": ["1,1"],
        "goal in its room": ["0,0"],
        "start": ["5,4"],
        "heading": ["east"],
        "start, heading, locked row": ["5,4 east 2"],
        "beside the locked door": ["no"],
        "in front": ["unlocked door"],
        "steps by way of the key": ["17"],
    }
    assert found["unlocked doors by wall"] == [
        "0,0-0,1", "0,0-1,0", "0,1-0,2", "1,0-2,0", "1,1-2,1", "2,0-2,1",
    ]  # fmt: skip
    assert sorted(found["unlocked colours"]) == ["green", "grey", "purple", "red", "red", "red"]
    assert found["places of doors between columns"] == ["1", "1", "0"]
    assert found["places of doors between rows"] == ["1", "1", "0"]


@pytest.mark.parametrize(
    ("heading", "name", "front"),
    [(90, "south", "floor"), (180, "west", "floor"), (270, "north", "floor"), (360, "east", "")],
)
def test_headings(heading: float, name: str, front: str) -> None:
    found = observe(layout(heading=heading))
    assert found["heading"] == [name]
    assert found["in front"] == [front or "unlocked door"]


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
    assert observe(layout(changes, heading=90))["beside the locked door"] == ["south"]


@pytest.mark.parametrize(("position", "heading"), [((1.0, 1.5), 0.0), ((1.5, 1.5), 0.1)])
def test_starts_between_tiles_or_quarter_turns(
    position: tuple[float, float], heading: float
) -> None:
    with pytest.raises(ValueError, match="between tiles"):
        from_tilemap(parse_ascii(DRAWN), np.array(position), heading)


def test_minigrid_keeps_the_rules() -> None:
    pytest.importorskip("minigrid")
    from fidelity.minigrid_layouts import SIZES, minigrid_layouts

    for size in SIZES:
        for found in minigrid_layouts(size, 10, seed=0):
            assert broken_rules(found) == []


def test_minigrid_is_read_object_by_object() -> None:
    pytest.importorskip("minigrid")
    gymnasium = pytest.importorskip("gymnasium")
    env = gymnasium.make("MiniGrid-KeyCorridorS4R3-v0").unwrapped
    env.reset(seed=1)
    found = from_minigrid(env)
    text = found.tilemap.tile_text().splitlines()
    for row, line in enumerate(text):
        for column, mark in enumerate(line):
            thing = env.grid.get(column, row)
            kind = getattr(thing, "type", "")
            if kind == "door":
                kind += " locked" if thing.is_locked else " closed"
            expected = {"#": "wall", ".": "", "S": "", "G": "ball"}.get(mark)
            if expected is None:
                expected = "key" if mark in "rnbpye" else "door locked"
                expected = expected if mark.isalpha() else "door closed"
            assert kind == expected, (column, row)
    assert found.start == tuple(env.agent_pos)
    assert found.heading == env.agent_dir
    assert found.locked.colour == found.tilemap.keys[0].colour
