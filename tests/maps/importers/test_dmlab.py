"""Mazes of DeepMind Lab, compared with the text pictures from which their files are made."""

from __future__ import annotations

import re
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jaxenstein.errors import MapError, MapWarning
from jaxenstein.maps import parse_ascii
from jaxenstein.maps.importers.dmlab import build_tilemap, read_maze, wall_label
from jaxenstein.maps.symbols import DECAL_LABELS, SYMBOLS
from jaxenstein.maps.tilemap import FACES, MAX_SIZE, TileMap
from tests.reference import labmaps

PICTURE = """\
3333333
3S...@3
3.3.333
3.3G.a3
3333333
"""
TEXT = labmaps.write_map(PICTURE)
RED, GREEN, BLUE = SYMBOLS["1"].label, SYMBOLS["3"].label, SYMBOLS["2"].label
WALL = SYMBOLS["#"].label


def convert(text: str) -> TileMap:
    return build_tilemap(read_maze(text, "maze"))


def faces_of(tilemap: TileMap, column: int, row: int) -> dict[str, int]:
    faces = tilemap.faces or (tilemap.tiles,) * 4
    return {name: face[row][column] for name, face in zip(FACES, faces, strict=True)}


def test_file_is_parsed() -> None:
    maze = read_maze(TEXT, "small")
    assert (maze.name, maze.columns, maze.rows) == ("small", 3, 2)
    assert {cell for cell, _ in maze.floors} == {(c, r) for c in range(3) for r in range(2)}
    assert {texture for _, texture in maze.floors} == {"map/lab_games/style_floor_blue"}
    assert maze.spawns == ((0, 1), (2, 1))
    assert maze.goals == ((1, 0),)
    assert maze.apples == ((2, 1), (2, 0))
    panels = dict(maze.panels)
    assert set(panels.values()) == {"map/lab_games/style_wall_green"}
    assert {s for c, r, s in panels if (c, r) == (0, 0)} == {"west", "south", "east"}
    assert {s for c, r, s in panels if (c, r) == (2, 1)} == {"east", "north", "south"}
    assert maze.decals == ()


def test_converted_map_equals_the_text() -> None:
    tilemap = convert(TEXT)
    assert tilemap.tile_text() == PICTURE
    assert tilemap.faces is None
    assert tilemap.name == "maze"


def test_free_corners_are_floor() -> None:
    picture = "#####\n#S..#\n#...#\n#..a#\n#####\n"
    assert convert(labmaps.write_map(picture)).tile_text() == picture


def test_cells_without_floor_and_sides_without_panel_are_solid() -> None:
    tilemap = convert(labmaps.write_map("111..\n1S1#.\n111..\n"))
    assert tilemap.tile_text() == "111\n1S1\n111\n"
    tilemap = convert(labmaps.write_map(".....\n.S.#.\n.....\n.G.a.\n.....\n"))
    assert tilemap.tile_text() == "#####\n#S###\n#.###\n#G.a#\n#####\n"


def test_positions_count_from_the_south_west_corner() -> None:
    far = re.sub(
        r"\( (-?[\d.]+) (-?[\d.]+) (-?[\d.]+) \)",
        lambda m: f"( {float(m[1]) - 700} {float(m[2]) + 1300} {m[3]} )",
        TEXT,
    )
    far = re.sub(
        r'"origin" "(\d+) (\d+) ',
        lambda m: f'"origin" "{int(m[1]) - 700} {int(m[2]) + 1300} ',
        far,
    )
    assert read_maze(far) == read_maze(TEXT)


def test_panels_have_a_colour_on_each_side() -> None:
    """A wall between two cells shows each of them its own panel."""
    colours = {(0, 0, "east"): "red", (1, 0, "west"): "blue_bright", (0, 0, "north"): "pink"}
    tilemap = convert(labmaps.write_map("33333\n3S3G3\n33333", colours))
    assert faces_of(tilemap, 2, 1)["west"] == RED
    assert faces_of(tilemap, 2, 1)["east"] == SYMBOLS["T"].label
    assert faces_of(tilemap, 1, 0)["south"] == WALL
    assert faces_of(tilemap, 3, 0)["south"] == GREEN
    assert faces_of(tilemap, 4, 1)["west"] == GREEN


def test_end_of_a_wall_continues_its_faces() -> None:
    picture = "11111\n1S.a1\n1.1.1\n1.1.1\n11111\n"
    colours = {(0, 0, "east"): "green", (1, 0, "west"): "blue"}
    tilemap = convert(labmaps.write_map(picture, colours))
    assert faces_of(tilemap, 2, 3)["west"] == GREEN
    assert faces_of(tilemap, 2, 3)["east"] == BLUE
    assert faces_of(tilemap, 2, 2)["west"] == GREEN
    assert faces_of(tilemap, 2, 2)["east"] == BLUE
    assert faces_of(tilemap, 2, 2)["north"] in (GREEN, BLUE)


def test_corner_continues_each_of_its_two_walls() -> None:
    """One wall comes from the north, one from the west, and each side has its own colour."""
    picture = "11111\n1S1.1\n111.1\n1..a1\n11111\n"
    colours = {(1, 1, "west"): "green", (0, 0, "north"): "blue"}
    tilemap = convert(labmaps.write_map(picture, colours))
    corner = faces_of(tilemap, 2, 2)
    assert (corner["east"], corner["south"]) == (GREEN, BLUE)


@pytest.mark.parametrize(
    ("side", "tile", "face"),
    [
        ((1, 1, "west"), (2, 3), "east"),
        ((1, 1, "east"), (4, 3), "west"),
        ((1, 1, "north"), (3, 2), "south"),
        ((1, 1, "south"), (3, 4), "north"),
    ],
)
def test_decal_is_on_one_face_only(
    side: labmaps.CellSide, tile: tuple[int, int], face: str
) -> None:
    picture = "1111111\n1S.a.a1\n1.111.1\n1.1.1.1\n1.111.1\n1.....1\n1111111"
    tilemap = convert(labmaps.write_map(picture, decals={side: "cat"}))
    shown = faces_of(tilemap, *tile)
    assert shown.pop(face) == DECAL_LABELS[0]
    assert set(shown.values()) == {RED}
    assert tilemap.tiles[tile[1]][tile[0]] == DECAL_LABELS[0]
    assert (tilemap.walls == DECAL_LABELS[0]).sum() == 1


def test_decals_are_numbered_in_file_order() -> None:
    decals = {(0, 0, "east"): "cat", (0, 0, "north"): "dog", (1, 0, "west"): "cow"}
    tilemap = convert(labmaps.write_map("33333\n3S3G3\n33333", decals={**decals}))
    assert faces_of(tilemap, 2, 1)["west"] == DECAL_LABELS[0]
    assert faces_of(tilemap, 1, 0)["south"] == DECAL_LABELS[1]
    assert faces_of(tilemap, 2, 1)["east"] == DECAL_LABELS[2]
    twice = convert(labmaps.write_map("33333\n3S3G3\n33333", decals=dict.fromkeys(decals, "cat")))
    assert (twice.walls == DECAL_LABELS[0]).sum() == 3


def test_more_decals_than_labels() -> None:
    width = 41
    picture = "3" * (2 * width + 1)
    picture = f"{picture}\n3{'S3' * width}\n{picture}"
    sides = [(c, 0, side) for c in range(width) for side in ("west", "east")]
    decals = {side: f"cat{i}" for i, side in enumerate(sides)}
    many = read_maze(labmaps.write_map(picture, decals=decals))
    with pytest.raises(MapError, match="82 different decals; there are only 64 labels"):
        build_tilemap(many)


@pytest.mark.parametrize(
    ("texture", "symbol"),
    [
        ("map/lab_games/lg_style_01_wall_green", "3"),
        ("map/lab_games/lg_style_02_wall_yellow", "4"),
        ("map/lab_games/lg_style_02_wall_blue_bright", "T"),
        ("map/lab_games/lg_style_03_wall_orange", "W"),
        ("map/lab_games/lg_style_09_wall_plaid", "#"),
        ("stone", "#"),
    ],
)
def test_textures_become_wall_colours(texture: str, symbol: str) -> None:
    assert wall_label(texture) == SYMBOLS[symbol].label


@st.composite
def pictures(draw: st.DrawFn) -> tuple[str, dict[labmaps.CellSide, str]]:
    """A random maze, and the colours of some of its panels."""
    columns, rows = draw(st.integers(1, 5)), draw(st.integers(1, 4))
    grid = [["."] * (2 * columns + 1) for _ in range(2 * rows + 1)]
    colours = {}
    for y in range(2 * rows + 1):
        for x in range(2 * columns + 1):
            border = x in (0, 2 * columns) or y in (0, 2 * rows)
            if (x + y) % 2 and (border or draw(st.booleans())):
                grid[y][x] = draw(st.sampled_from("#312"))
            elif x % 2 and y % 2:
                grid[y][x] = draw(st.sampled_from(".aS@"))
    grid[1][1] = "S"
    for y in range(0, 2 * rows + 1, 2):
        for x in range(0, 2 * columns + 1, 2):
            beside = [(x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)]
            if any(
                grid[r][c] != "." for c, r in beside if 0 <= r <= 2 * rows and 0 <= c < len(grid[0])
            ):
                grid[y][x] = "#"
    for _ in range(draw(st.integers(0, 4))):
        column, row = draw(st.integers(0, columns - 1)), draw(st.integers(0, rows - 1))
        side = draw(st.sampled_from(sorted(labmaps.SIDES)))
        colours[column, row, side] = draw(st.sampled_from(["green", "red", "blue"]))
    return "\n".join(map("".join, grid)), colours


@settings(deadline=None, max_examples=60)
@given(pictures())
def test_random_mazes(case: tuple[str, dict[labmaps.CellSide, str]]) -> None:
    picture, colours = case
    lines = picture.split()
    tilemap = convert(labmaps.write_map(picture, colours))
    shown = [
        "".join("#" if tile else mark for tile, mark in zip(tiles, line, strict=True))
        for tiles, line in zip(tilemap.tiles, lines, strict=True)
    ]
    assert shown == [re.sub(r"[312]", "#", line) for line in lines]
    assert parse_ascii(tilemap.tile_text(), goal_required=False).tiles == tilemap.tiles
    assert {tilemap.tile_text().split()[r][c] for c, r in tilemap.apples} <= {"a", "@"}
    rows = len(lines) // 2
    across = {"west": "east", "east": "west", "north": "south", "south": "north"}
    for column in range(len(lines[0]) // 2):
        for row in range(rows):
            for side, (dx, dy) in labmaps.SIDES.items():
                x, y = 2 * column + 1 + dx, 2 * (rows - 1 - row) + 1 + dy
                if lines[y][x] != ".":
                    colour = colours.get((column, row, side), labmaps.COLOURS[lines[y][x]])
                    wanted = {"green": GREEN, "red": RED, "blue": BLUE, "plain": WALL}[colour]
                    assert faces_of(tilemap, x, y)[across[side]] == wanted


def line_of(text: str, part: str) -> int:
    return text[: text.index(part)].count("\n") + 1


def edit(old: str, new: str, count: int = 1) -> str:
    assert old in TEXT
    return TEXT.replace(old, new, count)


FIRST_BRUSH = labmaps.floor(0, 1)
FIRST_PANEL = labmaps.panel((0, 1, "west"), "green")
START = labmaps.thing("info_player_start", 0, 1)
DECAL = labmaps.decal((0, 1, "west"), "cat")
HUNG = labmaps.write_map(PICTURE, decals={(0, 1, "west"): "cat"})


END = "the last line"
BAD_START = START.replace("50 150 30", "50 150 30 0")


@pytest.mark.parametrize(
    ("text", "place", "message"),
    [
        ("", None, "the file is empty"),
        ("\n // nothing\n", None, "the file is empty"),
        ("\nhello", "hello", "expected '{' at the start of an entity, found 'hello'"),
        ("{\n", END, "in the entity of line 1 .*found the end of the file"),
        ("}\n", "}", "expected '{' at the start of an entity, found '}'"),
        (TEXT + "}", END, "expected '{' at the start of an entity, found '}'"),
        (TEXT[: TEXT.rindex("}")], END, "found the end of the file"),
        (TEXT[: TEXT.index("wall_green")], END, "after the brush .*found the end of the"),
        (edit('"light" "100"', '"light" "100'), '"light" "100', "the value of 'light'"),
        (edit('"light" "100"\n  {', '"light" {'), '"light" {', "the value of 'light', found '{'"),
        (edit(FIRST_BRUSH, FIRST_BRUSH[:-4]), None, "after the brush of line .*found '{'"),
        (edit("( 0 100 0 )", "( 0 1OO 0 )"), "1OO", "number .*found '1OO'"),
        (edit("( 0 100 0 )", "( 0 nan 0 )"), "nan", "number .*found 'nan'"),
        (edit("( 0 100 0 )", "( 0 1e300 0 )"), "1e300", "-1000000 to 1000000 .*'1e300'"),
        (edit("( 0 100 0 )", "( 0 100 )"), "( 0 100 )", "found '\\)'"),
        (edit("0.5 0.5 0 0 0", "0.5 half 0 0 0"), "half", "after the texture .*found 'half'"),
        (HUNG.replace("patchDef2", "brushDef"), "brushDef", "found 'brushDef'"),
        (HUNG.replace("( 3 3 0", "( 3 5 0"), DECAL[:17], "3 by 5 control points has 9"),
        (HUNG.replace("( 3 3 0", "( x 3 0"), "( x 3", "size of a patch"),
        (edit(FIRST_BRUSH, ""), FIRST_PANEL, "style_wall_green is in a cell without floor"),
        (labmaps.entity("worldspawn") + START, None, "the maze has no floor"),
        (TEXT.replace("info_player_start", "info_null"), None, "no start, an entity of the class"),
        (edit(START, BAD_START), BAD_START, "info_player_start has no origin with three"),
        (edit("50 150 30", "50 150 x"), START[:30], "no origin"),
        (edit("50 150 30", "nan 150 0"), START[:30], "no origin"),
        (edit("50 150 30", "50 950 30"), START[:30], "info_player_start is in a cell without"),
        (edit("50 150 30", "150 50 30"), '{\n  "classname" "goal"', "shares its cell with a start"),
    ],
)  # fmt: skip
def test_damaged_files(text: str, place: str | None, message: str) -> None:
    with pytest.raises(MapError, match=message) as caught:
        read_maze(text)
    line = caught.value.line
    if place == END:
        assert line == text.count("\n") + 1
    elif place is not None:
        assert line == line_of(text, place)
    assert str(caught.value).startswith(f"line {line}: " if line else "the ")


def test_two_apples_in_a_cell() -> None:
    apple = labmaps.thing("apple_reward", 2, 0)
    with pytest.raises(MapError, match="a second apple_reward in one cell") as caught:
        read_maze(TEXT + apple)
    assert caught.value.line == TEXT.count("\n") + 1


@pytest.mark.parametrize(
    ("low", "high", "message"),
    [
        ((50, 0, 0), (150, 100, 1), "from 50 to 150 does not line up with cells of 100 units"),
        ((0, 30, 0), (100, 31, 100), "from 30 to 31 does not line up"),
        ((40, 0, 0), (140, 1, 100), "from 40 to 140 does not line up"),
        (
            (0, 0, 0),
            (300, 1, 100),
            "a brush of 300 by 1 by 100 units is not the floor, ceiling or a wall",
        ),
        ((0, 0, 0), (100, 100, 100), "a brush of 100 by 100 by 100 units"),
        ((0, 0, 0), (1, 1, 100), "a brush of 1 by 1 by 100 units"),
        ((0, 0, 100), (1, 100, 200), "a brush of 1 by 100 by 100 units"),
    ],
)
def test_misplaced_brushes(low: tuple, high: tuple, message: str) -> None:
    brush = labmaps.brush(low, high, "stone")
    text = edit(FIRST_PANEL, brush)
    with pytest.raises(MapError, match=message) as caught:
        read_maze(text)
    assert caught.value.line == line_of(text, brush)


def test_brushes_that_are_not_boxes() -> None:
    side = labmaps.plane(2, 0.0, "map/lab_games/style_wall_green")
    for broken in (
        FIRST_PANEL.replace("( 0.0 32 0 )", "( 3 32 0 )"),
        FIRST_PANEL.replace(side, ""),
    ):
        assert broken != FIRST_PANEL
        text = edit(FIRST_PANEL, broken)
        with pytest.raises(MapError, match="not a box along the axes") as caught:
            read_maze(text)
        assert caught.value.line == line_of(text, broken)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda text: text + labmaps.decal((0, 1, "west"), "dog"),
            "decal/dog hides another",
        ),
        (lambda _: labmaps.decal((0, 1, "south"), "dog"), "decal/dog is not on a wall panel"),
        (lambda _: labmaps.decal((9, 9, "south"), "dog"), "decal/dog is not on a wall panel"),
        (lambda text: text.replace("( 2.0 ", "( 32 "), "is not at a side of a cell"),
        (lambda text: re.sub(r"(\d) (20|50|80) 0 ", r"\1 20 0 ", text), "not a flat, upright"),
        (lambda text: text.replace("( 2.0 ", "( 20 ", 1), "not a flat, upright"),
    ],
)
def test_decals_without_a_wall(change: Callable[[str], str], message: str) -> None:
    assert DECAL in HUNG
    changed = change(DECAL)
    assert changed != DECAL
    text = HUNG.replace(DECAL, changed)
    with pytest.raises(MapError, match=message) as caught:
        read_maze(text)
    assert caught.value.line is not None
    assert line_of(text, changed) <= caught.value.line < line_of(text, changed) + 30


def test_unknown_entities_are_ignored() -> None:
    more = labmaps.entity("func_door", inside=labmaps.brush((5, 5, 5), (7, 7, 7), "wood"))
    nameless = "{\n}\n"
    assert read_maze(TEXT + more + nameless) == read_maze(TEXT)


def test_entity_without_closing_brace_gives_a_warning() -> None:
    """Two of the original files have such a place."""
    text = TEXT.replace(START, START.removeprefix("{\n"))
    with pytest.warns(MapWarning, match="line .*: an entity starts without '{'") as caught:
        maze = read_maze(text, source="maze.map")
    assert maze.spawns == read_maze(TEXT).spawns
    assert len(caught) == 1
    assert str(caught[0].message).startswith(f"maze.map, line {line_of(text, START[2:])}: ")
    assert caught[0].filename == __file__


def test_equivalent_forms_of_a_file() -> None:
    expected = read_maze(TEXT)
    assert read_maze(TEXT.replace("\n", "\r\n")) == expected
    assert read_maze("\ufeff" + TEXT) == expected
    assert read_maze(TEXT.replace("{\n", "{ // comment }\n")) == expected
    assert read_maze(" ".join(TEXT.split())) == expected


def test_non_text_is_refused() -> None:
    with pytest.raises(MapError, match="not bytes"):
        read_maze(b"{}")  # type: ignore[arg-type]
    with pytest.raises(MapError, match=r"^old\.map, line 1: "):
        read_maze("\0\1\2", source="old.map")


def test_sizes() -> None:
    most = (MAX_SIZE - 1) // 2
    start = labmaps.thing("info_player_start", 0, 0)

    def spread(*cells: tuple[int, int]) -> str:
        return (
            labmaps.entity("worldspawn", inside="".join(labmaps.floor(*c) for c in cells)) + start
        )

    tilemap = convert(spread((0, 0), (most - 1, most - 1)))
    assert (tilemap.columns, tilemap.rows) == (MAX_SIZE - 1, MAX_SIZE - 1)
    for cell in ((most, 0), (0, most), (0, -most), (9999, 0), (9999, -9999)):
        with pytest.raises(MapError, match=f"cells is too large: the limit is {most} of each"):
            read_maze(spread((0, 0), cell))


@settings(deadline=None, max_examples=150)
@given(st.data())
@pytest.mark.filterwarnings("ignore::jaxenstein.errors.MapWarning")
def test_damage_is_an_error_or_harmless(data: st.DataObject) -> None:
    text = HUNG
    start = data.draw(st.integers(0, len(text)))
    kind = data.draw(st.sampled_from(["cut", "delete", "insert", "swap"]))
    end = len(text) if kind == "cut" else min(len(text), start + data.draw(st.integers(1, 60)))
    pieces = ["{", "}", '"', "( ", ") ", "9", "-", ".5", "e9", "\n", "//", "patchDef2", "\0", "é"]
    new = (
        ""
        if kind in ("cut", "delete")
        else "".join(data.draw(st.lists(st.sampled_from(pieces), min_size=1, max_size=4)))
    )
    text = text[:start] + new + text[start if kind == "insert" else end :]
    try:
        tilemap = convert(text)
    except MapError:
        return
    parse_ascii(tilemap.tile_text(), goal_required=False, faces=tilemap.faces_text())
