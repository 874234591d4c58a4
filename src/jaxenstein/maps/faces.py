"""The lines of text maps, and the texts that set the look of walls: regions and faces."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from ..errors import MapError, nearest, quoted
from .symbols import DEFAULT_WALL, DOOR_LABELS, PEACEFUL, SYMBOLS, characters
from .tilemap import FACES, MAX_SIZE, TileMap, Tiles

REGIONS_SOURCE = "regions text"
FACES_SOURCE = "faces text"
PAINT = {c for c, symbol in SYMBOLS.items() if symbol.kind in ("wall", "floor")}
"""The characters allowed in regions and faces texts."""


@dataclass(frozen=True)
class Page:
    """The lines of a text, without empty lines around them.

    Attributes:
        lines: the lines.
        first_line: the line number of the first one in the text, from 1.
        source: the name of the text, for errors; "" for the map itself.
    """

    lines: list[str]
    first_line: int
    source: str = ""

    @property
    def width(self) -> int:
        """The number of characters of the longest line."""
        return max(map(len, self.lines), default=0)


def split_lines(text: str, source: str = "") -> list[str]:
    """Split a text into lines, without byte order mark and spaces after the last line end.

    Raises:
        MapError: the value is not text.
    """
    if not isinstance(text, str):
        raise MapError(f"a map must be text (str), not {type(text).__name__}", source=source)
    lines = re.split(r"\r\n|\r|\n", text.removeprefix("\ufeff"))
    if len(lines) > 1 and not lines[-1].strip(" "):
        lines[-1] = ""
    return lines


def make_page(
    lines: list[str], first_line: int, source: str = "", known: Collection[str] = PEACEFUL
) -> Page:
    """Remove empty lines before and after, and check the rest.

    Args:
        lines: the lines of a text or of a part of it.
        first_line: the line number of the first one, from 1.
        source: the name of the text, for errors.
        known: the allowed characters.

    Raises:
        MapError: there are no lines, they are too long or too many, or contain another character.
    """
    filled = [number for number, line in enumerate(lines) if line]
    if not filled:
        raise MapError("the map is empty", source=source)
    page = Page(lines[filled[0] : filled[-1] + 1], filled[0] + first_line, source)
    _check_size(page)
    for number, line in enumerate(page.lines, start=page.first_line):
        for column, character in enumerate(line, start=1):
            if character not in known:
                message = _unknown(character, known)
                raise MapError(message, line=number, column=column, source=source)
    return page


def _check_size(page: Page) -> None:
    limit = f"the map is too large: the limit is {MAX_SIZE} columns and {MAX_SIZE} rows"
    if len(page.lines) > MAX_SIZE:
        raise MapError(limit, line=page.first_line + MAX_SIZE, source=page.source)
    for number, line in enumerate(page.lines, start=page.first_line):
        if len(line) > MAX_SIZE:
            raise MapError(limit, line=number, column=MAX_SIZE + 1, source=page.source)


def _unknown(character: str, known: Collection[str]) -> str:
    if character == "\t":
        return "a tab has no fixed width; use '.' or spaces for floor"
    other, symbol = SYMBOLS.get(character.swapcase()), SYMBOLS.get(character)
    hint = ""
    if other is not None and other is not symbol:
        hint = f", did you mean {other.character!r} ({other.meaning})?"
    if symbol is None:
        return f"unknown symbol {character!r}{hint}; the symbols are {characters(known)}"
    if symbol.role:
        shooters = "is only allowed in shooters (jaxenstein.tasks.shooter)"
        return f"{character!r} ({symbol.meaning}) {shooters}{hint}"
    return f"{character!r} ({symbol.meaning}) is not allowed here, only {characters(known)}"


def read_regions(tilemap: TileMap, text: str) -> tuple[Tiles, ...] | None:
    """The wall faces that a regions text sets.

    Args:
        tilemap: the map with the walls.
        text: see `ascii.parse_ascii`.

    Returns:
        As `TileMap.faces`; None if all walls keep their own look.

    Raises:
        MapError: the text does not fit the map; the message names line and column.
    """
    page = make_page(split_lines(text, REGIONS_SOURCE), 1, REGIONS_SOURCE, PAINT)
    _check_shape(tilemap, page)
    _check_regions(tilemap, page)
    walls = tilemap.walls
    painted = np.pad(_labels(page, walls.shape), 1)
    is_wall = _is_wall(walls)
    painted[1:-1, 1:-1][is_wall] = 0
    beside = (painted[1:-1, :-2], painted[1:-1, 2:], painted[:-2, 1:-1], painted[2:, 1:-1])
    return _as_faces([np.where(is_wall & (paint != 0), paint, walls) for paint in beside], walls)


def read_faces(tilemap: TileMap, text: str) -> tuple[Tiles, ...] | None:
    """The wall faces that a faces text sets, the inverse of `TileMap.faces_text`.

    Args:
        tilemap: the map with the walls.
        text: see `ascii.parse_ascii`.

    Returns:
        As `TileMap.faces`; None if all walls keep their own look.

    Raises:
        MapError: the text does not fit the map; the message names line and column.
    """
    walls = tilemap.walls
    pages = _blocks(split_lines(text, FACES_SOURCE))
    faces = []
    for face in FACES:
        shown = np.zeros_like(walls)
        if face in pages:
            _check_shape(tilemap, pages[face])
            _check_face(tilemap, pages[face])
            shown = _labels(pages[face], walls.shape)
        faces.append(np.where(shown != 0, shown, walls))
    return _as_faces(faces, walls)


def _blocks(lines: list[str]) -> dict[str, Page]:
    """The page below each heading."""
    starts = [number for number, line in enumerate(lines) if _heading(line, number + 1)]
    first = next((number for number, line in enumerate(lines) if line.strip(" ")), 0)
    if first not in starts:
        message = f"the text must start with a heading: one of {', '.join(FACES)}"
        raise MapError(message, line=first + 1, source=FACES_SOURCE)
    pages: dict[str, Page] = {}
    for start, end in zip(starts, [*starts[1:], len(lines)], strict=True):
        face, block = lines[start].strip(" "), lines[start + 1 : end]
        problem = f"a second heading {face!r}" if face in pages else ""
        problem = problem or ("" if any(block) else f"nothing follows the heading {face!r}")
        if problem:
            raise MapError(problem, line=start + 1, source=FACES_SOURCE)
        pages[face] = make_page(block, start + 2, FACES_SOURCE, PAINT)
    return pages


def _heading(line: str, number: int) -> bool:
    """Whether a line is a heading; raises for a misspelled one."""
    word = line.strip(" ")
    if word not in FACES and not set(word) <= PAINT and nearest(word, FACES):
        message = f"unknown heading {quoted(word)}{nearest(word, FACES)}"
        raise MapError(message, line=number, source=FACES_SOURCE)
    return word in FACES


def _labels(page: Page, shape: tuple[int, ...]) -> np.ndarray:
    """uint8[rows, columns], the wall on each tile of a page, 0 for floor."""
    labels = np.zeros(shape, np.uint8)
    for row, line in enumerate(page.lines):
        labels[row, : len(line)] = [SYMBOLS[character].tile for character in line]
    return labels


def _is_wall(walls: np.ndarray) -> np.ndarray:
    return (walls >= DEFAULT_WALL) & (walls < DOOR_LABELS.start)


def _as_faces(faces: list[np.ndarray], walls: np.ndarray) -> tuple[Tiles, ...] | None:
    if all((face == walls).all() for face in faces):
        return None
    return tuple(tuple(row.tobytes() for row in face) for face in faces)


def _check_shape(tilemap: TileMap, page: Page) -> None:
    """Check that a text has the shape of the map."""
    for number, line in enumerate(page.lines, start=page.first_line):
        row = number - page.first_line
        if row == tilemap.rows or len(line) > tilemap.columns:
            extra = None if row == tilemap.rows else tilemap.columns + 1
            raise _size_error(tilemap, page, number, extra)
    if len(page.lines) < tilemap.rows or page.width < tilemap.columns:
        raise _size_error(tilemap, page, page.first_line + len(page.lines) - 1, None)


def _size_error(tilemap: TileMap, page: Page, line: int, column: int | None) -> MapError:
    return MapError(
        f"{page.width} columns and {len(page.lines)} rows do not fit the map, "
        f"which has {tilemap.columns} and {tilemap.rows}",
        line=line,
        column=column,
        source=page.source,
    )


def _check_regions(tilemap: TileMap, page: Page) -> None:
    """Check that a regions text sets no wall tiles."""
    for row, line in enumerate(page.lines):
        for column, character in enumerate(line):
            tile, paint = tilemap.tiles[row][column], SYMBOLS[character].tile
            if 0 < tile < DOOR_LABELS.start and paint not in (0, DEFAULT_WALL, tile):
                message = f"{character!r} is on a wall of the map; regions belong on floor"
                raise _misplaced(message, page, row, column)


def _check_face(tilemap: TileMap, page: Page) -> None:
    """Check that a block of a faces text only sets wall tiles."""
    for row, line in enumerate(page.lines):
        for column, character in enumerate(line):
            tile = tilemap.tiles[row][column]
            if SYMBOLS[character].tile and tile not in range(DEFAULT_WALL, DOOR_LABELS.start):
                place = "a door, which keeps its own look" if tile else "floor, which has no faces"
                raise _misplaced(f"{character!r} is on {place}", page, row, column)


def _misplaced(message: str, page: Page, row: int, column: int) -> MapError:
    line = page.first_line + row
    return MapError(message, line=line, column=column + 1, source=page.source)
