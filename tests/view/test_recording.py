"""Animations and contact sheets, read back."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from jaxenstein.files import OutputError
from jaxenstein.view import recording
from jaxenstein.view.episode import Episode, caption, compose_side_by_side
from jaxenstein.view.recording import enlarge, evenly, mosaic, save_gif, save_png, scale_to


def frames(count: int, side: int = 16) -> list[np.ndarray]:
    """A white square that walks over stripes of a few colours."""
    images = []
    for i in range(count):
        image = np.zeros((side, side, 3), np.uint8)
        image[::2, :, 0] = 200
        image[1::2, :, 2] = 90
        image[4:8, i : i + 4] = 255
        images.append(image)
    return images


def test_gif_holds_every_frame_exactly(tmp_path: Path) -> None:
    shots = frames(6)
    path = tmp_path / "a.gif"
    save_gif(shots, path, fps=20)
    with Image.open(path) as gif:
        assert getattr(gif, "n_frames", 1) == 6
        assert gif.size == (16, 16)
        assert gif.info["duration"] == 50
        assert gif.info["loop"] == 0
        for i, shot in enumerate(shots):
            gif.seek(i)
            # Few colours, so the palette holds them all, and dithering would change pixels.
            np.testing.assert_array_equal(np.asarray(gif.convert("RGB")), shot)


def test_gif_of_many_colours_stays_close(tmp_path: Path) -> None:
    ramp = np.linspace(40, 220, 64).astype(np.uint8)
    smooth = np.stack(np.broadcast_arrays(ramp[:, None], ramp[None, :] // 2, np.uint8(60)), axis=-1)
    save_gif([smooth, smooth[::-1].copy()], tmp_path / "a.gif")
    with Image.open(tmp_path / "a.gif") as gif:
        error = np.abs(np.asarray(gif.convert("RGB")).astype(int) - smooth)
    assert error.mean() < 5
    assert error.max() < 32


def test_failed_gif_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def no_space(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", no_space)
    with pytest.raises(OutputError, match="no space left"):
        save_gif(frames(2), tmp_path / "a.gif")
    with pytest.raises(OutputError, match="no space left"):
        save_png(mosaic(np.stack(frames(2)), 2), tmp_path / "a.png")
    assert list(tmp_path.iterdir()) == []


def test_mosaic_places_images_row_by_row() -> None:
    shots = np.stack([np.full((2, 3, 3), 10 * i, np.uint8) for i in range(1, 6)])
    sheet = mosaic(shots, 3, scale=2, gap=1)
    assert sheet.shape == (2 * 5 + 1, 3 * 7 + 1, 3)
    for i in range(5):
        top, left = 1 + (i // 3) * 5, 1 + (i % 3) * 7
        assert (sheet[top : top + 4, left : left + 6] == 10 * (i + 1)).all()
    assert (sheet[0] == recording.BACKGROUND).all()
    assert (sheet[6:, 15:] == recording.BACKGROUND).all()


def test_a_mosaic_is_kept_as_png(tmp_path: Path) -> None:
    shots = np.stack(frames(4))
    save_png(mosaic(shots, 2, scale=3), tmp_path / "sheet.png")
    with Image.open(tmp_path / "sheet.png") as png:
        assert png.format == "PNG"
        np.testing.assert_array_equal(np.asarray(png), mosaic(shots, 2, scale=3))


def test_enlarge_keeps_pixels_square() -> None:
    image = np.arange(12, dtype=np.uint8).reshape(2, 2, 3)
    large = enlarge(image, 3)
    assert large.shape == (6, 6, 3)
    assert (large[3:, :3] == image[1, 0]).all()
    assert [scale_to((height, 64), 256) for height in (64, 100, 240, 1000)] == [4, 3, 2, 1]
    # 1024 pixels wide at most, or as they are.
    assert [scale_to((8, width), 256) for width in (16, 32, 300, 2000)] == [32, 32, 3, 1]


def test_side_by_side_holds_view_map_and_text() -> None:
    view = np.full((10, 10, 3), 77, np.uint8)
    overview = Image.new("RGB", (200, 60), (1, 2, 3))
    plain = compose_side_by_side(view, overview, ["", "", ""], scale=5)
    text = compose_side_by_side(view, overview, ["step 1", "return 0", "goal"], scale=5)
    assert plain.shape == text.shape
    assert (plain == 77).all(axis=-1).sum() == 50 * 50
    assert (plain == (1, 2, 3)).all(axis=-1).sum() == 200 * 60
    changed = np.argwhere((plain != text).any(axis=-1))
    assert len(changed) > 0
    assert changed[:, 0].min() >= 60


def episode(rewards: list[float], events: tuple[str, ...], **rest: Any) -> Episode:
    """An episode of which only the caption matters."""
    count = len(rewards) + 1
    return Episode(
        frames=np.zeros((count, 2, 2, 3), np.uint8),
        positions=np.zeros((count, 2), np.float32),
        headings=np.zeros(count, np.float32),
        rewards=np.array(rewards, np.float32),
        closed=np.zeros((count, 0), bool),
        sprites=np.zeros((count, 0, 2), np.float32),
        labels=np.zeros((count, 0), np.int32),
        visible=np.zeros((count, 0), bool),
        events=events,
        **rest,
    )


def test_caption_tells_step_return_and_the_latest_event() -> None:
    played = episode([0, 0.5, 1], ("", "picked up a key", "reached the goal"))
    assert caption(played, 0) == ["step 0", "return 0", ""]
    assert caption(played, 2) == ["step 2", "return +0.5", "picked up a key"]
    assert caption(played, 3) == ["step 3", "return +1.5", "reached the goal"]
    assert caption(played, 3, recent=0) == ["step 3", "return +1.5", ""]


def test_caption_shows_variables_and_whole_returns() -> None:
    health = {"health": np.array([92.0, 92.0, 84.0])}
    played = episode([1, -99], ("", "died"), variables=health)
    assert caption(played, 1) == ["step 1", "return 1", "health 92", ""]
    assert caption(played, 2) == ["step 2", "return -98", "health 84", "died"]
    long = episode([1] * 20_000, ("",) * 20_000)
    assert caption(long, 20_000) == ["step 20000", "return 20000", ""]


def test_evenly_includes_both_ends() -> None:
    assert evenly(100, 4) == [0, 33, 66, 99]
    assert evenly(3, 8) == [0, 1, 2]
    assert evenly(1, 8) == [0]
