"""What a game is shown on: a window or a terminal, with the same few functions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple, Protocol

import numpy as np

from ..errors import SettingError


class DisplayError(SettingError):
    """There is nothing to show pictures on; the message says what is missing."""


class Event(NamedTuple):
    """Something that happened to a display.

    Attributes:
        kind: `"press"` and `"release"` of a key; `"close"`: the display should be closed;
            `"redraw"`: its size or what was visible of it has changed.
        key: the key's name in lower case, such as `"w"`, `"up"`, `"space"`, `"escape"`.
    """

    kind: Literal["press", "release", "close", "redraw"]
    key: str = ""


class Box(NamedTuple):
    """A rectangle in pixels."""

    left: int
    top: int
    width: int
    height: int


class Display(Protocol):
    """A place for a picture, a second one beside it, and text.

    Attributes:
        finer: how many times larger than its room a map should be drawn, to be shrunk smoothly.
    """

    finer: int

    def show(
        self,
        frame: np.ndarray | None,
        lines: Sequence[str] = (),
        *,
        beside: np.ndarray | None = None,
        overlay: Sequence[str] = (),
    ) -> None:
        """Draw everything anew.

        Args:
            frame: uint8[H, W, 3], enlarged by a whole factor; None for none.
            lines: text below.
            beside: uint8[h, w, 3], a picture to the right of the frame.
            overlay: text in a box on top of everything.
        """
        ...

    def beside_area(self, lines: int) -> Box:
        """The room for a picture beside the frame, above so many lines of text."""
        ...

    def make_room(self, beside: bool) -> None:
        """Grow for a picture beside the frame, or shrink back, if that is possible."""
        ...

    def events(self, timeout: float = 0.0) -> list[Event]:
        """What happened since the last call; to be called often.

        Args:
            timeout: seconds to wait for something to happen, asleep; it may be less.
        """
        ...


def fit(area: Box, height: int, width: int) -> Box:
    """Where a picture goes: in the middle, at the largest whole multiple of its size that fits.

    It is shrunk, keeping its shape, only where it does not fit as it is.

    Args:
        area: where there is room.
        height: of the picture.
        width: of the picture.
    """
    room = min(area.width / width, area.height / height)
    scale = float(int(room)) if room >= 1 else room
    wide, high = max(1, round(width * scale)), max(1, round(height * scale))
    left = area.left + (area.width - wide) // 2
    return Box(left, area.top + (area.height - high) // 2, wide, high)


def arrange(
    area: Box, side: Box, frame: np.ndarray | None, beside: np.ndarray | None, gap: int
) -> tuple[Box | None, Box | None]:
    """Where a frame and a picture beside it go.

    Args:
        area: all the room for pictures.
        side: the part of it, at its right edge, that the second picture may take.
        frame: uint8[H, W, 3] or None.
        beside: uint8[h, w, 3] or None.
        gap: pixels between the two.
    """
    second = None
    if beside is not None:
        box = fit(side, *beside.shape[:2])
        # At the right edge, so that the frame gets what the picture does not need.
        second = box._replace(left=side.left + side.width - box.width)
        area = area._replace(width=max(1, second.left - gap - area.left))
    return None if frame is None else fit(area, *frame.shape[:2]), second
