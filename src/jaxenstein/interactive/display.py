"""The interface of windows and terminals that show a game."""

from __future__ import annotations

import abc
from collections.abc import Sequence
from typing import ClassVar, Literal, NamedTuple, Self

import numpy as np

from ..errors import SettingError

# A picture beside the view gets at most this share of the width.
BESIDE_SHARE = 0.5
# Seconds after which a wait checks for signals, such as Ctrl-C, and for a new size.
LONGEST_WAIT = 0.25


class DisplayError(SettingError):
    """There is no display; the message says what is missing."""


class Event(NamedTuple):
    """An event of a display.

    Attributes:
        kind: `"press"` and `"release"` of a key; `"close"`: the display should be closed;
            `"redraw"`: its size or visible part has changed.
        key: the key's name in lower case, such as `"w"`, `"up"`, `"space"`, `"escape"`.
    """

    kind: Literal["press", "release", "close", "redraw"]
    key: str = ""


class Rectangle(NamedTuple):
    """A rectangle in pixels."""

    left: int
    top: int
    width: int
    height: int


class Display(abc.ABC):
    """Shows a picture, a second one beside it, and text; leaving its context closes it.

    Attributes:
        finer: how many times larger than its room to draw a map, which is then shrunk smoothly.
        gap: pixels between the two pictures.
        view: where the last frame was drawn, in pixels; None if nowhere.
        beside: where the picture beside it was drawn; None if nowhere.
    """

    finer: ClassVar[int]
    gap: ClassVar[int]
    view: Rectangle | None = None
    beside: Rectangle | None = None

    def __enter__(self) -> Self:
        """The display."""
        return self

    def __exit__(self, *error: object) -> None:
        """Close the display."""
        self.close()

    @abc.abstractmethod
    def close(self) -> None:
        """Close the display; closing it again does nothing."""

    @abc.abstractmethod
    def show(
        self,
        frame: np.ndarray | None,
        lines: Sequence[str] = (),
        *,
        beside: np.ndarray | None = None,
        overlay: Sequence[str] = (),
    ) -> None:
        """Redraw everything.

        Args:
            frame: uint8[H, W, 3], enlarged by a whole factor; None for none.
            lines: text below.
            beside: uint8[h, w, 3], a picture to the right of the frame.
            overlay: text in a box on top of everything.
        """

    @abc.abstractmethod
    def area(self, lines: int) -> Rectangle:
        """The room for pictures above a number of lines of text, in pixels."""

    def beside_area(self, lines: int) -> Rectangle:
        """The room for a picture beside the frame, above a number of lines of text."""
        area = self.area(lines)
        width = max(1, int(BESIDE_SHARE * (area.width - self.gap)))
        return area._replace(left=area.left + area.width - width, width=width)

    def arranged(
        self, frame: np.ndarray | None, beside: np.ndarray | None, lines: int
    ) -> list[tuple[np.ndarray, Rectangle]]:
        """The pictures and where they go; sets `view` and `beside`."""
        area, side = self.area(lines), self.beside_area(lines)
        self.view, self.beside = arrange(area, side, frame, beside, self.gap)
        placed = ((frame, self.view), (beside, self.beside))
        return [(picture, box) for picture, box in placed if picture is not None and box]

    def make_room(self, beside: bool) -> None:
        """Grow for a picture beside the frame, or shrink back, if possible."""
        del beside

    @abc.abstractmethod
    def events(self, timeout: float = 0.0) -> list[Event]:
        """The events since the last call; call it often.

        Args:
            timeout: the longest time to wait for an event, in seconds; it may be shorter.
        """


def fit(area: Rectangle, height: int, width: int) -> Rectangle:
    """Centre a picture in an area, at the largest whole multiple of its size that fits.

    The picture is only shrunk, keeping its shape, if it does not fit as it is.

    Args:
        area: the area.
        height: the height of the picture.
        width: the width of the picture.
    """
    room = min(area.width / width, area.height / height)
    scale = float(int(room)) if room >= 1 else room
    wide, high = max(1, round(width * scale)), max(1, round(height * scale))
    left = area.left + (area.width - wide) // 2
    return Rectangle(left, area.top + (area.height - high) // 2, wide, high)


def arrange(
    area: Rectangle, side: Rectangle, frame: np.ndarray | None, beside: np.ndarray | None, gap: int
) -> tuple[Rectangle | None, Rectangle | None]:
    """Place a frame and a picture beside it.

    Args:
        area: the whole area for pictures.
        side: the part of it, at its right edge, that the second picture may use.
        frame: uint8[H, W, 3] or None.
        beside: uint8[h, w, 3] or None.
        gap: pixels between the two.
    """
    second = None
    if beside is not None:
        box = fit(side, *beside.shape[:2])
        # At the right edge, so that the frame can use the room that the picture does not need.
        second = box._replace(left=side.left + side.width - box.width)
        area = area._replace(width=max(1, second.left - gap - area.left))
    return None if frame is None else fit(area, *frame.shape[:2]), second
