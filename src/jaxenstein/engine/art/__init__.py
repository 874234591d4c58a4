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
    weights = np.left_shift(np.uint32(1), np.arange(SIZE, dtype=np.uint32)[::-1])[:, None]
    planes = np.stack([cells != ".", cells == "o"])
    words = np.where(planes, weights, np.uint32(0)).sum(axis=1, dtype=np.uint32)
    words.setflags(write=False)
    return words
