"""Procedural patterns of walls and floors.

A wall pattern is the shadow plane of a panel (see `scene.Theme`): joints between stones, gaps
between boards. Patterns continue across the edges of tiles. A floor pattern is two words of
stripes, one for each axis.
"""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np

from . import SIZE, words_of

Coordinates = np.ndarray


def _brick(x: Coordinates, y: Coordinates) -> np.ndarray:
    """Four courses of bricks, each offset by half a brick."""
    course = y // 8
    return (y % 8 >= 6) | ((x + 8 * (course % 2)) % 16 >= 14)


def _stone(x: Coordinates, y: Coordinates) -> np.ndarray:
    """Rubble: joints where the two nearest stone centres are about equally far."""
    rng = np.random.default_rng(11)
    row, column = np.indices((4, 4))
    middles = np.stack([8 * column + 4, 8 * row + 4], axis=-1).reshape(-1, 2)
    middles = middles + rng.uniform(-3, 3, middles.shape)
    offset = np.abs(np.stack([x, y], axis=-1)[:, :, None] + 0.5 - middles)
    offset = np.minimum(offset, SIZE - offset)
    away = np.sort(np.hypot(offset[..., 0], offset[..., 1]), axis=-1)
    return away[..., 1] - away[..., 0] < 1.6


def _panel(x: Coordinates, y: Coordinates) -> np.ndarray:
    """A frame around a smaller frame."""
    rim = np.minimum(np.minimum(x, SIZE - 1 - x), np.minimum(y, SIZE - 1 - y))
    return ((rim >= 3) & (rim < 5)) | ((rim >= 9) & (rim < 10))


def _tile(x: Coordinates, y: Coordinates) -> np.ndarray:
    """Nine square tiles per tile of wall, with joints."""
    return (x % 11 >= 9) | (y % 11 >= 9)


def _wood(x: Coordinates, y: Coordinates) -> np.ndarray:
    """Four upright boards, with ends at different heights and a grain."""
    board = x // 8
    end = (y + 11 * board) % SIZE < 2
    grain = (x % 8 == 2 + board % 3) & ((y + 7 * board) % 16 < 9)
    return (x % 8 >= 7) | end | grain


_WALLS: dict[str, Callable[[Coordinates, Coordinates], np.ndarray]] = {
    "brick": _brick,
    "stone": _stone,
    "panel": _panel,
    "tile": _tile,
    "wood": _wood,
}
WALL_PATTERNS = tuple(_WALLS)
"""The names of the wall patterns."""

_HALF, _JOINT, _BOARDS = 0xFFFF0000, 0xC000C000, 0x80808080
FLOOR_PATTERNS: dict[str, tuple[int, int]] = {
    "checker": (_HALF, _HALF),
    "tiles": (_JOINT, _JOINT),
    "boards": (0, 0xC0C0C0C0),
    "small checker": (0xFF00FF00, 0xFF00FF00),
    "long tiles": (_BOARDS, 0xC0000000),
}
"""Patterns of floors: words of stripes along x and along y (see `scene.Theme.floor_words`)."""


@functools.cache
def wall_patterns() -> np.ndarray:
    """uint32[patterns, 2, 32]: planes as from `load_art`; the second plane is empty."""
    y, x = np.indices((SIZE, SIZE))
    planes = np.stack([draw(x, y) for draw in _WALLS.values()])
    words = words_of(np.stack([planes, np.zeros_like(planes)], axis=1))
    words.setflags(write=False)
    return words
