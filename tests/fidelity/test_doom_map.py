"""UDMF texts, written here."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fidelity.doom_map import read_map
from jaxenstein.errors import MapError
from jaxenstein.tasks.doom.maps import MAP_SPOT, Line, MapThing, ends_of, load_map, parse_map
from jaxenstein.tasks.doom.wad import Wad

# Clockwise, like Doom's walls around a room.
CORNERS = [(0, 64), (32, 64), (32, 0), (0, 0)]


def udmf(
    corners: list[tuple[int, int]] = CORNERS, extra: str = "", ceilings: tuple[int, ...] = (128,)
) -> str:
    """The text of a map of one closed chain of walls."""
    text = 'namespace = "zdoom"; // a global field\n'
    for number, (x, y) in enumerate(corners):
        after = (number + 1) % len(corners)
        text += f"Vertex // {number}\n{{ x = {x}.000; Y = {y}; }}\n"
        text += f"linedef {{ v1 = {number}; v2 = {after}; sidefront = {number}; }}\n"
        text += f'sidedef {{ sector = 0; texturemiddle = "T{number}"; }}\n'
    text += "".join(f"sector {{ heightceiling = {height}; }}\n" for height in ceilings)
    return (
        text + f"thing {{ type = {MAP_SPOT}; id = 10; x = 8; y = 8.5; }} /* two\nlines */" + extra
    )


def test_map_is_read() -> None:
    found = read_map(udmf(extra="thing { type = 1; x = 1; y = -2; }"))
    assert found.walls == (
        Line(0, 64, 32, 64, "T0"),
        Line(32, 64, 32, 0, "T1"),
        Line(32, 0, 0, 0, "T2"),
        Line(0, 0, 0, 64, "T3"),
    )
    # By kind and id.
    assert found.things == (MapThing(1, 0, 1.0, -2.0), MapThing(MAP_SPOT, 10, 8.0, 8.5))
    assert (found.floor, found.ceiling, found.light) == (0, 128, 160)
    inner = "linedef { v1 = 0; v2 = 2; sidefront = 0; sideback = 1; }"
    assert read_map(udmf(extra=inner)) == read_map(udmf())
    rail = read_map(udmf(extra=inner.replace("}", "blocking = true; }")))
    assert (rail.walls, rail.rails) == (found.walls, (Line(0, 64, 32, 0, "-"),))


def test_a_map_of_oblique_walls_and_broken_numbers_is_written_as_it_was_read() -> None:
    extra = "vertex { x = -8.125; y = 100; } linedef { v1 = 4; v2 = 1; sidefront = 4; }"
    extra += 'sidedef { texturemiddle = "T4"; offsetx = 7; }'
    found = read_map(udmf(extra=extra))
    assert found.walls[4] == Line(-8.125, 100, 32, 64, "T4", 7)
    assert parse_map(found.text()) == found
    # Bodies meet walls on whole numbers.
    np.testing.assert_array_equal(ends_of(found.walls)[4], [[-8, 100], [32, 64]])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (udmf().replace("sector = 0;", "sector = 0; offsetx = 0.5;"), "0 has an offset of 0.5"),
        (udmf(ceilings=(128, 96)), "one heightceiling in common, not 96, 128"),
        (udmf(ceilings=()), "one heightfloor in common, not none"),
        ("vertex { x = 1;", "neither a block nor a field: vertex {"),
        ("vertex { x = 1 }", "neither a block nor a field: x = 1"),
        ('thing { s = "open; }', "neither a block nor a field: s ="),
    ],
)
def test_unsupported_maps_are_refused(text: str, message: str) -> None:
    with pytest.raises(MapError, match=message):
        read_map(text)


@pytest.mark.parametrize("name", ["my-way-home", "defend-the-center", "deadly-corridor"])
def test_packaged_maps_equal_maps_of_the_game(name: str) -> None:
    """The packaged maps equal the maps of the game, if it is installed."""
    vizdoom = pytest.importorskip("vizdoom")
    path = Path(vizdoom.scenarios_path) / f"{name.replace('-', '_')}.wad"
    assert read_map(Wad(path).lump("TEXTMAP").decode()) == load_map(name)
