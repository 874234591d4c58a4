"""The map from above: known places have known colours."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from PIL import Image

from jaxenstein.maps.ascii import parse_ascii
from jaxenstein.maps.symbols import DECAL_LABELS, LABEL_COLOURS, door_label
from jaxenstein.maps.things import APPLE, GOAL, KEY, MEDKIT
from jaxenstein.maps.tilemap import TileMap
from jaxenstein.view import glyphs, ground, topdown
from jaxenstein.view.topdown import MapPicture, draw_map

SCALE = 20
TEXT = """\
###########
#S.r.R..G.#
#.#########
#.#########
#.........G
#...a......
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
    assert draw_map(tilemap).scale == 43
    assert max(draw_map(tilemap, size=480).image().size) == 473


def test_floor_walls_and_rock(tilemap: TileMap) -> None:
    picture = draw_map(tilemap, scale=SCALE)
    assert pixel(picture, 2.5, 1.5) == ground.FLOOR
    assert pixel(picture, 4.5, 0.5) == paint(2)


def test_rock_is_where_no_agent_can_look() -> None:
    solid = parse_ascii("######\n#SG###\n######\n######\n######", "solid")
    picture = draw_map(solid, scale=SCALE)
    assert pixel(picture, 1.5, 3.5) == ground.ROCK
    assert pixel(picture, 5.5, 1.5) == ground.ROCK
    assert pixel(picture, 3.5, 1.5) == paint(2)


def test_doors_close_and_open(tilemap: TileMap) -> None:
    closed = draw_map(tilemap, scale=SCALE).doors(np.array([True]))
    opened = draw_map(tilemap, scale=SCALE).doors(np.array([False]))
    red = paint(door_label(0, locked=True))
    assert pixel(closed, 5.25, 1.25) == red
    assert pixel(closed, 5.5, 1.5) == glyphs.INK
    assert pixel(opened, 5.5, 1.5) == ground.FLOOR
    # The posts stand at the walls, north and south of this door.
    assert pixel(opened, 5.5, 1.05) == red
    assert pixel(opened, 5.5, 1.95) == red
    assert pixel(opened, 5.05, 1.5) == ground.FLOOR


def test_path_through_an_open_door_stays_visible(tilemap: TileMap) -> None:
    steps = np.array([[4.5, 1.5], [5.5, 1.5], [6.5, 1.5]])
    walked = draw_map(tilemap, scale=SCALE).path(steps).doors(np.array([False]))
    assert pixel(walked, 5.5, 1.5) not in (ground.FLOOR, glyphs.INK)
    shut = draw_map(tilemap, scale=SCALE).path(steps).doors(np.array([True]))
    assert pixel(shut, 5.5, 1.5) == glyphs.INK


def test_things_match_the_map(tilemap: TileMap) -> None:
    picture = draw_map(tilemap, scale=SCALE).things()
    assert pixel(picture, 3.6, 1.5) == paint(KEY.labels[0])
    assert pixel(picture, 5.5, 1.5) == glyphs.INK
    assert pixel(picture, 8.5, 1.5) == pixel(picture, 10.5, 4.5) == glyphs.GOLD
    assert pixel(picture, 4.5, 5.55) == paint(APPLE.label)


@pytest.mark.parametrize("scale", [SCALE, 10])
def test_sprites_are_drawn_in_their_place(tilemap: TileMap, scale: int) -> None:
    labels = np.array([GOAL.label, APPLE.label, MEDKIT.label, 5])
    places = np.array([[2.5, 4.5], [4.5, 4.55], [6.25, 4.75], [8.5, 4.5]])
    there = draw_map(tilemap, scale=scale).sprites(places, labels)
    assert pixel(there, 2.5, 4.5) == glyphs.GOLD
    assert pixel(there, 4.5, 4.6) == paint(APPLE.label)
    # A red cross in a white box.
    assert pixel(there, 6.25, 4.75) == glyphs.CROSS
    assert pixel(there, 6.0, 4.55) == pixel(there, 6.45, 4.95) == glyphs.BOX
    assert pixel(there, 8.5, 4.5) == paint(5)
    # Half a tile beside each is floor: nothing exceeds its tile or is misplaced.
    for x in (1.6, 3.5, 5.5, 7.5, 9.5):
        assert pixel(there, x, 4.5) == ground.FLOOR


def test_thing_without_a_glyph_is_drawn_as_its_picture(
    tilemap: TileMap, monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = dataclasses.replace(APPLE, glyph=None)
    monkeypatch.setitem(glyphs.THING_OF, APPLE.label, plain)
    picture = draw_map(tilemap, scale=SCALE).sprites(
        np.array([[4.5, 4.5]]), np.array([APPLE.label])
    )
    # The art of 32 by 32 covers 0.8 of the tile; the fruit is below, the leaf above.
    fruit, leaf = (4.5, 4.5 + (20 / 32 - 0.5) * 0.8), (4.5 + (22.5 / 32 - 0.5) * 0.8, 4.5 - 0.35)
    assert pixel(picture, *fruit) == paint(APPLE.label)
    assert pixel(picture, *leaf) == APPLE.detail
    assert pixel(picture, 3.9, 4.5) == ground.FLOOR


def test_only_visible_sprites_are_drawn(tilemap: TileMap) -> None:
    places, labels = np.array([[2.5, 4.5], [3.6, 1.5]]), np.array([MEDKIT.label, KEY.labels[0]])
    picture = draw_map(tilemap, scale=SCALE).sprites(places, labels, np.array([True, False]))
    assert pixel(picture, 2.5, 4.5) == glyphs.CROSS
    assert pixel(picture, 3.4, 1.5) == ground.FLOOR
    empty = draw_map(tilemap, scale=SCALE).sprites(np.zeros((0, 2)), np.zeros(0, int))
    plain = draw_map(tilemap, scale=SCALE)
    np.testing.assert_array_equal(np.asarray(empty.image()), np.asarray(plain.image()))


def test_goal_is_on_top(tilemap: TileMap) -> None:
    places, labels = np.array([[2.5, 4.5], [2.5, 4.5]]), np.array([GOAL.label, APPLE.label])
    picture = draw_map(tilemap, scale=SCALE).sprites(places, labels)
    assert pixel(picture, 2.5, 4.5) == glyphs.GOLD


def test_few_starts_are_marked(tilemap: TileMap) -> None:
    assert pixel(draw_map(tilemap, scale=SCALE), 1.5 + 0.15, 1.5) != ground.FLOOR
    many = tilemap.with_spawns((column, 5) for column in range(2, 11))
    many = many.with_spawns([*many.spawns, *((column, 4) for column in range(2, 11))])
    several = draw_map(many, scale=SCALE)
    assert pixel(several, 3.5 + 0.15, 5.5) != ground.FLOOR
    floor = np.argwhere(np.array(many.walls) == 0)[:, ::-1]
    assert len(floor) > topdown.MOST_MARKS
    everywhere = draw_map(many.with_spawns(floor.tolist()), scale=SCALE)
    assert pixel(everywhere, 3.5 + 0.15, 5.5) == ground.FLOOR


def test_path_is_drawn_and_coloured_by_time(tilemap: TileMap) -> None:
    path = np.array([[1.5, 4.5], [2.5, 4.5], [3.5, 4.5], [7.5, 4.5], [8.5, 4.5]])
    picture = draw_map(tilemap, scale=SCALE).path(path)
    assert pixel(picture, 1.8, 4.5) == topdown.PATH[0]
    assert pixel(picture, 8.0, 4.5) == topdown.blend(*topdown.PATH, 0.75)
    # A jump is a new start, not a movement; and nothing is drawn beside the line.
    assert pixel(picture, 5.5, 4.5) == ground.FLOOR
    assert pixel(picture, 1.8, 4.75) == ground.FLOOR
    farther = draw_map(tilemap, scale=SCALE).path(path, longest_step=4.0)
    assert pixel(farther, 5.5, 4.5) == topdown.blend(*topdown.PATH, 0.5)


def test_path_in_pieces_equals_the_whole_path(tilemap: TileMap) -> None:
    path = np.column_stack([np.linspace(1.5, 8.5, 15), np.full(15, 4.5)])
    whole = draw_map(tilemap, scale=SCALE).path(path)
    pieces = draw_map(tilemap, scale=SCALE)
    for i in range(14):
        pieces.path(path[i : i + 2], i, 14)
    np.testing.assert_array_equal(np.asarray(whole.image()), np.asarray(pieces.image()))


def test_agent_points_along_its_heading(tilemap: TileMap) -> None:
    for heading, (dx, dy) in ((0.0, (1, 0)), (math.pi / 2, (0, 1)), (math.pi, (-1, 0))):
        picture = draw_map(tilemap, scale=SCALE).agent((4.0, 5.0), heading)
        assert pixel(picture, 4.0 + 0.25 * dx, 5.0 + 0.25 * dy) == topdown.AGENT
        assert pixel(picture, 4.0 - 0.35 * dx, 5.0 - 0.35 * dy) == ground.FLOOR


def test_only_closed_doors_stop_the_view(tilemap: TileMap) -> None:
    place = (2.5, 1.5)
    closed = draw_map(tilemap, scale=SCALE).sight(place, 0.0)
    opened = draw_map(tilemap, scale=SCALE).sight(place, 0.0, closed=np.array([False]))
    assert pixel(closed, 4.5, 1.5) == pixel(opened, 4.5, 1.5) != ground.FLOOR
    assert pixel(closed, 7.0, 1.5) == ground.FLOOR
    assert pixel(opened, 7.0, 1.5) == pixel(opened, 4.5, 1.5)
    assert pixel(opened, 2.0, 1.5) == ground.FLOOR


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
    assert pixel(picture, 0.3, 1.5) == ground.ROCK


@pytest.mark.parametrize("tile_label", [2, DECAL_LABELS[7]])
def test_decals_are_strips_on_differently_coloured_walls(tile_label: int) -> None:
    base = parse_ascii("#####\n#S#.#\n#####", "decals", goal_required=False)
    walls = np.array(base.walls)
    faces = np.stack([walls.copy()] * 4)
    # The wall between the two cells, as the western one sees it.
    faces[0, 1, 2] = decal = DECAL_LABELS[7]
    as_rows = tuple(tuple(row.tobytes() for row in face) for face in faces)
    # A map may call the whole tile by its decal.
    walls[1, 2] = tile_label
    tiles = tuple(row.tobytes() for row in walls)
    picture = draw_map(dataclasses.replace(base, tiles=tiles, faces=as_rows), scale=SCALE)
    assert pixel(picture, 2.15, 1.5) == paint(decal)
    assert pixel(picture, 2.5, 1.5) == pixel(picture, 2.9, 1.5) == paint(2)
    assert pixel(picture, 1.5, 0.9) == pixel(picture, 0.2, 0.2) == paint(2)
    assert pixel(picture, 2.5, 0.5) == paint(2)


@pytest.mark.parametrize("side", [3, 256])
def test_all_map_sizes(side: int) -> None:
    line = "#" + "." * (side - 2) + "#"
    rows = ["#" * side, *[line] * (side - 2), "#" * side]
    rows[1] = "#S" + rows[1][2:]
    rows[-2] = rows[-2][:-2] + "G#" if side > 3 else "SG#"
    tilemap = parse_ascii("\n".join(rows), "sizes")
    picture = draw_map(tilemap, size=480).things().path(np.array([[1.5, 1.5], [1.5, 1.5]]))
    image = picture.agent((1.5, 1.5), 0.0).image()
    assert isinstance(image, Image.Image)
    assert 240 < max(image.size) <= 512
