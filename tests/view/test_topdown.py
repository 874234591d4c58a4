"""The map from above: known places have known colours."""

from __future__ import annotations

import math

import numpy as np
import pytest
from PIL import Image

from jaxenstein.maps.ascii import parse_ascii
from jaxenstein.maps.symbols import LABEL_COLOURS, door_label, key_label
from jaxenstein.maps.tilemap import TileMap
from jaxenstein.view import topdown
from jaxenstein.view.topdown import MapPicture, draw_map, fitting_scale

SCALE = 20
TEXT = """\
###########
#S.r.R..G.#
#.#########
#.#########
#.........G
#..........
###########
"""


@pytest.fixture(scope="module")
def tilemap() -> TileMap:
    return parse_ascii(TEXT, "test")


def paint(label: int) -> tuple[int, ...]:
    return tuple(int(part) for part in LABEL_COLOURS[label])


def pixel(picture: MapPicture, x: float, y: float) -> tuple[int, ...]:
    image = picture.image()
    found = image.getpixel((int(x * picture.scale), int(y * picture.scale)))
    assert isinstance(found, tuple)
    return tuple(found)


def test_size_is_a_whole_number_of_pixels_a_tile(tilemap: TileMap) -> None:
    assert draw_map(tilemap, scale=SCALE).image().size == (11 * SCALE, 7 * SCALE)
    assert fitting_scale(tilemap, 480) == 43
    assert max(draw_map(tilemap, size=480).image().size) == 473


def test_floor_walls_and_rock(tilemap: TileMap) -> None:
    picture = draw_map(tilemap, scale=SCALE)
    assert pixel(picture, 2.5, 1.5) == topdown.FLOOR
    assert pixel(picture, 4.5, 0.5) == paint(2)


def test_rock_is_where_nobody_can_look() -> None:
    solid = parse_ascii("######\n#SG###\n######\n######\n######", "solid")
    picture = draw_map(solid, scale=SCALE)
    assert pixel(picture, 1.5, 3.5) == topdown.ROCK
    assert pixel(picture, 5.5, 1.5) == topdown.ROCK
    assert pixel(picture, 3.5, 1.5) == paint(2)


def test_doors_close_and_open(tilemap: TileMap) -> None:
    closed = draw_map(tilemap, scale=SCALE).objects()
    opened = draw_map(tilemap, scale=SCALE).objects(np.array([True]))
    red = paint(door_label(0, locked=True))
    assert pixel(closed, 5.25, 1.25) == red
    assert pixel(closed, 5.5, 1.5) == topdown.glyphs.INK
    assert pixel(opened, 5.5, 1.5) == topdown.FLOOR
    # The posts stand at the walls, north and south of this door.
    assert pixel(opened, 5.5, 1.05) == red
    assert pixel(opened, 5.5, 1.95) == red
    assert pixel(opened, 5.05, 1.5) == topdown.FLOOR


def test_taken_keys_disappear(tilemap: TileMap) -> None:
    red = paint(key_label(0))
    lying = draw_map(tilemap, scale=SCALE).objects()
    taken = draw_map(tilemap, scale=SCALE).objects(taken=np.array([True]))
    assert pixel(lying, 3.6, 1.5) == red
    assert pixel(taken, 3.6, 1.5) == topdown.FLOOR


def test_the_goal_that_counts_stands_out(tilemap: TileMap) -> None:
    picture = draw_map(tilemap, scale=SCALE).objects(goal=1)
    assert pixel(picture, 10.5, 4.5) == topdown.GOAL
    assert pixel(picture, 8.5, 1.5) == topdown.FLOOR
    both = draw_map(tilemap, scale=SCALE).objects()
    assert pixel(both, 8.5, 1.5) == pixel(both, 10.5, 4.5) == topdown.GOAL


def test_path_is_drawn_where_it_went_and_coloured_by_time(tilemap: TileMap) -> None:
    path = np.array([[1.5, 4.5], [2.5, 4.5], [3.5, 4.5], [7.5, 4.5], [8.5, 4.5]])
    picture = draw_map(tilemap, scale=SCALE).path(path)
    assert pixel(picture, 1.8, 4.5) == topdown.PATH[0]
    assert pixel(picture, 8.0, 4.5) == topdown.blend(*topdown.PATH, 0.75)
    # A jump is a new start, not a movement; and nothing is drawn beside the line.
    assert pixel(picture, 5.5, 4.5) == topdown.FLOOR
    assert pixel(picture, 1.8, 4.75) == topdown.FLOOR


def test_path_in_pieces_is_the_same_path(tilemap: TileMap) -> None:
    path = np.column_stack([np.linspace(1.5, 8.5, 15), np.full(15, 4.5)])
    whole = draw_map(tilemap, scale=SCALE).path(path)
    pieces = draw_map(tilemap, scale=SCALE)
    for i in range(14):
        pieces.path(path[i : i + 2], i, 14)
    np.testing.assert_array_equal(np.asarray(whole.image()), np.asarray(pieces.image()))


def test_agent_points_along_its_heading(tilemap: TileMap) -> None:
    for heading, (dx, dy) in ((0.0, (1, 0)), (math.pi / 2, (0, 1)), (math.pi, (-1, 0))):
        picture = draw_map(tilemap, scale=SCALE).agent((5.0, 5.0), heading)
        assert pixel(picture, 5.0 + 0.25 * dx, 5.0 + 0.25 * dy) == topdown.AGENT
        assert pixel(picture, 5.0 - 0.35 * dx, 5.0 - 0.35 * dy) == topdown.FLOOR


def test_view_is_stopped_by_closed_doors_only(tilemap: TileMap) -> None:
    place = (2.5, 1.5)
    closed = draw_map(tilemap, scale=SCALE).agent(place, 0.0)
    opened = draw_map(tilemap, scale=SCALE).agent(place, 0.0, opened=np.array([True]))
    assert pixel(closed, 4.5, 1.5) == pixel(opened, 4.5, 1.5) != topdown.FLOOR
    assert pixel(closed, 7.0, 1.5) == topdown.FLOOR
    assert pixel(opened, 7.0, 1.5) == pixel(opened, 4.5, 1.5)
    assert pixel(opened, 2.0, 1.5) == topdown.FLOOR


def test_faces_show_their_own_colours() -> None:
    rows = ("####", "#SG#", "####")
    base = parse_ascii("\n".join(rows), "faces")
    tiles = tuple(bytes(2 if mark == "#" else 0 for mark in row) for row in rows)
    faces = tuple(
        tuple(bytes(look if tile else 0 for tile in row) for row in tiles) for look in (3, 4, 5, 6)
    )
    picture = draw_map(TileMap("faces", tiles, faces, base.spawns, base.goals, (), ()), scale=SCALE)
    # West faces look west: the room sees them on the wall at its east, and so on.
    assert pixel(picture, 3.15, 1.5) == paint(3)
    assert pixel(picture, 0.85, 1.5) == paint(4)
    assert pixel(picture, 1.5, 2.15) == paint(5)
    assert pixel(picture, 1.5, 0.85) == paint(6)
    assert pixel(picture, 0.3, 1.5) == topdown.ROCK


@pytest.mark.parametrize("side", [3, 256])
def test_all_map_sizes(side: int) -> None:
    line = "#" + "." * (side - 2) + "#"
    rows = ["#" * side, *[line] * (side - 2), "#" * side]
    rows[1] = "#S" + rows[1][2:]
    rows[-2] = rows[-2][:-2] + "G#" if side > 3 else "SG#"
    tilemap = parse_ascii("\n".join(rows), "sizes")
    picture = draw_map(tilemap, size=480).objects().path(np.array([[1.5, 1.5], [1.5, 1.5]]))
    image = picture.agent((1.5, 1.5), 0.0).image()
    assert isinstance(image, Image.Image)
    assert 240 < max(image.size) <= 512
