"""The contact sheet of all environments chooses and places its views."""

from __future__ import annotations

import numpy as np
from PIL import Image

from docs import gallery
from jaxenstein.maps.symbols import DEFAULT_WALL, FLOOR
from jaxenstein.maps.things import GOAL, MEDKIT


def test_views_show_all_things_and_come_from_different_episodes() -> None:
    images = np.full((8, 5, 10, 10), DEFAULT_WALL, np.uint8)
    images[:, :, 7:] = FLOOR
    images[3, 4, 5:7, 5:7] = images[3, 2, 5:7, 5:7] = GOAL.label
    images[6, 1, 5:7, 5:7] = MEDKIT.label
    # A wall right before the eyes is worth least.
    images[0] = DEFAULT_WALL
    chosen = gallery.choose(images, 7)
    assert {chosen[0], chosen[1]} <= {(3, 4), (3, 2), (6, 1)}
    assert sorted(episode for episode, _ in chosen) == [1, 2, 3, 4, 5, 6, 7]


def test_blocks_are_side_by_side() -> None:
    width, height = gallery.block_size()
    blocks = [Image.new("RGB", (width, height), (i, 1, 2)) for i in range(3)]
    sheet = np.asarray(gallery.arrange(blocks))
    margin = gallery.MARGIN
    for i, (row, column) in enumerate([(0, 0), (0, 1), (1, 0)]):
        top, left = margin + row * (height + margin), margin + column * (width + margin)
        assert (sheet[top : top + height, left : left + width] == (i, 1, 2)).all()
    assert sheet.shape == (2 * (height + margin) + margin, 2 * (width + margin) + margin, 3)
