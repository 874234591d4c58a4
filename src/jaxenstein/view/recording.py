"""Write images to files, atomically: animations, contact sheets, PNGs.

MP4 files are written by the ffmpeg that comes with the package imageio-ffmpeg.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import subprocess
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import IO

import numpy as np
from PIL import Image

from ..errors import SettingError
from ..fields import Domain, check_value
from ..files import atomic, check_writable

BACKGROUND = (24, 26, 30)
TEXT = (232, 232, 226)
FAINT = (150, 153, 160)
# The number of frames that determine a GIF's palette, and the size to which they are reduced.
PALETTE_SAMPLES = 16
PALETTE_SIZE = 400
# GIF delays are whole hundredths of a second, and browsers slow down delays below two.
MAX_FPS = 50
# An enlarged image may be at most this many times as wide as its target height.
WIDEST = 4
# Constant quality of H.264, 0 (lossless) to 51; 18 and below look like the original.
QUALITY = 16


def enlarge(frame: np.ndarray, scale: int) -> np.ndarray:
    """uint8[H * scale, W * scale, 3]: every pixel becomes a square, so that it stays sharp."""
    return np.repeat(np.repeat(frame, scale, axis=0), scale, axis=1)


def scale_to(size: Sequence[int], target: int) -> int:
    """The smallest whole factor that makes an image at least about `target` pixels high.

    Smaller for wide images, which become at most `WIDEST * target` pixels wide.

    Args:
        size: height and width of the image.
        target: pixels.
    """
    height, width = size
    return max(1, min(-(-target // height), WIDEST * target // width))


def mosaic(frames: np.ndarray, columns: int, *, scale: int = 1, gap: int = 2) -> np.ndarray:
    """Arrange images in a grid, row by row.

    Args:
        frames: uint8[n, H, W, 3].
        columns: images per row.
        scale: whole factor by which each image is enlarged.
        gap: pixels between the images and around them.

    Returns:
        uint8[h, w, 3].
    """
    count, height, width, _ = frames.shape
    rows = -(-count // columns)
    height, width = height * scale, width * scale
    shape = (rows * (height + gap) + gap, columns * (width + gap) + gap, 3)
    sheet = np.empty(shape, np.uint8)
    sheet[:] = BACKGROUND
    for i, frame in enumerate(frames):
        top = gap + (i // columns) * (height + gap)
        left = gap + (i % columns) * (width + gap)
        sheet[top : top + height, left : left + width] = enlarge(frame, scale)
    return sheet


def save_png(image: np.ndarray, path: str | Path) -> None:
    """Write uint8[h, w, 3] as a PNG, atomically.

    Raises:
        OutputError: the file cannot be written.
    """
    with atomic(path) as temporary:
        Image.fromarray(image).save(temporary, format="PNG", optimize=True)


def check_animation(path: str | Path) -> None:
    """Check early, before anything is played, whether `save_animation` can write to `path`.

    Raises:
        SettingError: `path` ends neither in .gif nor in .mp4, or the extra for MP4 is missing.
        OutputError: its folder does not exist or is not writable.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in ANIMATIONS:
        raise SettingError(f"{path} should end in {' or '.join(ANIMATIONS)}")
    if suffix == ".mp4":
        find_ffmpeg()
    check_writable(path)


def save_animation(
    frames: Sequence[np.ndarray] | np.ndarray, path: str | Path, fps: float = 15.0
) -> None:
    """Write images as an animation: a GIF or, with the extra `video`, an MP4.

    Args:
        frames: at least one image uint8[h, w, 3], all of one size.
        path: the file to write, atomically; its suffix, .gif or .mp4, selects the format.
        fps: frames per second, 0.1 to 1000; GIFs have at most 50.

    Raises:
        SettingError: the suffix is not supported, `fps` is out of range, there is no image, or
            imageio-ffmpeg is missing.
        OutputError: the file cannot be written.
    """
    check_animation(path)
    check_value("fps", Domain("number", 0.1, 1000), fps)
    if len(frames) == 0:
        raise SettingError("an animation needs at least one frame")
    save = ANIMATIONS[Path(path).suffix.lower()]
    save(frames, path, fps)


def save_gif(
    frames: Sequence[np.ndarray] | np.ndarray, path: str | Path, fps: float = 15.0
) -> None:
    """Write an endlessly repeating GIF with one palette for all frames and no dithering.

    Args:
        frames: at least one image uint8[h, w, 3], all of one size.
        path: the file to write, atomically.
        fps: frames per second, at most 50.

    Raises:
        OutputError: the file cannot be written.
    """
    data = encode_gif(frames, fps)
    with atomic(path) as temporary:
        temporary.write_bytes(data)


def encode_gif(frames: Sequence[np.ndarray] | np.ndarray, fps: float = 15.0) -> bytes:
    """The content of the file that `save_gif` writes."""
    palette = _common_palette(frames)
    first, *others = [_with_palette(frame, palette) for frame in frames]
    stream = io.BytesIO()
    first.save(
        stream,
        format="GIF",
        save_all=True,
        append_images=others,
        duration=10 * round(100 / min(fps, MAX_FPS)),
        loop=0,
        optimize=False,
    )
    return stream.getvalue()


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
            "without it, write a .gif"
        ) from error
    try:
        return package.get_ffmpeg_exe()
    except RuntimeError as error:
        raise SettingError(
            "imageio-ffmpeg has no ffmpeg for this machine; install ffmpeg and set "
            "IMAGEIO_FFMPEG_EXE to its path, or write a .gif"
        ) from error


def save_mp4(
    frames: Sequence[np.ndarray] | np.ndarray, path: str | Path, fps: float = 15.0
) -> None:
    """Write an MP4 file with H.264 video that all browsers and players can show.

    Args:
        frames: at least one image uint8[h, w, 3], all of one size. The format needs even sizes, so
            the last row or column is repeated if necessary.
        path: the file to write, atomically.
        fps: frames per second.

    Raises:
        SettingError: imageio-ffmpeg is missing.
        OutputError: the file cannot be written.
    """
    program = find_ffmpeg()
    height, width, _ = _even(frames[0]).shape
    with atomic(path) as temporary, _encoder(program, (width, height), fps, temporary) as pipe:
        for frame in frames:
            pipe.write(np.ascontiguousarray(_even(frame)).data)


@contextlib.contextmanager
def _encoder(program: str, size: tuple[int, int], fps: float, target: Path) -> Iterator[IO[bytes]]:
    """Run ffmpeg on the bytes written to the pipe; an OutputError if it fails."""
    # Its messages go to a file, because a full pipe would stop it.
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
    """The options of ffmpeg; they convert to a colour matrix and name it, so players agree."""
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


ANIMATIONS = {".gif": save_gif, ".mp4": save_mp4}
"""The writer for each suffix."""


def _common_palette(frames: Sequence[np.ndarray] | np.ndarray) -> Image.Image:
    """A palette image made from frames spread over the whole sequence.

    Each colour is weighted by the root of its area, so that small bright things keep their colours
    next to large surfaces.
    """
    samples = np.stack([frames[i] for i in evenly(len(frames), PALETTE_SAMPLES)])
    # Skipping pixels, unlike averaging, keeps the colours that are really there.
    stride = max(1, -(-max(samples.shape[1:3]) // PALETTE_SIZE))
    pixels = samples[:, ::stride, ::stride].reshape(-1, 3).astype(np.uint32)
    packed = pixels[:, 0] << 16 | pixels[:, 1] << 8 | pixels[:, 2]
    words, areas = np.unique(packed, return_counts=True)
    colours = np.stack([words >> 16, words >> 8 & 255, words & 255], axis=-1).astype(np.uint8)
    strip = np.repeat(colours, np.ceil(np.sqrt(areas)).astype(int), axis=0)
    coverage = Image.Quantize.MAXCOVERAGE
    return Image.fromarray(strip[None]).quantize(256, coverage, 3, dither=Image.Dither.NONE)


def _with_palette(frame: np.ndarray, palette: Image.Image) -> Image.Image:
    return Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE)


def evenly(count: int, wanted: int) -> list[int]:
    """At most `wanted` indices spread over `range(count)`, including the first and last."""
    return sorted({int(i) for i in np.linspace(0, count - 1, min(wanted, count)).round()})
