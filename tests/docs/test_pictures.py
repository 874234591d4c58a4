"""The pictures of the site show what the engine does, and are written whole."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from docs import engine_world, episodes
from docs.engine_world import View
from jaxenstein.engine.art import load_art
from jaxenstein.files import OutputError

ENGINE = Path(__file__).parents[2] / "docs" / "images" / "engine"


def test_crossings_by_geometry_find_the_walls_that_the_engine_finds() -> None:
    view = View(width=12, height=8)
    for column in range(12):
        first = [next(place for place, solid in line if solid) for line in view.crossings(column)]
        nearest = min(first, key=lambda place: place[2])
        assert nearest[2] == pytest.approx(view.hits.depth[column], abs=1e-4)
        assert view.hits.horizontal[column] == (first[1][2] < first[0][2])
        np.testing.assert_allclose(view.ends()[column], nearest[:2], atol=1e-4)


def test_the_word_of_the_fifth_column_is_that_of_the_map() -> None:
    column = "".join(line[5] for line in engine_world.WORLD.split())
    for closed in (False, True):
        word = int(engine_world.bits(closed=closed)[5])
        solid = [mark in "#2" or (mark == "R" and closed) for mark in column]
        assert [bool(word >> row & 1) for row in range(len(column))] == solid


def test_the_column_of_the_key_is_the_one_that_the_image_shows() -> None:
    view = View(width=96, height=72, near=True)
    image, bare = view.image("labels"), view.image("labels", things=False)
    shape, _ = load_art("key")
    shown = (image != bare).any(axis=0)
    texels = [view.texel(column) for column in range(96)]
    expected = [0 <= texel < 32 and bool(shape[texel]) for texel in texels]
    # A column at an edge may be rounded either way.
    assert (shown != expected).sum() <= 2
    assert shown.sum() > 20


def test_pictures_of_the_engine_exist_for_light_and_dark_pages() -> None:
    names = {path.stem for path in ENGINE.glob("*.png")}
    kinds = {name.rpartition("-")[0] for name in names}
    assert kinds == {"rays", "lines", "words", "sprites", "layers"}
    assert names == {f"{kind}-{page}" for kind in kinds for page in ("light", "dark")}


def test_an_animation_is_written_whole_or_not_at_all(tmp_path) -> None:
    pictures = [np.full((8, 12, 3), 40 * i, np.uint8) for i in range(5)]
    episodes.save_webp(pictures, tmp_path / "five.webp")
    with Image.open(tmp_path / "five.webp") as animation:
        assert getattr(animation, "n_frames", 1) == 5
        assert animation.size == (12, 8)
    with pytest.raises(OutputError, match="no folder"):
        episodes.save_webp(pictures, tmp_path / "none" / "five.webp")
    assert [path.name for path in tmp_path.iterdir()] == ["five.webp"]
