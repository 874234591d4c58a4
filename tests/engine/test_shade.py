"""Colours by depth and as grey values."""

import numpy as np

from jaxenstein.engine.pixels import CHECKER_FADES, _row_paints
from jaxenstein.engine.shade import brightness, luma, pack_rgb
from tests.reference import scenes

THEME = scenes.plain_theme()


def channels(words: np.ndarray) -> np.ndarray:
    """float64[..., 3] of packed colours."""
    return np.stack([words >> shift & 255 for shift in (0, 8, 16)], axis=-1).astype(np.float64)


def test_greys_equal_their_luma() -> None:
    greys = np.arange(256, dtype=np.uint32)
    np.testing.assert_array_equal(luma(greys * np.uint32(0x010101)), greys)


def test_luma_matches_bt_601() -> None:
    words = np.random.default_rng(0).integers(0, 1 << 24, 5000).astype(np.uint32)
    exact = channels(words) @ [0.299, 0.587, 0.114]
    # Weights in 1/256 are off by at most 1/512 each, and the result is rounded.
    assert np.abs(luma(words) - exact).max() < 1


def test_packing_rounds_each_channel() -> None:
    colour = [
        np.array([0, 10, 255], np.float32),
        np.array([1, 20, 255], np.float32),
        np.array([2, 30, 255], np.float32),
    ]
    words = pack_rgb(colour, np.array([1, 0.25, 1], np.float32))
    np.testing.assert_array_equal(channels(words), [[0, 1, 2], [3, 5, 8], [255, 255, 255]])


def test_the_checker_fades_from_3_to_14_tiles() -> None:
    distance = np.array([0.5, 2.9, 3, 5, 8.5, 11, 14, 20, 100], np.float32)[:, None]
    rows = _row_paints(
        np.asarray(THEME.floor), np.asarray(THEME.ceiling), None,
        light=THEME.light, fades=CHECKER_FADES, distance=distance, kind="rgb",
    )  # fmt: skip
    ceiling, even, odd = (
        channels(np.asarray(paint))[:, 0] for paint in (rows.ceiling, rows.first, rows.second)
    )
    tiles = np.asarray(THEME.floor, np.float64)
    contrast = np.interp(distance, [3, 14], [1, 0])
    light = np.asarray(brightness(distance), np.float64)
    for found, tile in ((even, tiles[0]), (odd, tiles[1])):
        wanted = (tiles.mean(axis=0) + (tile - tiles.mean(axis=0)) * contrast) * light
        assert np.abs(found - wanted).max() < 0.51
    assert np.abs(ceiling - np.asarray(THEME.ceiling) * light).max() < 0.51
    assert (even[0] != odd[0]).any()
    np.testing.assert_array_equal(even[-3:], odd[-3:])
