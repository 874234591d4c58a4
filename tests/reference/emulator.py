"""A terminal emulator for the half-block display: a pseudo terminal with a readable screen."""

from __future__ import annotations

import os
import re
import select
import struct
import threading
import time

import numpy as np

from jaxenstein.view.recording import BACKGROUND, TEXT

HALF_BLOCK = "\u2580"


class Emulator:
    """The user's end of a pseudo terminal: shows its output and sends keys.

    It supports only what the display may use: cursor addressing, 24-bit colours, clearing, private
    modes and the query of the cursor position.
    """

    def __init__(self, columns: int, rows: int, *, answers: bool = True) -> None:
        self.master, self.slave = os.openpty()
        self.resize(columns, rows)
        self.modes: dict[str, bool] = {}
        self.received = 0
        self._answers = answers
        self._at = (0, 0)
        self._ink, self._paper = TEXT, BACKGROUND
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def resize(self, columns: int, rows: int) -> None:
        import fcntl
        import termios

        size = struct.pack("HHHH", rows, columns, 0, 0)
        fcntl.ioctl(self.slave, termios.TIOCSWINSZ, size)
        self.letters = np.full((rows, columns), " ")
        self.colours = np.zeros((2, rows, columns, 3), np.uint8)

    def send(self, keys: bytes) -> None:
        os.write(self.master, keys)

    def close(self) -> None:
        self._stop.set()
        self._thread.join(5)
        os.close(self.slave)
        os.close(self.master)

    def settle(self) -> None:
        """Wait until all output has been shown."""
        quiet = time.monotonic()
        seen = self.received
        while time.monotonic() - quiet < 0.1:
            time.sleep(0.01)
            if self.received != seen:
                quiet, seen = time.monotonic(), self.received

    def picture(self) -> np.ndarray:
        """uint8[2 * rows, columns, 3]: half blocks as pixels, and text as its background."""
        upper = np.where((self.letters == HALF_BLOCK)[..., None], *self.colours)
        return np.stack([upper, self.colours[1]], axis=1).reshape(-1, *upper.shape[1:])

    def line(self, row: int) -> str:
        return "".join(self.letters[row]).rstrip()

    def _run(self) -> None:
        rest = b""
        while not self._stop.is_set():
            if not select.select([self.master], [], [], 0.05)[0]:
                continue
            try:
                data = os.read(self.master, 65536)
            except OSError:
                return
            rest = self._take(rest + data)
            self.received += len(data)

    def _take(self, data: bytes) -> bytes:
        """Show complete sequences; return the rest."""
        text, at = data.decode("utf-8", "ignore"), 0
        if data and data[-1] >= 0x80 and not data.endswith(HALF_BLOCK.encode()):
            return data
        while at < len(text):
            if text[at] == "\x1b":
                found = re.compile(r"\x1b\[([?0-9;]*)([A-Za-z])").match(text, at)
                if found is None:
                    return text[at:].encode()
                self._obey(*found.groups())
                at = found.end()
                continue
            row, column = self._at
            assert text[at] not in "\r\n"
            if row < self.letters.shape[0] and column < self.letters.shape[1]:
                self.letters[row, column] = text[at]
                self.colours[:, row, column] = self._ink, self._paper
            self._at = row, column + 1
            at += 1
        return b""

    def _obey(self, given: str, code: str) -> None:
        if code in "hl":
            self.modes[given] = code == "h"
        elif code == "H":
            row, column = map(int, given.split(";"))
            self._at = row - 1, column - 1
        elif code == "m":
            numbers = [int(number) for number in given.split(";")]
            while numbers[0]:
                assert numbers[0] in (38, 48)
                assert numbers[1] == 2
                colour = numbers[2], numbers[3], numbers[4]
                if numbers[0] == 38:
                    self._ink = colour
                else:
                    self._paper = colour
                numbers = numbers[5:] or [0]
        elif code == "J":
            self.letters[:] = " "
        elif (given, code) == ("6", "n"):
            if self._answers:
                self.send(b"\x1b[1;1R")
        else:
            raise AssertionError(f"unknown sequence {given!r} {code!r}")
