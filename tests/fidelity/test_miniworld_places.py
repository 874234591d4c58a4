"""The numbers that the comparison with MiniWorld takes from a first state."""

import numpy as np
import pytest

from fidelity.miniworld_places import First, distance, numbers


def test_paths_through_a_maze_and_around_things() -> None:
    """A fork with three ends and the box two cells away; three things in a square's corners."""
    ways = [((0, 0), (1, 0)), ((1, 0), (2, 0)), ((1, 0), (1, 1))]
    first = First(np.array([0.0, 0.0]), -0.5, np.array([[1.0, 1.0]]), ways)
    found = numbers("maze", first)
    assert (found["ends"], found["forks"], found["way"]) == (3, 1, 2)
    assert found["heading"] == pytest.approx(2 * np.pi - 0.5)
    corners = np.array([[3.0, 3.0], [3.0, 0.0], [0.0, 3.0]])
    first = First(np.array([0.0, 0.0]), 0.0, corners, [])
    assert numbers("pickup-objects", first)["way"] == 9
    assert numbers("collect-health", first)["apart"] == 3


def test_distance_between_two_samples() -> None:
    assert distance(np.array([0.0, 1.0, 2.0, 3.0]), np.array([2.0, 3.0])) == 0.5
