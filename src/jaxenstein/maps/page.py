"""Reading the lines of a text: which matter, whether they are too long, unknown characters."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass

from ..errors import MapError
from .symbols import PEACEFUL, SYMBOLS, characters
from .tilemap import MAX_SIZE

PAINT = {c for c, symbol in SYMBOLS.items() if symbol.kind in ("wall", "floor")}
"""The characters of texts that say how walls look."""


@dataclass(frozen=True)
class Page:
    """The lines of a text that matter.

    Attributes:
        lines: without the empty ones before and after.
        first_line: the number of the first of them in the text, from 1.
        source: which text it is, for errors; "" for the map itself.
    """

    lines: list[str]
    first_line: int
    source: str = ""

    @property
    def width(self) -> int:
        """Characters of the longest line."""
        return max(map(len, self.lines), default=0)


def split_lines(text: str, source: str = "") -> list[str]:
    """The lines of a text, without byte order mark and blanks after the last line end.

    Raises:
        MapError: it is not text.
    """
    if not isinstance(text, str):
        raise MapError(f"a map is text (str), not {type(text).__name__}", source=source)
    lines = re.split(r"\r\n|\r|\n", text.removeprefix("\ufeff"))
    if len(lines) > 1 and not lines[-1].strip(" "):
        lines[-1] = ""
    return lines


def make_page(
    lines: list[str], first_line: int, source: str = "", known: Collection[str] = PEACEFUL
) -> Page:
    """The lines without the empty ones before and after, checked.

    Args:
        lines: the lines of a text or of a part of it.
        first_line: number of the first one, from 1.
        source: which text it is, for errors.
        known: the characters that it may hold.

    Raises:
        MapError: the lines are empty, too long or too many, or hold another character.
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
        shooters = "has its place in shooters (jaxenstein.tasks.shooter) alone"
        return f"{character!r} ({symbol.meaning}) {shooters}{hint}"
    return f"{character!r} ({symbol.meaning}) has no place here, only {characters(known)}"
