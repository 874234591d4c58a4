"""Observations as pictures that a notebook shows."""

from __future__ import annotations

import io
import os
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from PIL import Image

from jaxenstein import SettingError
from jaxenstein.maps.symbols import LABEL_COLOURS
from jaxenstein.view.frames import Frame, show
from jaxenstein.view.recording import mosaic

RNG = np.random.default_rng(0)
RGB = RNG.integers(0, 256, (12, 16, 3)).astype(np.uint8)


def shown(frame: Frame) -> np.ndarray:
    """The picture that a notebook gets."""
    with Image.open(io.BytesIO(frame._repr_png_())) as png:
        assert png.format == "PNG"
        return np.asarray(png)


@pytest.mark.parametrize(
    "given", [RGB, jnp.asarray(RGB), {"image": RGB, "carried_keys": np.zeros(6)}]
)
def test_png_shows_the_frame_in_sharp_pixels(given: Any) -> None:
    frame = show(given)
    assert frame.scale == 22
    np.testing.assert_array_equal(shown(frame), np.kron(RGB, np.ones((22, 22, 1), np.uint8)))
    np.testing.assert_array_equal(shown(show(given, scale=1)), RGB)
    assert repr(frame) == "<Frame of 16x12 pixels>"


def test_large_frames_are_not_enlarged() -> None:
    assert show(np.zeros((300, 400, 3), np.uint8)).scale == 1


def test_other_observation_kinds() -> None:
    gray = RGB[..., 0]
    np.testing.assert_array_equal(show(gray).image, np.stack([gray] * 3, axis=-1))
    labels = (gray % len(LABEL_COLOURS)).astype(np.uint8)
    colours = np.asarray(LABEL_COLOURS)[labels]
    np.testing.assert_array_equal(show(labels, "labels").image, colours)
    depth = np.array([[0.1, 1.3, 50.0, np.inf]], np.float32)
    image = show(depth).image[0, :, 0].tolist()
    assert image == sorted(image, reverse=True)
    assert (image[1], image[3]) == (128, 0)


def test_batch_is_laid_out() -> None:
    batch = np.stack([RGB, 255 - RGB, RGB // 2])
    frame = show(batch, scale=2)
    np.testing.assert_array_equal(shown(frame), mosaic(batch, 2, scale=2))
    # Any number of leading axes, of which 64 images are shown.
    many = np.broadcast_to(RGB, (30, 10, *RGB.shape))
    assert show(many, scale=1).image.shape == mosaic(np.stack([RGB] * 64), 8, scale=1).shape
    gray = np.zeros((5, 12, 16), np.uint8)
    assert show(gray, scale=1).image.shape == mosaic(np.stack([RGB] * 5), 3, scale=1).shape


@pytest.mark.parametrize(
    ("observation", "kind", "words"),
    [
        (np.zeros(3, np.uint8), None, r"gray observation is uint8\[..., height, width\], not"),
        (np.zeros((0, 4, 3), np.uint8), None, r"not uint8\[0, 4, 3\]"),
        (np.zeros((4, 4, 3), np.int32), None, "not int32"),
        (np.zeros((4, 4), np.float64), None, "not float64"),
        (np.zeros((4, 4), np.uint8), "rgb", r"rgb observation is uint8\[..., height, width, 3\]"),
        (np.zeros((4, 4), np.uint8), "smell", "kind must be one of"),
        (np.full((4, 4), 255, np.uint8), "labels", "label 255"),
        ("text", None, "observation is"),
    ],
)
def test_invalid_observations_are_refused(observation: Any, kind: str | None, words: str) -> None:
    with pytest.raises(SettingError, match=words):
        show(observation, kind)


def test_saving(tmp_path: Path) -> None:
    show(RGB, scale=3).save(tmp_path / "a.png")
    with Image.open(tmp_path / "a.png") as png:
        np.testing.assert_array_equal(np.asarray(png), np.kron(RGB, np.ones((3, 3, 1), np.uint8)))
    with pytest.raises(SettingError, match=r"\.png"):
        show(RGB).save(tmp_path / "a.gif")
    with pytest.raises(SettingError, match="scale must be"):
        show(RGB, scale=0)
    assert os.listdir(tmp_path) == ["a.png"]
