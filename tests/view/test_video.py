"""MP4 files, decoded again."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from jaxenstein import SettingError
from jaxenstein.files import OutputError
from jaxenstein.view import recording
from jaxenstein.view.recording import check_animation, save_animation


def frames(count: int, height: int = 97, width: int = 131) -> list[np.ndarray]:
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
    """What ffmpeg says of the stream in a file, and its frames."""
    program = pytest.importorskip("imageio_ffmpeg").get_ffmpeg_exe()
    raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    done = subprocess.run([program, "-i", str(path), *raw], capture_output=True, check=True)
    lines = done.stderr.decode().splitlines()
    about = next(line for line in lines if "Video: " in line)
    return about, np.frombuffer(done.stdout, np.uint8).reshape(-1, height, width, 3)


def test_video_holds_every_frame_in_its_colours(tmp_path: Path) -> None:
    pytest.importorskip("imageio_ffmpeg")
    shots = np.stack(frames(20))
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


def test_missing_extra_is_told_before_anything_is_played(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(SettingError, match=r"pip install 'jaxenstein\[video\]'"):
        check_animation(tmp_path / "a.mp4")
    check_animation(tmp_path / "a.gif")


def test_no_program_for_this_machine(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
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
def test_a_failing_program_leaves_nothing(
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
        save_animation(Interrupted(frames(2)), tmp_path / "a.mp4")
    assert os.listdir(tmp_path) == ["a.mp4"]
    assert (tmp_path / "a.mp4").read_text() == "old"


def test_wrong_arguments(tmp_path: Path) -> None:
    for path in ("a.avi", "a", "a.gif.txt"):
        with pytest.raises(SettingError, match=r"should end in \.gif or \.mp4"):
            save_animation(frames(1), tmp_path / path)
    for fps in (0, -1, float("nan"), float("inf"), 1e-9):
        with pytest.raises(SettingError, match="fps must be"):
            save_animation(frames(1), tmp_path / "a.gif", fps)
    with pytest.raises(SettingError, match="at least one frame"):
        save_animation([], tmp_path / "a.gif")
    with pytest.raises(OutputError, match="there is no folder"):
        save_animation(frames(1), tmp_path / "none" / "a.gif")
    assert os.listdir(tmp_path) == []
