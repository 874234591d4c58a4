"""Text to maps and back, and the positions in error messages."""

from __future__ import annotations

import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jaxenstein.errors import MapError, MapWarning
from jaxenstein.maps import MAX_SIZE, Door, Item, Key, parse_ascii
from jaxenstein.maps.symbols import SYMBOLS, door_label


def test_map_is_parsed() -> None:
    tilemap = parse_ascii("####\n#Sr#\n#1R#\n#\\G#\n####", "small")
    assert tilemap.name == "small"
    assert tilemap.tiles == (
        b"\2\2\2\2",
        b"\2\0\0\2",
        bytes([2, 3, door_label(0, locked=True), 2]),
        bytes([2, door_label(4, locked=False), 0, 2]),
        b"\2\2\2\2",
    )
    assert tilemap.spawns == ((1, 1),)
    assert tilemap.goals == ((2, 3),)
    assert tilemap.keys == (Key(2, 1, 0),)
    assert tilemap.doors == (Door(2, 2, 0, True), Door(1, 3, 4, False))
    assert tilemap.faces is None


def test_every_symbol() -> None:
    others = "".join(c for c in SYMBOLS if c not in "SG")
    # A second row of floor and keys lets every door of the first be opened.
    text = f"{others}\n{'.' * len(others)}\nS{'.' * (len(others) - 2)}G"
    tilemap = parse_ascii(text, known=SYMBOLS)
    for column, character in enumerate(others):
        symbol = SYMBOLS[character]
        assert tilemap.tiles[0][column] == symbol.tile
        assert (Key(column, 0, symbol.colour) in tilemap.keys) == (symbol.kind == "key")
        assert ((column, 0) in tilemap.apples) == (character in "a@")
        assert ((column, 0) in tilemap.spawns) == (character == "@")
        door = Door(column, 0, symbol.colour, symbol.locked)
        assert (door in tilemap.doors) == (symbol.kind == "door")
        assert (Item(column, 0, symbol.label) in tilemap.items) == (character in "zscidm+=")
    assert (len(tilemap.keys), len(tilemap.doors), len(tilemap.items)) == (6, 12, 8)


PLAIN = parse_ascii("####\n#SG#\n####")


@pytest.mark.parametrize(
    "text",
    [
        "\n####\n#SG#\n####\n",
        "\n\n####\n#SG#\n####\n\n\n",
        "####\r\n#SG#\r\n####\r\n",
        "\r\n####\r\n#SG#\r\n####",
        "####\r#SG#\r####",
        "\ufeff####\n#SG#\n####",
        "\ufeff\r\n####\r\n#SG#\r\n####",
        "####\n#SG\n####",
    ],
)
def test_equivalent_forms_of_a_map(text: str) -> None:
    assert parse_ascii(text) == PLAIN


def test_short_and_empty_lines_are_filled_with_wall() -> None:
    tilemap = parse_ascii("SG\n\n 1\n#####")
    assert tilemap.tile_text() == "SG###\n#####\n.1###\n#####\n"


def test_blanks_are_floor_even_at_the_edge() -> None:
    assert parse_ascii("  S\n G\n   \n").tile_text() == "..S\n.G#\n...\n"


@pytest.mark.parametrize(
    ("text", "line", "column", "message"),
    [
        ("####\n#SG?\n####", 2, 4, r"unknown symbol '\?'; the symbols are \. space S G a @ # 1 2"),
        ("\n\n####\n#SG?\n####", 4, 4, "unknown symbol"),
        ("\ufeff?SG", 1, 1, "unknown symbol"),
        ("\r\n#\r\n#SG#\r\n#v", 4, 2, "unknown symbol 'v'"),
        ("#SG\n#s?", 2, 2, r"did you mean 'S' \(spawn"),
        ("#Sg", 1, 3, r"did you mean 'G' \(goal\)"),
        ("#SG\n#.+", 2, 3, r"'\+' \(medkit\) is only allowed in shooters"),
        ("#S\u2028G", 1, 3, "unknown symbol"),
        ("####\n#S\tG", 2, 3, "tab"),
        ("SG" + "." * (MAX_SIZE - 1), 1, MAX_SIZE + 1, "too large.*256"),
        ("\nSG\n" + ".\n" * MAX_SIZE, MAX_SIZE + 2, None, "too large.*256"),
        ("", None, None, "empty"),
        ("\r\n\n", None, None, "empty"),
        ("\ufeff", None, None, "empty"),
        ("####\n#G.#", None, None, "no spawn"),
        ("####\n#S.#", None, None, "no goal: .* goal_required=False"),
    ],
)
def test_errors_name_line_and_column(
    text: str, line: int | None, column: int | None, message: str
) -> None:
    with pytest.raises(MapError, match=message) as caught:
        parse_ascii(text)
    assert (caught.value.line, caught.value.column) == (line, column)
    if line is not None:
        place = f"line {line}" if column is None else f"line {line}, column {column}"
        assert str(caught.value).startswith(f"{place}: ")


@pytest.mark.parametrize("text", [None, b"SG", ["SG"], 3])
def test_non_text_is_refused(text: object) -> None:
    with pytest.raises(MapError, match=f"not {type(text).__name__}"):
        parse_ascii(text)  # type: ignore[arg-type]


def test_goal_is_required_only_if_needed() -> None:
    assert parse_ascii("#S.", goal_required=False).goals == ()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("S#G", ["line 1, column 3: no path reaches this goal"]),
        ("\n\nS#G", ["line 3, column 3: no path reaches this goal"]),
        ("SG#\n##G", ["line 2, column 3: no path reaches this goal"]),
        ("SG#\n###\n##S", ["line 3, column 3: no path from here reaches a goal"]),
        ("SG#S#G", ["line 1, column 6: no path reaches", "line 1, column 4: no path from here"]),
        ("SRG", ["line 1, column 3: paths to this goal need a key .*red"]),
        ("bSRG", ["line 1, column 4: paths to this goal need a key .*red"]),
        ("SRrG", ["line 1, column 4: paths to this goal need a key .*red"]),
        ("SBrRbG", ["line 1, column 6: paths to this goal need a key .*blue"]),
        ("rSRGRS", ["line 1, column 6: paths from here to a goal need a missing key"]),
        ("SG###\n#####\nSSS##", ["line 3, column 1: no path from here .*; the same for 2 more"]),
    ],
)
def test_warnings_name_unreachable_things(text: str, expected: list[str]) -> None:
    with pytest.warns(MapWarning) as caught:
        parse_ascii(text)
    assert len(caught) == len(expected)
    for warning, pattern in zip(caught, expected, strict=True):
        assert warning.filename == __file__
        assert re.match(pattern, str(warning.message)), str(warning.message)


@pytest.mark.parametrize("text", ["rSRG", "S'\\G", "bSBrRG", "SG#SG", "S.\n.G"])
def test_no_warning_if_a_goal_is_reachable(text: str) -> None:
    parse_ascii(text)


ALL = "".join(SYMBOLS)


@st.composite
def texts(draw: st.DrawFn) -> list[str]:
    columns = draw(st.integers(2, 9))
    line = st.text(st.sampled_from(ALL + "...###"), min_size=columns, max_size=columns)
    lines = draw(st.lists(line, max_size=7))
    return ["SG" + draw(line)[2:], *lines]


@settings(deadline=None)
@given(texts())
@pytest.mark.filterwarnings("ignore::jaxenstein.errors.MapWarning")
def test_round_trip(lines: list[str]) -> None:
    tilemap = parse_ascii("\n".join(lines), known=SYMBOLS)
    assert tilemap.tile_text().splitlines() == [line.replace(" ", ".") for line in lines]
    assert parse_ascii(tilemap.tile_text(), known=SYMBOLS) == tilemap


@settings(deadline=None)
@given(texts(), st.data())
@pytest.mark.filterwarnings("ignore::jaxenstein.errors.MapWarning")
def test_regions_face_by_face(lines: list[str], data: st.DataObject) -> None:
    plain = parse_ascii("\n".join(lines), known=SYMBOLS)
    walls = [[SYMBOLS[mark].kind == "wall" for mark in line] for line in lines]
    paint = [
        "".join(data.draw(st.sampled_from("." if wall else "..#12A")) for wall in row)
        for row in walls
    ]
    tilemap = parse_ascii("\n".join(lines), regions="\n".join(paint), known=SYMBOLS)
    faces = tilemap.faces or (tilemap.tiles,) * 4
    for face, (dx, dy) in zip(faces, ((-1, 0), (1, 0), (0, -1), (0, 1)), strict=True):
        for row, line in enumerate(lines):
            for column, mark in enumerate(line):
                expected = plain.tiles[row][column]
                c, r = column + dx, row + dy
                if walls[row][column] and 0 <= r < len(lines) and 0 <= c < len(line):
                    expected = SYMBOLS[paint[r][c]].tile or expected
                assert face[row][column] == expected, (mark, column, row)
    if tilemap.faces is None:
        assert tilemap == plain


def test_doors_keep_their_look() -> None:
    tilemap = parse_ascii("#####\n#S'G#\n#####", regions="#####\n#111#\n#####")
    assert tilemap.faces is not None
    assert {face[1][2] for face in tilemap.faces} == {door_label(0, locked=False)}
    # The wall beside an open door shows the region of the doorway.
    assert tilemap.faces[3][0][2] == 3


@pytest.mark.parametrize(
    ("regions", "line", "column", "message"),
    [
        ("####\n#1G#\n####", 2, 3, r"'G' \(goal\) is not allowed here, only \. space # 1 2 "),
        ("\n####\n#1?#\n####", 3, 3, "unknown symbol"),
        ("####\n#11#", 2, None, "4 columns and 2 rows do not fit .* 4 and 3"),
        ("####\n#11#\n####\n####", 4, None, "4 columns and 4 rows do not fit"),
        ("####\n#11##\n####", 2, 5, "5 columns and 3 rows do not fit"),
        ("###\n#11\n###", 3, None, "3 columns and 3 rows do not fit"),
        ("####\n111#\n####", 2, 1, "'1' is on a wall"),
        ("", None, None, "empty"),
        (7, None, None, "not int"),
    ],
)
def test_errors_in_regions(
    regions: str, line: int | None, column: int | None, message: str
) -> None:
    with pytest.raises(MapError, match=f"regions text.*: .*({message})") as caught:
        parse_ascii("####\n#SG#\n####", regions=regions)
    assert (caught.value.line, caught.value.column) == (line, column)


def test_indented_closing_quotes_are_not_a_row() -> None:
    """Blanks after the last line end are dropped; a line of blanks before it is floor."""
    text = """
###
#SG
\x20\x20\x20
###
    """
    tilemap = parse_ascii(text)
    assert (tilemap.rows, tilemap.columns) == (4, 3)
    assert tilemap.tiles[2] == bytes(3)
