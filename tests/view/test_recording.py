"""Animations and contact sheets, read back; MP4 files, decoded again."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from jaxenstein import SettingError
from jaxenstein.files import OutputError
from jaxenstein.view import recording
from jaxenstein.view.episode import Episode, caption, compose_side_by_side
from jaxenstein.view.recording import (
    check_animation,
    enlarge,
    evenly,
    mosaic,
    save_animation,
    save_gif,
    save_png,
    scale_to,
)


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


def test_mosaic_is_saved_as_png(tmp_path: Path) -> None:
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


def test_caption_shows_step_return_and_latest_event() -> None:
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


def moving_squares(count: int, height: int = 97, width: int = 131) -> list[np.ndarray]:
    """A red and a blue square that walk over grey, past one of every corner of the colours."""
    images = []
    for i in range(count):
        image = np.full((height, width, 3), 96, np.uint8)
        for n in range(8):
            image[64:80, 16 * n : 16 * n + 16] = [255 * (n >> bit & 1) for bit in range(3)]
        image[8:40, 2 * i : 2 * i + 32] = (220, 30, 40)
        image[24:56, 60 - 2 * i : 92 - 2 * i] = (30, 60, 200)
        images.append(image)
    return images


def decode(path: Path, width: int, height: int) -> tuple[str, np.ndarray]:
    """ffmpeg's description of the stream in a file, and its frames."""
    program = pytest.importorskip("imageio_ffmpeg").get_ffmpeg_exe()
    raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    done = subprocess.run([program, "-i", str(path), *raw], capture_output=True, check=True)
    lines = done.stderr.decode().splitlines()
    about = next(line for line in lines if "Video: " in line)
    return about, np.frombuffer(done.stdout, np.uint8).reshape(-1, height, width, 3)


def test_video_holds_every_frame_in_its_colours(tmp_path: Path) -> None:
    pytest.importorskip("imageio_ffmpeg")
    shots = np.stack(moving_squares(20))
    save_animation(shots, tmp_path / "a.mp4", fps=12.5)
    about, back = decode(tmp_path / "a.mp4", 132, 98)
    for fact in ("Video: h264", "yuv420p(tv, bt709", " 132x98", " 12.50 fps"):
        assert fact in about
    assert back.shape == (20, 98, 132, 3)
    # Inside of the squares colours are exact to a few levels; at edges two pixels share one.
    error = np.abs(back[:, :97, :131].astype(int) - shots)
    assert error.mean() < 3
    for n in range(8):
        assert error[:, 68:76, 16 * n + 4 : min(16 * n + 12, 128)].max() < 8
    # The row and the column that make the size even repeat the last ones.
    assert np.abs(back[:, 97].astype(int) - back[:, 96]).mean() < 3
    assert list(tmp_path.iterdir()) == [tmp_path / "a.mp4"]
    plain = tmp_path / "plain"
    plain.write_text("")
    assert (tmp_path / "a.mp4").stat().st_mode == plain.stat().st_mode


def test_one_small_frame_is_a_video(tmp_path: Path) -> None:
    pytest.importorskip("imageio_ffmpeg")
    save_animation([np.zeros((1, 1, 3), np.uint8)], tmp_path / "a.mp4", fps=1)
    _, back = decode(tmp_path / "a.mp4", 2, 2)
    assert back.shape == (1, 2, 2, 3)


def test_missing_extra_is_reported_before_playing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(SettingError, match=r"pip install 'jaxenstein\[video\]'"):
        check_animation(tmp_path / "a.mp4")
    check_animation(tmp_path / "a.gif")


def test_missing_ffmpeg_is_reported(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    package = pytest.importorskip("imageio_ffmpeg")

    def nothing() -> str:
        raise RuntimeError("no ffmpeg exe could be found")

    monkeypatch.setattr(package, "get_ffmpeg_exe", nothing)
    with pytest.raises(SettingError, match="IMAGEIO_FFMPEG_EXE"):
        check_animation(tmp_path / "a.mp4")


@pytest.mark.parametrize(
    ("program", "reason"),
    [
        ("print('Error writing: No space left on device', file=sys.stderr); sys.exit(1)", "no sp"),
        (
            "sys.stdin.buffer.read(); print('Bad\\nodd size\\n', file=sys.stderr); sys.exit(3)",
            "odd",
        ),
        ("sys.stdin.buffer.read(); sys.exit(1)", "no message"),
        ("os.close(0); sys.exit(0)", "ffmpeg failed"),
    ],
)
def test_failing_ffmpeg_leaves_nothing(
    program: str, reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    script = tmp_path / "ffmpeg"
    script.write_text(f"#!{sys.executable}\nimport os, sys\n{program}\n")
    script.chmod(0o755)
    monkeypatch.setattr(recording, "find_ffmpeg", lambda: str(script))
    folder = tmp_path / "out"
    folder.mkdir()
    big = [np.zeros((400, 400, 3), np.uint8)] * 40
    with pytest.raises(OutputError, match=reason):
        recording.save_mp4(big, folder / "a.mp4")
    assert os.listdir(folder) == []


def test_interrupted_videos_leave_nothing(tmp_path: Path) -> None:
    pytest.importorskip("imageio_ffmpeg")

    class Interrupted(list[np.ndarray]):
        def __iter__(self) -> Iterator[np.ndarray]:
            yield self[0]
            raise KeyboardInterrupt

    (tmp_path / "a.mp4").write_text("old")
    with pytest.raises(KeyboardInterrupt):
        save_animation(Interrupted(moving_squares(2)), tmp_path / "a.mp4")
    assert os.listdir(tmp_path) == ["a.mp4"]
    assert (tmp_path / "a.mp4").read_text() == "old"


def test_wrong_arguments(tmp_path: Path) -> None:
    for path in ("a.avi", "a", "a.gif.txt"):
        with pytest.raises(SettingError, match=r"should end in \.gif or \.mp4"):
            save_animation(moving_squares(1), tmp_path / path)
    for fps in (0, -1, float("nan"), float("inf"), 1e-9):
        with pytest.raises(SettingError, match="fps must be"):
            save_animation(moving_squares(1), tmp_path / "a.gif", fps)
    with pytest.raises(SettingError, match="at least one frame"):
        save_animation([], tmp_path / "a.gif")
    with pytest.raises(OutputError, match="there is no folder"):
        save_animation(moving_squares(1), tmp_path / "none" / "a.gif")
    assert os.listdir(tmp_path) == []
