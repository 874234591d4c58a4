"""MP4 files, written by the ffmpeg that the package imageio-ffmpeg brings along."""

from __future__ import annotations

import contextlib
import importlib
import subprocess
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import IO

import numpy as np

from ..errors import SettingError
from ..files import atomic

# Constant quality of H.264, 0 (lossless) to 51; 18 and below look like the original.
QUALITY = 16


def find_ffmpeg() -> str:
    """The path of the ffmpeg program.

    Raises:
        SettingError: imageio-ffmpeg is not installed, or has no program for this machine.
    """
    try:
        package = importlib.import_module("imageio_ffmpeg")
    except ImportError as error:
        raise SettingError(
            "MP4 files need the package imageio-ffmpeg: pip install 'jaxenstein[video]'; "
            "without it write a .gif"
        ) from error
    try:
        return package.get_ffmpeg_exe()
    except RuntimeError as error:
        raise SettingError(
            "imageio-ffmpeg finds no ffmpeg for this machine; install ffmpeg and set "
            "IMAGEIO_FFMPEG_EXE to its path, or write a .gif"
        ) from error


def save_mp4(
    frames: Sequence[np.ndarray] | np.ndarray, path: str | Path, fps: float = 15.0
) -> None:
    """Write an MP4 file of H.264 video that browsers and players show everywhere.

    Args:
        frames: at least one image uint8[h, w, 3], all of one size. Odd sizes are made even by
            repeating the last row or column, as the format has to.
        path: the file to write, whole or not at all.
        fps: frames a second.

    Raises:
        SettingError: imageio-ffmpeg is missing.
        OutputError: `path` cannot be written.
    """
    program = find_ffmpeg()
    height, width, _ = _even(frames[0]).shape
    with atomic(path) as temporary, _encoder(program, (width, height), fps, temporary) as pipe:
        for frame in frames:
            pipe.write(np.ascontiguousarray(_even(frame)).data)


@contextlib.contextmanager
def _encoder(program: str, size: tuple[int, int], fps: float, target: Path) -> Iterator[IO[bytes]]:
    """Run ffmpeg on what is written to the pipe; an OutputError if it fails, killed on errors."""
    # A file rather than a pipe for its messages: a full pipe would stop it.
    with tempfile.TemporaryFile() as messages:
        process = subprocess.Popen(
            [program, *_arguments(size, fps), str(target.absolute())],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=messages,
        )
        assert process.stdin is not None
        failed = False
        try:
            try:
                yield process.stdin
                process.stdin.close()
            except BrokenPipeError:
                failed = True
            failed = process.wait() != 0 or failed
        finally:
            process.kill()
            process.wait()
            with contextlib.suppress(OSError):
                process.stdin.close()
        if failed:
            raise OSError(_reason(messages))


def _arguments(size: tuple[int, int], fps: float) -> Iterable[str]:
    """Options of ffmpeg; the matrix of colours is converted to and named, lest players guess."""
    width, height = size
    return (
        *("-hide_banner", "-nostdin", "-loglevel", "error", "-y"),
        *("-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", f"{fps:g}"),
        *("-i", "pipe:0", "-an"),
        *("-vf", "scale=out_color_matrix=bt709:out_range=tv:flags=accurate_rnd+full_chroma_int"),
        *("-c:v", "libx264", "-preset", "medium", "-crf", str(QUALITY), "-pix_fmt", "yuv420p"),
        *("-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "bt709"),
        *("-color_range", "tv", "-movflags", "+faststart", "-f", "mp4"),
    )


def _reason(messages: IO[bytes]) -> str:
    """The last line that ffmpeg printed about its failure."""
    messages.seek(0)
    lines = messages.read().decode(errors="replace").split("\n")
    said = [line.strip() for line in lines if line.strip()]
    full = next((line for line in said if "No space left" in line), None)
    if full is not None:
        return "no space left on device"
    return f"ffmpeg failed: {said[-1] if said else 'no message'}"


def _even(frame: np.ndarray) -> np.ndarray:
    height, width, _ = frame.shape
    return np.pad(frame, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
