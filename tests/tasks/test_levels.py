"""From levels on the device back to the doors of a map. Whole maps: test_key_corridor.py."""

import numpy as np

from jaxenstein.maps.ascii import parse_ascii
from jaxenstein.tasks.levels import closed_doors


def test_closed_doors_are_found_by_their_places() -> None:
    tilemap = parse_ascii("######\n#SrRb#\n#..BG#\n######", "doors", goal_required=False)
    places = [(door.column, door.row) for door in tilemap.doors]
    assert len(places) == 2
    # A level that has them the other way round, between doors that are not there.
    level = np.array([(0, 0), places[1], (0, 0), places[0]])
    closed = np.array([[True, False, True, True], [True, True, True, False]])
    found = closed_doors(tilemap, level, closed)
    np.testing.assert_array_equal(found, [[True, False], [False, True]])
    np.testing.assert_array_equal(closed_doors(tilemap, level[:2], closed[0, :2]), [True, False])
    bare = parse_ascii("####\n#SG#\n####", "bare")
    assert closed_doors(bare, np.zeros((0, 2)), np.zeros((5, 0))).shape == (5, 0)
