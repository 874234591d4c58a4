"""Pictures in a terminal: two pixels per character, in 24-bit colour; only changes are redrawn.

Every character is an upper half block: its colour is the upper pixel, its background the lower
one. Needs a POSIX terminal: `termios` is imported when a terminal is opened.
"""

from __future__ import annotations

import contextlib
import importlib
import os
import re
import select
import sys
import time
from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from PIL import Image

from ..view.recording import BACKGROUND, TEXT
from .display import LONGEST_WAIT, Display, DisplayError, Event, Rectangle

HALF_BLOCK = "\u2580"
# Alternate screen, no cursor, no line wrapping; and back.
ENTER, LEAVE = "\x1b[?1049h\x1b[?25l\x1b[?7l\x1b[2J", "\x1b[0m\x1b[?7h\x1b[?25h\x1b[?1049l"
# Terminals that support these codes show everything between them at once; others ignore them.
BEGIN, END = "\x1b[?2026h", "\x1b[?2026l"
# After each picture the terminal is asked for an answer, and the next picture waits for it at most
# this many seconds, so that pictures never queue up on a slow connection.
ASK, ANSWER, PATIENCE = "\x1b[6n", re.compile(rb"\x1b\[\d+;\d+R"), 1.0
# Seconds within which the rest of an escape sequence must follow.
ESCAPE_WAIT = 0.1

SEQUENCE = re.compile(rb"\x1b(?:\[[0-?]*[ -/]*[@-~]|O[A-Za-z])")
UNFINISHED = re.compile(rb"\x1b(?:\[[0-?]*[ -/]*|O)?$")
ARROWS = {b"A": "up", b"B": "down", b"C": "right", b"D": "left"}
NAMES = {" ": "space", "\r": "return", "\n": "return", "\t": "tab"}


class Keys:
    """Reads keys from the bytes that a terminal sends.

    Attributes:
        answers: the number of answers to `ASK` so far.
    """

    def __init__(self) -> None:
        """Start without input."""
        self.answers = 0
        self._rest = b""

    @property
    def unfinished(self) -> bool:
        """Whether an escape sequence has started, or the Escape key was pressed."""
        return bool(self._rest)

    def feed(self, data: bytes) -> list[str]:
        """The names of the keys in some bytes; unknown sequences are left out."""
        data, self._rest = self._rest + data, b""
        keys = []
        while data:
            if found := SEQUENCE.match(data):
                self.answers += ANSWER.fullmatch(found.group()) is not None
                arrow = ARROWS.get(data[found.end() - 1 : found.end()])
                keys += [arrow] if arrow else []
                data = data[found.end() :]
            elif UNFINISHED.match(data):
                self._rest, data = data, b""
            elif data[:1] == b"\x1b":
                # Escape twice, or a key with Alt, which has no meaning here.
                keys += ["escape"] if data[1:2] == b"\x1b" else []
                data = data[2:]
            else:
                letter, data = chr(data[0]), data[1:]
                if letter.isascii() and (letter.isprintable() or letter in NAMES):
                    keys.append(NAMES.get(letter, letter.lower()))
        return keys

    def flush(self) -> list[str]:
        """The key of an unfinished sequence: Escape, or none."""
        escape, self._rest = self._rest == b"\x1b", b""
        return ["escape"] if escape else []


class Cells(NamedTuple):
    """The content of a terminal, R rows of C characters.

    Attributes:
        letters: str[R, C], one character each.
        ink: uint8[R, C, 3], their colours.
        paper: uint8[R, C, 3], their backgrounds.
    """

    letters: np.ndarray
    ink: np.ndarray
    paper: np.ndarray

    @classmethod
    def of_picture(cls, picture: np.ndarray) -> Cells:
        """Half blocks for uint8[2 R, C, 3], and spaces where both halves are equal."""
        upper, lower = picture[0::2].copy(), picture[1::2].copy()
        alike = np.all(upper == lower, axis=-1)
        return cls(np.where(alike, " ", HALF_BLOCK), upper, lower)

    def write(self, row: int, column: int, text: str) -> None:
        """Write text on top; text that does not fit is cut off."""
        rows, columns = self.letters.shape
        text = text[: columns - column]
        if 0 <= row < rows and text:
            place = row, slice(column, column + len(text))
            self.letters[place] = list(text)
            self.ink[place], self.paper[place] = TEXT, BACKGROUND

    def changes(self, before: Cells | None) -> str:
        """The codes that turn a terminal with the content `before` into this one."""
        changed = np.ones(self.letters.shape, bool)
        if before is not None and before.letters.shape == self.letters.shape:
            changed = self.letters != before.letters
            changed |= np.any(self.ink != before.ink, axis=-1)
            changed |= np.any(self.paper != before.paper, axis=-1)
        out, pen, after = [], (None, None), (-1, -1)
        for row, column in np.argwhere(changed).tolist():
            if (row, column) != after:
                out.append(f"\x1b[{row + 1};{column + 1}H")
            ink, paper = self.ink[row, column].tolist(), self.paper[row, column].tolist()
            codes = [f"38;2;{ink[0]};{ink[1]};{ink[2]}"] if ink != pen[0] else []
            codes += [f"48;2;{paper[0]};{paper[1]};{paper[2]}"] if paper != pen[1] else []
            out += [f"\x1b[{';'.join(codes)}m"] if codes else []
            out.append(str(self.letters[row, column]))
            pen, after = (ink, paper), (row, column + 1)
        return "".join(out)


class Terminal(Display):
    """A display of characters with two pixels each. Leaving its context restores the terminal.

    A key counts as released right after it is pressed, because terminals do not report more.
    """

    finer = 3
    gap = 1

    def __init__(self, source: int = 0, target: int = 1) -> None:
        """Prepare a terminal; it is unchanged until the context is entered.

        Args:
            source: file descriptor to read keys from, by default standard input.
            target: file descriptor to write to, by default standard output.

        Raises:
            DisplayError: it is not a POSIX terminal, or does not support UTF-8.
        """
        self._source, self._target = source, target
        try:
            self._termios: Any = importlib.import_module("termios")
        except ImportError as error:
            raise DisplayError("playing in the terminal needs Linux or macOS (termios)") from error
        for descriptor, name in ((self._source, "input"), (self._target, "output")):
            if not os.isatty(descriptor):
                raise DisplayError(f"standard {name} is not a terminal")
        encoding = getattr(sys.__stdout__, "encoding", "utf-8")
        if target == 1 and encoding.lower().replace("-", "") != "utf8":
            raise DisplayError(f"the terminal uses {encoding}, not UTF-8; set LC_ALL=C.UTF-8")
        self._keys = Keys()
        self._asked = 0
        self._answers = True
        self._saved: Any = None
        self._gone = False
        self._shown: Cells | None = None
        self._size = (80, 24)
        self._size = self.size

    @property
    def size(self) -> tuple[int, int]:
        """(columns, rows) of characters."""
        try:
            columns, rows = os.get_terminal_size(self._target)
        except OSError:
            return self._size
        # Some terminals, such as serial ones, do not know their size.
        return columns or 80, rows or 24

    def __enter__(self) -> Self:
        """Switch to an empty screen, and read keys as they are pressed."""
        termios = self._termios
        self._saved = termios.tcgetattr(self._source)
        mode = termios.tcgetattr(self._source)
        mode[3] &= ~(termios.ICANON | termios.ECHO)
        # Ctrl-Z would leave the shell with this screen.
        mode[6][termios.VSUSP] = bytes([os.fpathconf(self._source, "PC_VDISABLE") & 255])
        mode[6][termios.VMIN], mode[6][termios.VTIME] = 1, 0
        try:
            termios.tcsetattr(self._source, termios.TCSANOW, mode)
            self._write(ENTER)
        except BaseException:
            self.close()
            raise
        return self

    def close(self) -> None:
        """Restore the terminal; calling it again does nothing."""
        if self._saved is None:
            return
        self._write(LEAVE)
        termios, saved, self._saved = self._termios, self._saved, None
        with contextlib.suppress(termios.error, OSError):
            # A late answer must not end up in the shell.
            if self._keys.answers < self._asked:
                select.select([self._source], [], [], ESCAPE_WAIT)
            termios.tcflush(self._source, termios.TCIFLUSH)
            termios.tcsetattr(self._source, termios.TCSANOW, saved)

    def show(
        self,
        frame: np.ndarray | None,
        lines: Sequence[str] = (),
        *,
        beside: np.ndarray | None = None,
        overlay: Sequence[str] = (),
    ) -> None:
        """Redraw what has changed; see `Display.show`."""
        columns, rows = self._size
        canvas = np.empty((2 * rows, columns, 3), np.uint8)
        canvas[:] = BACKGROUND
        for picture, box in self.arranged(frame, beside, len(lines)):
            _paste(canvas, picture, box)
        cells = Cells.of_picture(canvas)
        first = self.area(len(lines)).height // 2
        for i, line in enumerate(lines):
            cells.write(first + i, 0, line.ljust(columns))
        if overlay:
            width = max(map(len, overlay)) + 4
            top, left = max(0, (first - len(overlay) - 2) // 2), max(0, (columns - width) // 2)
            for i, line in enumerate(("", *overlay, "")):
                cells.write(top + i, left, f"  {line}".ljust(width))
        ask = ASK if self._answers else ""
        self._write(BEGIN + cells.changes(self._shown) + END + ask)
        self._shown = cells
        self._asked += self._answers

    def events(self, timeout: float = 0.0) -> list[Event]:
        """Keys, a new size, or the end of the terminal; see `Display.events`."""
        events = [event for key in self._read(min(timeout, LONGEST_WAIT)) for event in _tap(key)]
        start = time.monotonic()
        while self._answers and self._keys.answers < self._asked and not self._gone:
            events += [event for key in self._read(LONGEST_WAIT) for event in _tap(key)]
            self._answers = time.monotonic() - start < PATIENCE
        if self.size != self._size:
            self._size = self.size
            self._write("\x1b[0m\x1b[2J")
            events.append(Event("redraw"))
        return [*events, Event("close")] if self._gone else events

    def area(self, lines: int) -> Rectangle:
        """The room for pictures above a number of lines of text, in pixels."""
        columns, rows = self._size
        return Rectangle(0, 0, columns, 2 * max(1, rows - lines))

    def _read(self, timeout: float) -> list[str]:
        """The keys pressed within a number of seconds."""
        if self._gone:
            return []
        if not select.select([self._source], [], [], timeout)[0]:
            return []
        keys = self._keys.feed(self._take())
        while self._keys.unfinished and not self._gone:
            if select.select([self._source], [], [], ESCAPE_WAIT)[0]:
                keys += self._keys.feed(self._take())
            else:
                keys += self._keys.flush()
        return keys

    def _take(self) -> bytes:
        try:
            data = os.read(self._source, 4096)
        except OSError:
            data = b""
        self._gone = not data
        return data

    def _write(self, text: str) -> None:
        data = text.encode()
        while data and not self._gone:
            try:
                data = data[os.write(self._target, data) :]
            except BlockingIOError:
                select.select([], [self._target], [], LONGEST_WAIT)
            except OSError:
                self._gone = True


def _tap(key: str) -> tuple[Event, Event]:
    return Event("press", key), Event("release", key)


def _paste(canvas: np.ndarray, picture: np.ndarray, box: Rectangle) -> None:
    """Draw a picture into a box: enlarge it without smoothing, shrink it by averaging."""
    shrunk = box.width < picture.shape[1]
    how = Image.Resampling.BOX if shrunk else Image.Resampling.NEAREST
    image = Image.fromarray(picture).resize((box.width, box.height), how)
    canvas[box.top : box.top + box.height, box.left : box.left + box.width] = np.asarray(image)
