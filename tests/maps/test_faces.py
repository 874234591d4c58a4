"""Faces as text and back, and the positions in error messages."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jaxenstein.errors import MapError
from jaxenstein.maps import TileMap, parse_ascii
from jaxenstein.maps.symbols import DECAL_LABELS, SYMBOLS, WALL_LABELS, door_label
from jaxenstein.maps.tilemap import FACES

MAP = "#####\n#S'G#\n#####"


def block(face: str, *lines: str) -> str:
    return "\n".join([face, *lines]) + "\n"


def test_decal_on_one_face() -> None:
    tilemap = parse_ascii(MAP, faces=block("south", "#\u0101###", "#...#", "#####"))
    assert tilemap.faces is not None
    assert tilemap.tiles == parse_ascii(MAP).tiles
    for name, face in zip(FACES, tilemap.faces, strict=True):
        expected = DECAL_LABELS[0] if name == "south" else 2
        assert face[0][1] == expected
        assert face[0][:1] + face[0][2:] == b"\2\2\2\2"
        assert face[1][2] == door_label(0, locked=False)


def test_blocks_in_any_order_with_any_line_endings() -> None:
    north = block("north", "#####", "#...#", "##1##")
    west = block("west", "#####", "#...3", "#####")
    expected = parse_ascii(MAP, faces=west + north)
    assert expected.faces is not None
    assert expected.faces[0][1][4] == SYMBOLS["3"].label
    assert expected.faces[2][2][2] == SYMBOLS["1"].label
    for text in (
        north + west,
        f"\ufeff\n\n{north}\n\n\n{west}\n\n",
        (north + west).replace("\n", "\r\n"),
        (west + north).replace("north", "north  "),
    ):
        assert parse_ascii(MAP, faces=text) == expected


def test_floor_symbols_do_not_change_the_tile() -> None:
    for blank in ". ":
        text = block("east", f"{blank * 3}1{blank}", "#...#", blank * 5 + "\nwest", *MAP.split())
        with pytest.raises(MapError, match="not allowed here"):
            parse_ascii(MAP, faces=text)
        text = block("east", f"{blank * 3}1{blank}", "#", blank * 5)
        tilemap = parse_ascii(MAP, faces=text)
        assert tilemap.faces is not None
        assert tilemap.faces[1][0] == bytes([2, 2, 2, 3, 2])
        assert tilemap.faces[0] == tilemap.tiles


def test_faces_equal_to_their_wall_are_dropped() -> None:
    assert parse_ascii(MAP, faces=block("west", "#####", "#...#", "#####")) == parse_ascii(MAP)
    assert parse_ascii(MAP).faces_text() is None


@pytest.mark.parametrize(
    ("faces", "line", "column", "message"),
    [
        ("", 1, None, "the text must start with a heading: one of west, east, north, south"),
        ("\n\n###\nwest", 3, None, "the text must start with a heading"),
        (block("west", "#####", "#...#", "#####", "#####"), 5, None, "5 columns and 4 rows"),
        (block("\nwest", "#####", "#...#"), 4, None, "5 columns and 2 rows do not fit .* 5 and 3"),
        (block("west", "#####", "#...##", "#####"), 3, 6, "6 columns and 3 rows do not fit"),
        (block("west", "####", "#...", "####"), 4, None, "4 columns and 3 rows do not fit"),
        (block("west", "#####", "#1..#", "#####"), 3, 2, "'1' is on floor"),
        (block("west", "#####", "#.1.#", "#####"), 3, 3, "'1' is on a door"),
        (block("west", "#####", "#.'.#", "#####"), 3, 3, "unlocked red door.* is not allowed here"),
        (block("west", "#####", "#S..#", "#####"), 3, 2, "spawn.* is not allowed here"),
        (block("west", "#####", "#...?", "#####"), 3, 5, r"unknown symbol '\?'"),
        (block("west", *MAP.replace("S'G", "...").split(), "West"), 5, None, "did you mean 'west'"),
        (block("eats", "#####", "#...#", "#####"), 1, None, "unknown heading 'eats', .*'east'"),
        (block("west", "#####", "#...#", "#####", "west", "#"), 5, None, "second heading 'west'"),
        (block("west", "", "east", "#####"), 1, None, "nothing follows the heading 'west'"),
        (block("west", "#####", "#...#", "#####", "east"), 5, None, "nothing follows .* 'east'"),
        (block("west", "\t####", "#...#", "#####"), 2, 1, "tab"),
        (block("west", "#" * 300), 2, 257, "too large"),
        (7, None, None, "not int"),
    ],
)
def test_errors_name_line_and_column(
    faces: str, line: int | None, column: int | None, message: str
) -> None:
    with pytest.raises(MapError, match=f"faces text.*: .*({message})") as caught:
        parse_ascii(MAP, faces=faces)
    assert (caught.value.line, caught.value.column) == (line, column)


def test_regions_and_faces_exclude_each_other() -> None:
    with pytest.raises(MapError, match="not both"):
        parse_ascii(MAP, faces=block("west", *MAP.split()), regions="#####\n#111#\n#####")


@st.composite
def maps_with_faces(draw: st.DrawFn) -> TileMap:
    """A map with random walls, some of them decals, and random labels on its faces."""
    rows, columns = draw(st.integers(1, 6)), draw(st.integers(2, 7))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    labels = [*WALL_LABELS[:5], *DECAL_LABELS[:3], DECAL_LABELS[-1]]
    solid = rng.random((rows, columns)) < 0.5
    solid[0, :2] = False
    faces = np.where(solid, rng.choice(labels, (5, rows, columns)), 0).astype(np.uint8)
    own, *others = (tuple(row.tobytes() for row in face) for face in faces)
    shown = None if all(face == own for face in others) else tuple(others)
    return TileMap("custom", own, faces=shown, spawns=((0, 0),), goals=((1, 0),))


@settings(deadline=None)
@given(maps_with_faces())
def test_round_trip(tilemap: TileMap) -> None:
    assert parse_ascii(tilemap.tile_text(), faces=tilemap.faces_text()) == tilemap


@settings(deadline=None)
@given(maps_with_faces())
def test_text_shows_the_faces(tilemap: TileMap) -> None:
    text = tilemap.faces_text()
    if text is None:
        return
    lines = text.split("\n")
    for number, face in enumerate(tilemap.faces or ()):
        start = number * (tilemap.rows + 2)
        assert lines[start] == ("west", "east", "north", "south")[number]
        for row, line in enumerate(lines[start + 1 : start + 1 + tilemap.rows]):
            assert [SYMBOLS[character].tile for character in line] == list(face[row])


def test_doors_are_left_out_of_the_text() -> None:
    tilemap = parse_ascii(MAP, faces=block("south", "#\u0101###", "#...#", "#####"))
    text = tilemap.faces_text()
    assert text is not None
    assert "'" not in text
    assert parse_ascii(MAP, faces=text) == tilemap
    assert dataclasses.replace(tilemap, faces=None) == parse_ascii(MAP)
