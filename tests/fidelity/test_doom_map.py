"""A small map of Doom's kind, written here, as tiles."""

from __future__ import annotations

import importlib.util
import math

import numpy as np
import pytest

from fidelity import doom_map
from fidelity.doom_map import (
    MissingViZDoomError,
    heading_of,
    load_my_way_home,
    read_map,
)
from jaxenstein.errors import MapError
from jaxenstein.tasks.doom.lattice import WALL, rasterise
from jaxenstein.tasks.doom.walls import MAP_SPOT

# Clockwise, as Doom's walls go around what they enclose: an L, its foot to the east.
CORNERS = [(0, 64), (32, 64), (32, 32), (64, 32), (64, 0), (0, 0)]
TEXTURES = ["NORTH", "STEM", "FOOT", "EAST", "SOUTH", "WEST"]


def udmf(
    corners: list[tuple[int, int]] = CORNERS,
    textures: list[str] = TEXTURES,
    extra: str = "",
    ceilings: tuple[int, ...] = (128,),
) -> str:
    """The text of a map of one closed chain of walls."""
    text = 'namespace = "zdoom";\n'
    for x, y in corners:
        text += f"vertex {{ x = {x}; y = {y}; }}\n"
    for number, texture in enumerate(textures):
        after = (number + 1) % len(corners)
        text += f"linedef {{ v1 = {number}; v2 = {after}; sidefront = {number}; }}\n"
        text += f'sidedef {{ sector = 0; texturemiddle = "{texture}"; }}\n'
    for ceiling in ceilings:
        text += f"sector {{ heightceiling = {ceiling}; }}\n"
    return text + f"thing {{ type = {MAP_SPOT}; id = 10; x = 8; y = 8; }}\n" + extra


def test_the_tiles_of_an_l() -> None:
    tiles = rasterise(read_map(udmf()))
    assert (tiles.west, tiles.north, tiles.unit) == (-16, 80, 16)
    assert tiles.text(read_map(udmf()).things).splitlines() == [
        "######",
        "#..###",
        "#..###",
        "#....#",
        "#S...#",
        "######",
    ]


def test_each_face_shows_the_texture_of_its_wall() -> None:
    tiles = rasterise(read_map(udmf()))
    label = {name: WALL + 1 + number for number, name in enumerate(tiles.textures)}
    west, east, north, south = tiles.faces
    # The wall that bounds the room in the west has its face on the tiles' east side.
    assert (east[1:5, 0] == label["WEST"]).all()
    assert (west[1:3, 3] == label["STEM"]).all()
    assert (west[3:5, 5] == label["EAST"]).all()
    assert (south[0, 1:3] == label["NORTH"]).all()
    assert (south[2, 3:5] == label["FOOT"]).all()
    assert (north[5, 1:5] == label["SOUTH"]).all()
    assert ((tiles.faces == 0) == ~tiles.solid).all()
    assert (tiles.faces > WALL).sum() == 4 + 2 + 2 + 2 + 2 + 4


def test_every_open_edge_has_a_texture() -> None:
    tiles = rasterise(read_map(udmf()))
    shifts = ((0, 1), (0, -1), (1, 0), (-1, 0))
    for face, (down, right) in zip(tiles.faces, shifts, strict=True):
        # The tile before each face, since the face looks the other way.
        before = np.roll(~tiles.solid, (down, right), (0, 1))
        assert ((face > WALL) == (tiles.solid & before)).all()


def test_the_level_is_solid_where_the_tiles_are() -> None:
    tiles = rasterise(read_map(udmf()))
    level = tiles.level()
    rows = np.asarray(level.row_bits)[:, 0]
    bits = (rows[:, None] >> np.arange(6, dtype=np.uint32)) & np.uint32(1)
    assert (bits.astype(bool) == tiles.solid).all()
    assert level.margin == 0


def test_poses_are_mirrored() -> None:
    tiles = rasterise(read_map(udmf()))
    assert tiles.to_position(-16, 80) == (0.0, 0.0)
    assert tiles.to_position(8, 56) == (1.5, 1.5)
    for angle, direction in ((0, (1, 0)), (90, (0, -1)), (180, (-1, 0)), (270, (0, 1))):
        heading = heading_of(angle)
        assert (math.cos(heading), math.sin(heading)) == pytest.approx(direction, abs=1e-12)


def test_room_for_a_body() -> None:
    tiles = rasterise(read_map(udmf()))
    assert tiles.is_free(16, 16, 16)
    assert not tiles.is_free(15.9, 16, 16)
    assert tiles.is_free(16, 48, 16)
    assert not tiles.is_free(17, 48, 16)
    assert not tiles.is_free(48, 48, 1)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (udmf([(0, 64), (32, 60), *CORNERS[2:]]), r"linedef 0 from \(0, 64\) to \(32, 60\) runs"),
        (udmf(ceilings=(128, 96)), "one heightceiling in common, not 96, 128"),
        (udmf(ceilings=()), "one heightfloor in common, not none"),
        (udmf(extra="linedef { v1 = 0; v2 = 9; sidefront = 0; }"), "'v2' is 9, not one of 0 to 5"),
        (
            udmf(extra="linedef { v1 = 0; v2 = 3; sidefront = 0; sideback = 1; blocking = true; }"),
            "linedef 6 blocks, but both its sides are open",
        ),
        ("sector { heightceiling = 8; }", "no walls"),
    ],
)
def test_maps_that_tiles_cannot_hold_are_refused(text: str, message: str) -> None:
    with pytest.raises(MapError, match=message):
        read_map(text)


def test_walls_off_the_lattice_are_refused() -> None:
    with pytest.raises(MapError, match="does not stand on a lattice of 16"):
        rasterise(read_map(udmf([(0, 24), (32, 24), (32, 0), (0, 0)], TEXTURES[:4])))


def test_a_chain_the_wrong_way_around_is_refused() -> None:
    with pytest.raises(MapError, match="has its open side on the left"):
        rasterise(read_map(udmf(CORNERS[::-1])))


def test_open_lines_inside_a_room_are_no_walls() -> None:
    inner = "linedef { v1 = 0; v2 = 3; sidefront = 0; sideback = 1; }"
    assert (rasterise(read_map(udmf(extra=inner))).solid == rasterise(read_map(udmf())).solid).all()


def test_without_vizdoom_the_message_names_the_extra(monkeypatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(MissingViZDoomError, match=r"pip install '\.\[bench\]'"):
        load_my_way_home()
    assert issubclass(doom_map.MissingViZDoomError, ImportError)
