"""The errors and warnings of this package, and helpers for their messages."""

from __future__ import annotations

import difflib
import re
import reprlib
from collections.abc import Iterable
from typing import Any

# The most characters of a message, of a word in it, and of a quoted value.
LONGEST_MESSAGE, LONGEST_WORD, LONGEST_QUOTE = 1500, 400, 100


class JAXensteinError(ValueError):
    """Base of the errors of this package; messages have at most `LONGEST_MESSAGE` characters."""

    def __init__(self, message: str = "", *more: Any) -> None:
        """Store the message; a long one loses its middle."""
        super().__init__(concise(message), *more)


class MapError(JAXensteinError):
    """A map that cannot be used.

    Attributes:
        line: the faulty line of the text, counted from 1; None if no single line is at fault.
        column: the faulty character of that line, counted from 1; None if there is no single one.
    """

    def __init__(
        self, message: str, *, line: int | None = None, column: int | None = None, source: str = ""
    ) -> None:
        """Create the error; its message begins with the place.

        Args:
            message: what is wrong, without the place.
            line: line of the text, from 1.
            column: character of the line, from 1.
            source: the name of the text, if there are several.
        """
        place = ", ".join(
            part
            for part in (
                source,
                "" if line is None else f"line {line}",
                "" if column is None else f"column {column}",
            )
            if part
        )
        super().__init__(f"{place}: {message}" if place else message)
        self.line = line
        self.column = column


class SettingError(JAXensteinError):
    """A setting, argument or file that is unknown, unreadable or invalid."""


class UnknownEnvironmentError(JAXensteinError):
    """An environment id that does not exist."""


class TrajectoryError(JAXensteinError):
    """A trajectory that cannot be saved, read or replayed; the message names file and entry."""


class WadError(JAXensteinError):
    """A WAD file that cannot be read, or lacks something; the message names the file."""


class MapWarning(UserWarning):
    """A map that is usable but probably not what its author meant."""


class LevelWarning(UserWarning):
    """There are so few levels that different seeds draw the same levels."""


class DivergenceWarning(UserWarning):
    """Training diverged: the agent's parameters are not finite, or are the last finite ones."""


def one_line(text: str) -> str:
    r"""Text as one line for a terminal, with control characters escaped.

    Examples:
        >>> one_line("a\n  b\x1b[2J")
        'a b\\x1b[2J'
    """
    line = " ".join(text.split())
    return "".join(sign if sign.isprintable() else ascii(sign)[1:-1] for sign in line)


def concise(message: str) -> str:
    """Shorten a message to `LONGEST_MESSAGE` characters, with words of at most `LONGEST_WORD`.

    Names from files may have any length.

    Examples:
        >>> concise("x" * 100_000 + " must be positive")[-25:]
        'xxxxxxxx must be positive'
    """
    word = rf"\S{{{LONGEST_WORD + 1},}}"
    message = re.sub(word, lambda found: shortened(found[0], LONGEST_WORD), message)
    return shortened(message, LONGEST_MESSAGE)


def shortened(text: str, most: int) -> str:
    """Shorten text to at most `most` characters by replacing its middle with "...".

    Examples:
        >>> shortened("abcdefghijkl", 9)
        'abc...jkl'
    """
    if len(text) <= most:
        return text
    first = (most - 3) // 2
    return f"{text[:first]}...{text[len(text) - (most - 3 - first) :]}"


_QUOTING = reprlib.Repr()
_QUOTING.maxstring = _QUOTING.maxother = _QUOTING.maxlong = LONGEST_QUOTE


def quoted(value: Any) -> str:
    r"""The `repr` of a value for a message, shortened to `LONGEST_QUOTE` characters.

    Examples:
        >>> quoted("a\n")
        "'a\\n'"
        >>> len(quoted("a" * 100_000)), len(quoted([["a" * 1000] * 1000] * 1000))
        (100, 100)
    """
    return shortened(_QUOTING.repr(value), LONGEST_QUOTE)


def nearest(word: str, candidates: Iterable[str]) -> str:
    """A phrase to append, such as ", did you mean 'simple'?"; "" if no candidate is close.

    Args:
        word: the given word.
        candidates: the names that exist; case is ignored.

    Examples:
        >>> nearest("simpel", ["simple", "key-door"])
        ", did you mean 'simple'?"
    """
    by_fold = {name.casefold(): name for name in candidates}
    near = difflib.get_close_matches(str(word).casefold(), by_fold, n=2, cutoff=0.6)
    if not near:
        return ""
    return f", did you mean {' or '.join(repr(by_fold[name]) for name in near)}?"
