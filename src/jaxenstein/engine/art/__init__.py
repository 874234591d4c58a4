"""Pictures of sprites and panels, 32 by 32 characters each, as bit planes.

`.` is empty, `#` has the first colour and `o` the second: shape and detail of a sprite, shadow and
accent of a panel.
"""

from __future__ import annotations

import functools
from importlib import resources

import numpy as np

SIZE = 32
MARKS = ".#o"
# The bit of each row in the word of a column.
_PLACES = np.arange(SIZE, dtype=np.uint32)[::-1, None]


@functools.cache
def load_art(name: str) -> np.ndarray:
    """uint32[2, 32]: bit planes (any colour, second colour) by column; the top is the highest bit.

    Args:
        name: a file beside this module, without its suffix, or the picture itself as 32 lines.
    """
    text = name
    if "\n" not in name:
        text = resources.files(__name__).joinpath(f"{name}.txt").read_text(encoding="ascii")
    cells = np.array([list(line) for line in text.split()])
    if cells.shape != (SIZE, SIZE) or not np.isin(cells, list(MARKS)).all():
        raise ValueError(f"art {name!r} must be {SIZE} by {SIZE} characters of '.', '#' and 'o'")
    words = words_of(np.stack([cells != ".", cells == "o"]))
    words.setflags(write=False)
    return words


def words_of(planes: np.ndarray) -> np.ndarray:
    """uint32[..., 32]: bit planes bool[..., 32, 32] by column; the top is the highest bit."""
    return (planes.astype(np.uint32) << _PLACES).sum(axis=-2, dtype=np.uint32)


def planes_of(words: np.ndarray) -> np.ndarray:
    """bool[..., 32, 32] from uint32[..., 32], the inverse of `words_of`."""
    return (words[..., None, :] >> _PLACES & np.uint32(1)).astype(bool)
