"""Text maps: one line a row, one character a tile; `symbols` says what each means."""

from __future__ import annotations

import dataclasses
import importlib.resources
import re
import warnings
from dataclasses import dataclass
from importlib.resources.abc import Traversable

import numpy as np

from ..errors import MapError, MapWarning, nearest
from .reach import problems
from .symbols import DEFAULT_WALL, DOOR_LABELS, SYMBOLS, Symbol, characters
from .tilemap import MAX_SIZE, Door, Key, TileMap, Tiles

REGIONS_SOURCE = "regions text"
_WALL = SYMBOLS["#"]
_REGION_CHARACTERS = {c for c, symbol in SYMBOLS.items() if symbol.kind in ("wall", "floor")}


def parse_ascii(
    text: str,
    name: str = "custom",
    *,
    goal_required: bool = True,
    regions: str | None = None,
    stacklevel: int = 2,
) -> TileMap:
    """Read a map from text.

    Empty lines before and after the map are dropped, as are a byte order mark, the returns of
    Windows line ends, and blanks after the last line end, where closing quotes are indented.
    Other blanks are floor, so indentation is not taken off. Short lines are filled up with
    default wall. Everything outside the map is solid.

    Args:
        text: the map; `symbols.legend()` explains the characters.
        name: what to call it.
        goal_required: whether a map without a goal is an error.
        regions: a second text of the same shape. The wall symbol on a floor or door tile says
            what every wall face beside that tile shows; floor symbols leave the walls as they
            are. On a wall it may only repeat the wall's symbol, `#` or floor. Doors keep their
            own look.
        stacklevel: whose line a warning names, as for `warnings.warn`.

    Raises:
        MapError: for an unknown symbol, an empty map, one of more than `MAX_SIZE` columns or
            rows, one without a spawn or without a goal where one is needed, and regions that
            do not fit. Line and column are those of the text as given, counted from 1.

    Warns:
        MapWarning: for each goal that no spawn reaches and each spawn that reaches no goal,
            either with all doors open or for want of a key.
    """
    page = _read_page(text)
    tilemap = _build(name, [[SYMBOLS[character] for character in line] for line in page.lines])
    if not tilemap.spawns:
        raise MapError("the map has no spawn: put an 'S' where an episode may start")
    if goal_required and not tilemap.goals:
        raise MapError("the map has no goal: put a 'G' where the goal may lie")
    if regions is not None:
        tilemap = dataclasses.replace(tilemap, faces=_read_faces(tilemap, regions))
    for problem, (column, row) in problems(tilemap):
        place = f"line {page.first_line + row}, column {column + 1}"
        warnings.warn(f"{place}: {problem}", MapWarning, stacklevel=stacklevel)
    return tilemap


def layout_names() -> tuple[str, ...]:
    """Names of the maps that come with the package."""
    files = (item.name for item in _layouts().iterdir())
    return tuple(sorted(f[:-4] for f in files if f.endswith(".txt") and f.count(".") == 1))


def load_layout(name: str, *, regions: bool = True, goal_required: bool = True) -> TileMap:
    """One of the maps that come with the package.

    Args:
        name: one of `layout_names()`.
        regions: whether to colour the walls by the layout's regions, if it has any.
        goal_required: whether a map without a goal is an error.

    Raises:
        MapError: if there is no such layout.
    """
    names = layout_names()
    if name not in names:
        raise MapError(f"unknown layout {name!r}{nearest(name, names)}; known: {', '.join(names)}")
    painted = _layouts() / f"{name}.regions.txt"
    return parse_ascii(
        (_layouts() / f"{name}.txt").read_text("utf-8"),
        name,
        goal_required=goal_required,
        regions=painted.read_text("utf-8") if regions and painted.is_file() else None,
    )


def _layouts() -> Traversable:
    return importlib.resources.files("jaxenstein.maps") / "layouts"


@dataclass(frozen=True)
class _Page:
    """The lines of a text that matter, and the number of the first one, from 1."""

    lines: list[str]
    first_line: int

    @property
    def width(self) -> int:
        return max(map(len, self.lines))


def _read_page(text: str, known: set[str] | None = None, source: str = "") -> _Page:
    """Split a text into lines and check its size and characters."""
    if not isinstance(text, str):
        raise MapError(f"a map is text (str), not {type(text).__name__}", source=source)
    lines = re.split(r"\r\n|\r|\n", text.removeprefix("\ufeff"))
    if len(lines) > 1 and not lines[-1].strip(" "):
        lines[-1] = ""
    filled = [number for number, line in enumerate(lines) if line]
    if not filled:
        raise MapError("the map is empty", source=source)
    page = _Page(lines[filled[0] : filled[-1] + 1], filled[0] + 1)
    _check_size(page, source)
    for number, line in enumerate(page.lines, start=page.first_line):
        for column, character in enumerate(line, start=1):
            if character not in (known or SYMBOLS):
                message = _unknown(character, known)
                raise MapError(message, line=number, column=column, source=source)
    return page


def _check_size(page: _Page, source: str) -> None:
    limit = f"the map is too large: the limit is {MAX_SIZE} columns and {MAX_SIZE} rows"
    if len(page.lines) > MAX_SIZE:
        raise MapError(limit, line=page.first_line + MAX_SIZE, source=source)
    for number, line in enumerate(page.lines, start=page.first_line):
        if len(line) > MAX_SIZE:
            raise MapError(limit, line=number, column=MAX_SIZE + 1, source=source)


def _unknown(character: str, known: set[str] | None) -> str:
    if character == "\t":
        return "a tab has no fixed width; use '.' or spaces for floor"
    if known is not None and character in SYMBOLS:
        meaning = SYMBOLS[character].meaning
        return f"{character!r} ({meaning}) has no place here, only {characters('wall', 'floor')}"
    other = SYMBOLS.get(character.swapcase())
    hint = f", did you mean {other.character!r} ({other.meaning})?" if other else ""
    return f"unknown symbol {character!r}{hint}; the symbols are {characters()}"


def _build(name: str, grid: list[list[Symbol]]) -> TileMap:
    """Collect what the symbols put on each tile."""
    columns = max(map(len, grid))
    grid = [line + [_WALL] * (columns - len(line)) for line in grid]
    placed = [(c, r, symbol) for r, line in enumerate(grid) for c, symbol in enumerate(line)]
    return TileMap(
        name=name,
        tiles=tuple(bytes(symbol.tile for symbol in line) for line in grid),
        spawns=tuple((c, r) for c, r, symbol in placed if symbol.kind == "spawn"),
        goals=tuple((c, r) for c, r, symbol in placed if symbol.kind == "goal"),
        keys=tuple(Key(c, r, symbol.colour) for c, r, symbol in placed if symbol.kind == "key"),
        doors=tuple(
            Door(c, r, symbol.colour, symbol.locked)
            for c, r, symbol in placed
            if symbol.kind == "door"
        ),
    )


def _read_faces(tilemap: TileMap, text: str) -> tuple[Tiles, ...] | None:
    """The faces that a regions text asks for; None if they are all the walls' own."""
    page = _read_page(text, _REGION_CHARACTERS, REGIONS_SOURCE)
    _check_fit(tilemap, page)
    walls = tilemap.walls
    painted = np.zeros((tilemap.rows + 2, tilemap.columns + 2), np.uint8)
    for row, line in enumerate(page.lines):
        for column, character in enumerate(line):
            painted[row + 1, column + 1] = SYMBOLS[character].tile
    is_wall = (walls >= DEFAULT_WALL) & (walls < DOOR_LABELS.start)
    painted[1:-1, 1:-1][is_wall] = 0
    beside = (painted[1:-1, :-2], painted[1:-1, 2:], painted[:-2, 1:-1], painted[2:, 1:-1])
    faces = [np.where(is_wall & (paint != 0), paint, walls) for paint in beside]
    if all((face == walls).all() for face in faces):
        return None
    return tuple(tuple(row.tobytes() for row in face) for face in faces)


def _check_fit(tilemap: TileMap, page: _Page) -> None:
    """Check that a regions text has the map's shape and paints no wall."""
    for number, line in enumerate(page.lines, start=page.first_line):
        row = number - page.first_line
        if row == tilemap.rows or len(line) > tilemap.columns:
            extra = None if row == tilemap.rows else tilemap.columns + 1
            raise _misfit(tilemap, page, number, extra)
        for column, character in enumerate(line):
            tile, paint = tilemap.tiles[row][column], SYMBOLS[character].tile
            if 0 < tile < DOOR_LABELS.start and paint not in (0, DEFAULT_WALL, tile):
                message = f"{character!r} lies on a wall of the map; regions are painted on floor"
                raise MapError(message, line=number, column=column + 1, source=REGIONS_SOURCE)
    if len(page.lines) < tilemap.rows or page.width < tilemap.columns:
        raise _misfit(tilemap, page, page.first_line + len(page.lines) - 1, None)


def _misfit(tilemap: TileMap, page: _Page, line: int, column: int | None) -> MapError:
    return MapError(
        f"{page.width} columns and {len(page.lines)} rows do not fit the map, "
        f"which has {tilemap.columns} and {tilemap.rows}",
        line=line,
        column=column,
        source=REGIONS_SOURCE,
    )
