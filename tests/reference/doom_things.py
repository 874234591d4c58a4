"""Things and weapons in the game's frame, column by column. Numbers are 16.16."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from jaxenstein.tasks.doom.wad import WadPicture

from .doom import ONE, times

Blend = Literal["cover", "add", "mean"]


@dataclass(frozen=True)
class Thing:
    """A billboard: its picture, the position of its feet, and how it blends."""

    picture: WadPicture
    x: int
    y: int
    z: int
    bright: bool = False
    blend: Blend = "cover"


@dataclass(frozen=True)
class Weapon:
    """A picture in the player's hands, at a position on a screen of 320 by 200."""

    picture: WadPicture
    x: int = 0
    y: int = 32 * ONE + ONE * 3 // 8
    bright: bool = False


@dataclass(frozen=True)
class Stamp:
    """A picture on the screen.

    Attributes:
        picture: the picture.
        x1: its first column, which can be left of the screen.
        x2: the column after its last one.
        along: picture columns per screen column.
        middle: picture rows from its upper edge to the middle of the screen.
        scale: screen rows per picture row.
        shade: the row of the light table.
        blend: how it blends with what is behind it.
    """

    picture: WadPicture
    x1: int
    x2: int
    along: int
    middle: int
    scale: int
    shade: int
    blend: Blend = "cover"


def paint(
    frame: np.ndarray, stamp: Stamp, hidden: np.ndarray, colormap: np.ndarray, palette: np.ndarray
) -> None:
    """Draw a picture into a frame of indices, except for hidden columns."""
    light = colormap[stamp.shade]
    for x in range(max(stamp.x1, 0), min(stamp.x2, frame.shape[1])):
        if hidden[x]:
            continue
        column = stamp.picture.pixels[:, (x - stamp.x1) * stamp.along >> 16]
        for y1, texels in runs(column, stamp, len(frame)):
            place = slice(y1, y1 + len(texels)), x
            colours = light[texels]
            if stamp.blend != "cover":
                both = palette[colours].astype(int) + palette[frame[place]]
                mixed = np.minimum(both >> (3 if stamp.blend == "add" else 4), 31)
                colours = [nearest(palette.tobytes(), *colour) for colour in mixed.tolist()]
            frame[place] = colours


def runs(column: np.ndarray, stamp: Stamp, height: int) -> Iterator[tuple[int, np.ndarray]]:
    """Each opaque run of a column: its first row on the screen, and its texels."""
    centre, step = height // 2, (2**32 - 1) // stamp.scale
    top = centre * ONE - times(stamp.middle, stamp.scale)
    solid = np.flatnonzero(column >= 0)
    for run in np.split(solid, np.flatnonzero(np.diff(solid) > 1) + 1) if solid.size else ():
        first, length = int(run[0]), len(run)
        y1 = max((top + stamp.scale * first) >> 16, 0)
        y2 = min((top + stamp.scale * (first + length) - ONE) >> 16, height - 1)
        place = stamp.middle - first * ONE + y1 * step - times((centre - 1) * ONE, step)
        while place < 0 and y1 <= y2:
            y1, place = y1 + 1, place + step
        if y1 > y2:
            continue
        # Add a row if the run ends early, and drop rows beyond the end of the run.
        end, limit = place + (y2 - y1) * step, length * ONE
        if y2 < height - 1 and end < limit - step:
            y2 += 1
        while end >= limit and y1 <= y2:
            y2, end = y2 - 1, end - step
        if y1 <= y2:
            yield y1, column[first + ((place + step * np.arange(y2 - y1 + 1)) >> 16)]


@functools.cache
def nearest(palette: bytes, red: int, green: int, blue: int) -> int:
    """The palette index nearest to a colour with five bits per channel."""
    wanted = [(channel << 3) | (channel >> 2) for channel in (red, green, blue)]
    known = np.frombuffer(palette, np.uint8).reshape(256, 3).astype(int)
    # Index 0 means a hole.
    return 1 + int(((known[1:] - wanted) ** 2).sum(axis=1).argmin())
