"""Maps made to measure: what they are said to be."""

import warnings

import pytest

import jaxenstein
from benchmarks.subjects.maps import MOST_SPRITES, hall, rooms
from jaxenstein.maps.ascii import parse_ascii
from jaxenstein.maps.reach import flood, open_tiles


@pytest.mark.parametrize("side", [9, 10, 16, 17, 33, 64, 256])
def test_rooms(side):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        tilemap = parse_ascii(rooms(side), "rooms")
    assert (tilemap.columns, tilemap.rows) == (side, side)
    assert len(tilemap.goals) == 1
    # A start in each room whose middle is on the map, all connected.
    assert len(tilemap.spawns) == len(range(4, side - 1, 8)) ** 2
    seen = flood(open_tiles(tilemap), tilemap.goals)
    assert all(seen[row, column] for column, row in tilemap.spawns)


def test_one_sees_as_much_in_a_large_map_as_in_a_small_one():
    """The longest open line anywhere does not grow with the map, but for the openings in line."""
    for side in (17, 129):
        inner = [row[1:-1] for row in rooms(side).splitlines() if set(row) != {"#"}]
        lengths = sorted(max(map(len, row.split("#"))) for row in inner)
        assert lengths[len(lengths) // 2] == 7


@pytest.mark.parametrize("sprites", [1, 2, 7, 64, MOST_SPRITES])
def test_hall(sprites):
    env, _ = jaxenstein.from_ascii(hall(sprites))
    assert env.map_size == (32, 32)
    assert len(env.tilemap.goals) + len(env.tilemap.keys) == sprites
    assert not set(env.tilemap.spawns) & {(key.column, key.row) for key in env.tilemap.keys}


@pytest.mark.parametrize("make", [lambda: rooms(8), lambda: rooms(257), lambda: hall(0),
                                  lambda: hall(MOST_SPRITES + 1)])  # fmt: skip
def test_what_does_not_fit_is_refused(make):
    with pytest.raises(ValueError, match=r"tiles a side|fit into the hall"):
        make()
