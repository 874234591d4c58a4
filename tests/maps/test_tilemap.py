"""Tile maps: arrays, equality, and refused contradictions."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from jaxenstein.errors import MapError
from jaxenstein.maps import MAX_SIZE, Door, Item, Key, TileMap, parse_ascii
from jaxenstein.maps.symbols import door_label
from jaxenstein.maps.things import GOAL, IMP, MEDKIT

RED_LOCKED = door_label(0, locked=True)
UNLOCKED = bytes([door_label(0, locked=False)])
TILES = (bytes([2, 2, 2, 2]), bytes([2, 0, 0, RED_LOCKED]), bytes([2, 2, 3, 2]))
DOOR = Door(3, 1, 0, True)


def build(**parts: object) -> TileMap:
    return TileMap(**{"name": "test", "tiles": TILES, "doors": (DOOR,), **parts})  # type: ignore


def test_arrays() -> None:
    tilemap = build(keys=(Key(1, 1, 0),), goals=((2, 1),))
    assert (tilemap.rows, tilemap.columns) == (3, 4)
    assert tilemap.walls.dtype == np.uint8
    np.testing.assert_array_equal(tilemap.walls, [list(row) for row in TILES])
    np.testing.assert_array_equal(tilemap.door_tiles, [[3, 1]])
    assert tilemap.door_tiles.dtype == np.int32
    assert TileMap("open", (b"\0",)).door_tiles.shape == (0, 2)


def test_faces_become_four_arrays() -> None:
    other = (TILES[0], TILES[1], bytes([2, 2, 9, 2]))
    walls = build(faces=(TILES, other, TILES, TILES)).walls
    assert walls.shape == (4, 3, 4)
    assert walls.dtype == np.uint8
    np.testing.assert_array_equal(walls[:, 2, 2], [3, 9, 3, 3])


def test_equal_maps_hash_alike() -> None:
    assert build() == build()
    assert len({build(), build(), build(goals=((1, 1),))}) == 2


def test_with_spawns() -> None:
    tilemap = build(spawns=((1, 1),), goals=((2, 1),))
    moved = tilemap.with_spawns(np.array([[2, 1]]))  # type: ignore[arg-type]
    assert moved.spawns == ((2, 1),)
    assert moved.with_spawns([(1, 1)]) == tilemap


@pytest.mark.parametrize("cell", [(0, 0), (3, 1), (-1, 1), (1, -1), (4, 1), (1, 3)])
def test_with_spawns_refuses_non_floor_tiles(cell: tuple[int, int]) -> None:
    with pytest.raises(MapError, match=f"spawn at column {cell[0]}, row {cell[1]} "):
        build().with_spawns([cell])


def test_with_spawns_refuses_empty_list() -> None:
    with pytest.raises(MapError, match="at least one spawn"):
        build().with_spawns(())


LONG = (bytes(MAX_SIZE + 1),)


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"tiles": ()}, "empty"),
        ({"tiles": (b"",)}, "empty"),
        ({"tiles": [b"\0"]}, "tuple of bytes"),
        ({"tiles": (b"\0", b"\0\0")}, "equal lengths"),
        ({"tiles": LONG}, "too large"),
        ({"tiles": (b"\0",) * (MAX_SIZE + 1)}, "too large"),
        ({"tiles": (b"\1",)}, "label 1 is neither"),
        ({"tiles": (bytes([GOAL.label]),)}, f"label {GOAL.label} is neither"),
        ({"doors": ()}, "doors"),
        ({"doors": (DOOR, DOOR)}, "doors"),
        ({"doors": (Door(3, 1, 0, False),)}, "doors"),
        ({"doors": [DOOR]}, "doors of a map must be a tuple"),
        ({"doors": (Door(3, 1, 9, True),)}, "colour index must be .*, not 9"),
        ({"goals": ((0, 0),)}, "goal at column 0, row 0"),
        ({"goals": ((1, 1), (1, 1))}, "two goals"),
        ({"goals": [(1, 1)]}, "goals of a map must be a tuple"),
        ({"apples": ((0, 0),)}, "apple at column 0, row 0"),
        ({"apples": ((1, 1), (1, 1))}, "two apples"),
        ({"apples": [(1, 1)]}, "apples of a map must be a tuple"),
        ({"keys": (Key(3, 1, 0),)}, "key at column 3, row 1"),
        ({"keys": (Key(1, 1, 0), Key(1, 1, 1))}, "two keys"),
        ({"keys": (Key(1, 1, 6),)}, "colour index must be .*, not 6"),
        ({"items": (Item(0, 0, IMP.label),)}, "item at column 0, row 0"),
        ({"items": (Item(1, 1, IMP.label), Item(1, 1, MEDKIT.label))}, "two items"),
        ({"items": (Item(1, 1, GOAL.label),)}, f"label {GOAL.label} is not a monster"),
        ({"faces": (TILES,) * 3}, "four kinds"),
        ({"faces": (TILES[:2],) * 4}, "solid tiles"),
        ({"faces": (TILES, TILES, TILES, (TILES[0], TILES[0], TILES[2]))}, "solid tiles"),
        ({"faces": (TILES, TILES, TILES, (TILES[0], b"\2\0\0\2", TILES[2]))}, "door"),
        ({"faces": (TILES, TILES, TILES, (UNLOCKED + b"\2\2\2", *TILES[1:]))}, "door"),
    ],
)
def test_contradictions_are_refused(parts: dict, message: str) -> None:
    with pytest.raises(MapError, match=message):
        build(**parts)


def test_tile_text_shows_one_thing_per_tile() -> None:
    assert build(spawns=((1, 1), (2, 1)), goals=((2, 1),)).tile_text() == "####\n#SGR\n##1#\n"
    both = build(goals=((1, 1),), keys=(Key(1, 1, 2),))
    assert both.tile_text().splitlines()[1] == "#b.R"
    apples = build(apples=((1, 1), (2, 1)), spawns=((2, 1),))
    assert apples.tile_text().splitlines()[1] == "#a@R"
    covered = build(apples=((1, 1), (2, 1)), goals=((1, 1),), keys=(Key(2, 1, 0),))
    assert covered.tile_text().splitlines()[1] == "#GrR"
    items = build(items=(Item(1, 1, IMP.label), Item(2, 1, MEDKIT.label)), goals=((2, 1),))
    assert items.tile_text().splitlines()[1] == "#i+R"


def test_maps_do_not_import_jax() -> None:
    program = (
        "import importlib.util, pathlib, sys, types\n"
        "root = pathlib.Path(sys.argv[1])\n"
        "package = types.ModuleType('jaxenstein')\n"
        "package.__path__ = [str(root)]\n"
        "sys.modules['jaxenstein'] = package\n"
        "import jaxenstein.maps as maps\n"
        "maps.load_layout('my-way-home')\n"
        "assert 'jax' not in sys.modules\n"
    )
    import jaxenstein

    root = str(jaxenstein.__path__[0])
    subprocess.run([sys.executable, "-c", program, root], check=True)


def test_map_can_have_the_largest_size() -> None:
    side = MAX_SIZE
    text = "S" + "." * (side - 2) + "G"
    tilemap = parse_ascii("\n".join([text] + ["." * side] * (side - 1)))
    assert (tilemap.rows, tilemap.columns) == (side, side)
