"""The maps that come with the package."""

from __future__ import annotations

import numpy as np
import pytest

from jaxenstein.errors import MapError
from jaxenstein.maps import Door, Key, layout_names, load_layout
from jaxenstein.maps.reach import flood, open_tiles
from jaxenstein.maps.symbols import SYMBOLS

# Map units of the scenario's sectors 0 to 7, its rooms: lowest and highest x, then y.
ROOMS = (
    (160, 320, -256, -96),
    (384, 544, -256, -96),
    (384, 544, -32, 128),
    (608, 768, -256, -96),
    (608, 768, -32, 128),
    (384, 544, -544, -384),
    (960, 1120, -32, 128),
    (960, 1120, -256, -96),
)
# The scenario's map spots 10 to 26, its starts.
SPOTS = (
    (240, -176),
    (464, -176),
    (470.331, -321.672),
    (466.983, -466.749),
    (460.326, -596.12),
    (543.986, -672.089),
    (575.372, -171.77),
    (686.83, -173.247),
    (686.646, -62.382),
    (464.098, -60.496),
    (460.326, 56.436),
    (571.6, 54.55),
    (694.19, 58.322),
    (871.474, 54.55),
    (1043.1, 60.208),
    (1039.737, -61.676),
    (1039.328, -169.884),
)
BRICK = SYMBOLS["9"].label


def tile_of(x: float, y: float) -> tuple[int, int]:
    return int((x - 160) // 32 + 1), int((128 - y) // 32 + 1)


def test_names() -> None:
    assert layout_names() == ("key-door", "my-way-home", "simple")
    with pytest.raises(MapError, match="did you mean 'simple'"):
        load_layout("simpel")
    with pytest.raises(MapError, match="unknown layout"):
        load_layout("../ascii")
    with pytest.raises(MapError, match="unknown layout"):
        load_layout("my-way-home.regions")


def test_simple() -> None:
    tilemap = load_layout("simple")
    assert (tilemap.columns, tilemap.rows) == (9, 5)
    solid = tilemap.walls != 0
    assert not solid[1:4, 1:8][[0, 2]].any()
    assert solid[2, 2:7].all()
    assert (~solid).sum() == 16
    assert tilemap.spawns == ((1, 1),)
    assert tilemap.goals == ((7, 3),)


def test_key_door() -> None:
    tilemap = load_layout("key-door")
    assert (tilemap.columns, tilemap.rows) == (11, 3)
    assert tilemap.spawns == ((1, 1),)
    assert tilemap.keys == (Key(3, 1, 0),)
    assert tilemap.doors == (Door(5, 1, 0, True),)
    assert tilemap.goals == ((9, 1),)
    assert [tile == 0 for tile in tilemap.tiles[1]] == [
        *[False],
        *[True] * 4,
        False,
        *[True] * 4,
        False,
    ]


def test_my_way_home_is_the_scenarios_map() -> None:
    tilemap = load_layout("my-way-home")
    floor = open_tiles(tilemap)
    assert floor.sum() == 275
    assert len(tilemap.spawns) == 17
    assert set(tilemap.spawns) == {tile_of(x, y) for x, y in SPOTS}
    assert tilemap.goals == (tile_of(1040, -352),)
    np.testing.assert_array_equal(flood(floor, tilemap.goals), floor)


def test_my_way_home_rooms_have_their_own_walls() -> None:
    tilemap = load_layout("my-way-home")
    assert tilemap.faces is not None
    colours = np.full((tilemap.rows, tilemap.columns), BRICK)
    for room, (west, east, south, north) in enumerate(ROOMS):
        left, top = tile_of(west, north)
        right, bottom = tile_of(east, south)
        assert open_tiles(tilemap)[top:bottom, left:right].all()
        colours[top:bottom, left:right] = SYMBOLS[str(room + 1)].label
    seen: dict[int, int] = {}
    for row, column in np.argwhere(open_tiles(tilemap)):
        # The wall to the west is seen from its east face, and so on.
        for face, dx, dy in ((1, -1, 0), (0, 1, 0), (3, 0, -1), (2, 0, 1)):
            shown = tilemap.faces[face][row + dy][column + dx]
            if shown:
                assert shown == colours[row, column], (column, row)
                seen[shown] = seen.get(shown, 0) + 1
    assert sorted(seen) == [*(SYMBOLS[str(room)].label for room in range(1, 9)), BRICK]


def test_my_way_home_without_colours_is_the_same_map() -> None:
    plain = load_layout("my-way-home", regions=False)
    painted = load_layout("my-way-home")
    assert plain.faces is None
    assert set(np.unique(plain.walls)) == {0, 2}
    assert (plain.tiles, plain.spawns, plain.goals) == (
        painted.tiles,
        painted.spawns,
        painted.goals,
    )
