"""A progress line for long work."""

from __future__ import annotations

import contextlib
import sys
import time
from typing import Self, TextIO

from .errors import one_line

WIDTH = 24
# Seconds between updates: a terminal redraws the line, other streams print a new one.
LIVE_INTERVAL = 0.1
SPARSE_INTERVAL = 10.0


class Progress:
    """Shows the fraction done, the rate and the time left on standard error.

    Use it as a context manager, and call `update` with the amount done so far. On a terminal one
    line is redrawn in place; in a log file a new line appears every ten seconds and at the end.

    Attributes:
        done: the amount done so far.
        note: text shown after the rate; may change at any time.
    """

    def __init__(
        self,
        total: int,
        label: str,
        *,
        unit: str = "steps",
        compiles: bool = False,
        stream: TextIO | None = None,
    ) -> None:
        """Start the clock.

        Args:
            total: the amount of work, in `unit`.
            label: the name of the work, shown before the bar.
            unit: the unit of `total`.
            compiles: whether the work starts by compiling. The line then says so until the first
                update, and the rate leaves the compile time out.
            stream: the output stream; default standard error.
        """
        self.total = max(total, 1)
        self.label = one_line(label)
        self.unit = unit
        self.stream = sys.stderr if stream is None else stream
        self.live = self.stream.isatty()
        self.done: float = 0
        self.note = ""
        self._compiling = compiles
        self._done_before: float = 0
        self._start = self._shown = time.monotonic()
        self._complete = False

    def __enter__(self) -> Self:
        """Show the empty bar."""
        if self.live or self._compiling:
            self.show()
        return self

    def __exit__(self, *error: object) -> None:
        """Show the final state and end the line."""
        if self.live or not self._complete:
            self.show()
        if self.live:
            self._write("\n")

    def restart(self, done: float) -> None:
        """Measure the rate from here on; `done` was done earlier, or is not typical of the rest."""
        self.done = self._done_before = done
        self._start = time.monotonic()

    def update(self, done: float) -> None:
        """Set the amount done; redraws only as often as is useful."""
        if self._compiling:
            self._compiling = False
            self.restart(done)
        self.done = done
        interval = LIVE_INTERVAL if self.live else SPARSE_INTERVAL
        if time.monotonic() - self._shown >= interval:
            self.show()

    def say(self, text: str) -> None:
        """Print a separate line above the progress line."""
        self._write(f"\r\x1b[K{text}\n" if self.live else f"{text}\n")
        self.show()

    def line(self) -> str:
        """The current progress line."""
        elapsed = max(time.monotonic() - self._start, 1e-9)
        fraction = min(self.done / self.total, 1.0)
        filled = round(fraction * WIDTH)
        rate = (self.done - self._done_before) / elapsed
        if self.done >= self.total:
            when = f"in {_duration(elapsed)}"
        elif rate:
            when = f"{_duration((self.total - self.done) / rate)} left"
        else:
            when = ""
        bar = "#" * filled + "-" * (WIDTH - filled)
        # Below one per second, the time left is more informative.
        speed = f"{si(rate)} {self.unit}/s" if rate >= 1 else ""
        head = f"{self.label} [{bar}] {fraction:4.0%}"
        note = "compiling" if self._compiling else self.note
        return "  ".join(filter(None, [head, speed, note, when]))

    def show(self) -> None:
        """Show the current state now."""
        self._shown = time.monotonic()
        self._complete = self.done >= self.total
        text = self.line()
        self._write(f"\r{text}\x1b[K" if self.live else f"{text}\n")

    def _write(self, text: str) -> None:
        # A closed terminal must not end the work.
        with contextlib.suppress(OSError):
            self.stream.write(text)
            self.stream.flush()


def si(number: float) -> str:
    """A number with three significant digits and k, M or G: 217000 -> '217k'."""
    number = float(f"{number:.3g}")
    for size, suffix in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if abs(number) >= size:
            whole_digits = len(str(int(abs(number) / size)))
            return f"{number / size:.{max(0, 3 - whole_digits)}f}{suffix}"
    return f"{number:.3g}"


def _duration(seconds: float) -> str:
    if seconds < 10:
        return f"{seconds:.1f} s"
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    minutes, rest = divmod(whole, 60)
    if minutes < 60:
        return f"{minutes}:{rest:02} min"
    return f"{minutes // 60}:{minutes % 60:02} h"
