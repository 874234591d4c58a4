"""The errors of views, against rows and depths computed here."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fidelity.view_errors import (
    Projection,
    around,
    jumps,
    match_jumps,
    near_jumps,
)
from fidelity.vizdoom_screen import DepthScale, View
from fidelity.vizdoom_view import cast_views, errors_of
from jaxenstein.tasks.doom.lattice import rasterise
from jaxenstein.tasks.doom.walls import DoomMap, Line

SCREEN = Projection(height=240, focal=192.0, ceiling=128.0)


def test_edges_of_a_wall_at_the_focal_distance() -> None:
    top, bottom = SCREEN.edges(np.array([192.0, 384.0]), 41.0)
    assert top.tolist() == [120 - 87, 120 - 43.5]
    assert bottom.tolist() == [120 + 41, 120 + 20.5]


@settings(deadline=None)
@given(st.floats(200, 900), st.floats(30, 50))
def test_depth_follows_from_the_rows(depth: float, eye: float) -> None:
    top, bottom = SCREEN.edges(np.array([depth]), eye)
    found = SCREEN.depth_of(np.rint(top), np.rint(bottom), eye)
    # A row more or less at one edge, of a wall that is that many rows high.
    assert abs(found[0] / depth - 1) <= 1.01 / (bottom[0] - top[0] - 1)


def test_depth_of_near_walls_by_the_lower_edge_alone() -> None:
    top, bottom = np.array([0, 0]), np.array([202, 240])
    found = SCREEN.depth_of(top, bottom, 41.0)
    assert found[0] == pytest.approx(192 * 41 / 82)
    assert math.isnan(found[1])


def test_jumps_stand_before_their_column_and_match_within_reach() -> None:
    real = np.array([100.0] * 10 + [300.0] * 10 + [120.0] * 12)
    assert jumps(real).tolist() == [10, 20]
    assert match_jumps(real, np.roll(real, 2)) == [2, 2]
    assert match_jumps(real, real) == [0, 0]
    # The other way or too far off is none.
    assert match_jumps(real, 400 - real) == [None, None]
    assert match_jumps(real, np.full(32, 100.0)) == [None, None]
    assert np.flatnonzero(near_jumps(real)).tolist() == [9, 10, 19, 20]


def test_slow_changes_and_small_ones_are_no_jumps() -> None:
    assert not len(jumps(100 * 1.1 ** np.arange(20)))
    assert not len(jumps(np.array([20.0, 35.0, 20.0])))


def test_rows_within_the_range_of_the_next_columns() -> None:
    edge = np.array([10.0, 12.0, 20.0, 20.0])
    assert around(np.array([9.0, 19.0, 11.0, 21.5]), edge).tolist() == [1.0, 0.0, 1.0, 1.5]


ROOM = 512.0
SCALE = DepthScale(step=7.0, offset=5.0, quantum=1, worst=0.0, samples=0)


def depths_in_the_room(x: float, y: float, angle: float, width: int) -> np.ndarray:
    """Perpendicular depths in an empty square room from 0 to `ROOM`, by the crossing of lines."""
    depths = []
    for column in range(width):
        slope = 2 * (column + 0.5) / width - 1
        turn = math.radians(angle)
        # To the right is clockwise, with y to the north.
        dx, dy = math.cos(turn) + slope * math.sin(turn), math.sin(turn) - slope * math.cos(turn)
        along_x = ((ROOM if dx > 0 else 0) - x) / dx if dx else math.inf
        along_y = ((ROOM if dy > 0 else 0) - y) / dy if dy else math.inf
        depths.append(min(along_x, along_y))
    return np.array(depths)


def view_in_the_room(x: float, y: float, angle: float, eye: float) -> View:
    """A screen as a perfect game would draw it, 320x240."""
    depth = depths_in_the_room(x, y, angle, 320)
    top, bottom = SCREEN.edges(depth, eye)
    return View(
        x=x,
        y=y,
        angle=angle,
        eye=eye,
        top=np.clip(np.rint(top), 0, 240).astype(int),
        bottom=np.clip(np.rint(bottom), 0, 240).astype(int),
        value=SCALE.value_of(depth).astype(int),
        sprite=np.zeros(320, bool),
    )


def test_a_perfect_screen_agrees_and_a_wrong_heading_does_not() -> None:
    corners = [(0, 512), (512, 512), (512, 0), (0, 0), (0, 512)]
    walls = tuple(Line(*one, *other, "-") for one, other in itertools.pairwise(corners))
    tiles = rasterise(DoomMap(walls, (), 0.0, 128.0, 160.0))
    views = [
        view_in_the_room(*pose)
        for pose in ((100.5, 200.25, 10.0, 41.0), (300.0, 77.7, 200.0, 38.0), (256, 256, 91, 44))
    ]
    ours, wrong = (
        errors_of(views, cast_views(views, tiles, 320, turned), SCALE, SCREEN)
        for turned in (0.0, 1.0)
    )
    assert ours["edges of walls on the screen (a column has up to two)"] > 1000
    assert ours["share of them within one row"] == 1.0
    assert ours["rows by which they are off, 95 %"] < 0.51
    assert ours["columns in the depth buffer"] == 960
    assert ours["share of them with the same value"] > 0.99
    assert wrong["share of them within one row"] < 0.9
