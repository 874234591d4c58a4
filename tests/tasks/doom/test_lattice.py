"""A small map of Doom's kind, written here, as tiles."""

from __future__ import annotations

import numpy as np
import pytest

from jaxenstein.errors import MapError
from jaxenstein.tasks.doom.maps import MAP_SPOT, WALL, DoomMap, Line, MapThing, rasterise

# Clockwise, as Doom's walls go around what they enclose: an L, its foot to the east.
CORNERS = [(0, 64), (32, 64), (32, 32), (64, 32), (64, 0), (0, 0)]
TEXTURES = ["NORTH", "STEM", "FOOT", "EAST", "SOUTH", "WEST"]
SPOT = MapThing(MAP_SPOT, 10, 8.0, 8.0)


def doom_map(corners: list[tuple[int, int]] = CORNERS) -> DoomMap:
    """A map of one closed chain of walls."""
    ends = zip(corners, [*corners[1:], corners[0]], TEXTURES, strict=False)
    walls = tuple(Line(*one, *other, texture) for one, other, texture in ends)
    return DoomMap(walls, (SPOT,), 0.0, 128.0, 160.0)


def test_tiles_of_an_l_shaped_room() -> None:
    tiles = rasterise(doom_map())
    assert (tiles.west, tiles.north, tiles.unit) == (-16, 80, 16)
    assert ["".join("#" if solid else "." for solid in row) for row in tiles.solid] == [
        "######",
        "#..###",
        "#..###",
        "#....#",
        "#....#",
        "######",
    ]
    column, row = tiles.to_position(SPOT.x, SPOT.y)
    assert (column, row) == (1.5, 4.5)


def test_each_face_shows_the_texture_of_its_wall() -> None:
    tiles = rasterise(doom_map())
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
    tiles = rasterise(doom_map())
    shifts = ((0, 1), (0, -1), (1, 0), (-1, 0))
    for face, (down, right) in zip(tiles.faces, shifts, strict=True):
        # The tile before each face, since the face looks the other way.
        before = np.roll(~tiles.solid, (down, right), (0, 1))
        assert ((face > WALL) == (tiles.solid & before)).all()


def test_level_is_solid_exactly_at_its_tiles() -> None:
    tiles = rasterise(doom_map())
    level = tiles.level()
    rows = np.asarray(level.row_bits)[:, 0]
    bits = (rows[:, None] >> np.arange(6, dtype=np.uint32)) & np.uint32(1)
    assert (bits.astype(bool) == tiles.solid).all()
    assert level.margin == 0


def test_poses_are_mirrored() -> None:
    tiles = rasterise(doom_map())
    assert tiles.to_position(-16, 80) == (0.0, 0.0)
    assert tiles.to_position(8, 56) == (1.5, 1.5)


def test_walls_off_the_lattice_are_refused() -> None:
    with pytest.raises(MapError, match="is not on a lattice of 16"):
        rasterise(doom_map([(0, 24), (32, 24), (32, 0), (0, 0)]))


def test_chain_in_wrong_direction_is_refused() -> None:
    with pytest.raises(MapError, match="has its open side on the left"):
        rasterise(doom_map(CORNERS[::-1]))
