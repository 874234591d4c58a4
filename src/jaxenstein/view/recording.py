"""Episodes as pictures: animated GIFs, contact sheets, frames beside a map."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from ..maps.tilemap import TileMap
from .files import atomic

BACKGROUND = (24, 26, 30)
TEXT = (232, 232, 226)
FAINT = (150, 153, 160)
CAPTION_HEIGHT = 30
# Frames from which a GIF's palette is taken, and their longest side while doing so.
PALETTE_SAMPLES = 16
PALETTE_SIZE = 400
# GIF delays are whole hundredths of a second, and browsers slow down delays below two.
MAX_FPS = 50


@dataclasses.dataclass(frozen=True)
class Episode:
    """What was seen and done in one episode of T steps, as numpy arrays.

    Attributes:
        frames: uint8[T + 1, H, W, 3], what the agent saw, from the reset on.
        positions: float32[T + 1, 2], (x, y) in tiles.
        headings: float32[T + 1], radians, 0 along +x, growing clockwise on the map.
        rewards: float32[T], of each step.
        closed: bool[T + 1, D], which doors were closed, in the order of the map's.
        sprites: float32[T + 1, N, 2], (x, y) of the things there can be, in tiles.
        labels: int32[T + 1, N], label id of each.
        visible: bool[T + 1, N], which of them were there.
        events: what happened in each of the T steps, in words, "" for nothing.
        tilemap: the map it was played on, or None.
        variables: what else was known of the agent, by name, such as its health: float[T + 1].
    """

    frames: np.ndarray
    positions: np.ndarray
    headings: np.ndarray
    rewards: np.ndarray
    closed: np.ndarray
    sprites: np.ndarray
    labels: np.ndarray
    visible: np.ndarray
    events: tuple[str, ...]
    tilemap: TileMap | None = None
    variables: Mapping[str, np.ndarray] = dataclasses.field(default_factory=dict)

    @property
    def steps(self) -> int:
        """The number of steps, T."""
        return len(self.rewards)

    @property
    def returns(self) -> np.ndarray:
        """float64[T + 1]: the sum of the rewards so far."""
        return np.concatenate([[0.0], np.cumsum(self.rewards, dtype=np.float64)])


def enlarge(frame: np.ndarray, scale: int) -> np.ndarray:
    """uint8[H * scale, W * scale, 3]: every pixel as a square, so that it stays sharp."""
    return np.repeat(np.repeat(frame, scale, axis=0), scale, axis=1)


def scale_to(height: int, target: int) -> int:
    """The smallest whole factor that makes `height` pixels at least about `target` high."""
    return max(1, -(-target // height))


def mosaic(frames: np.ndarray, columns: int, *, scale: int = 1, gap: int = 2) -> np.ndarray:
    """Lay out images in a grid, row by row.

    Args:
        frames: uint8[n, H, W, 3].
        columns: images in a row.
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


def contact_sheet(
    frames: np.ndarray, columns: int, path: str | Path, *, scale: int = 2, gap: int = 2
) -> None:
    """Write images side by side as one PNG; see `mosaic` for the arguments.

    Raises:
        OutputError: if `path` cannot be written.
    """
    save_png(mosaic(frames, columns, scale=scale, gap=gap), path)


def save_png(image: np.ndarray, path: str | Path) -> None:
    """Write uint8[h, w, 3] as PNG, whole or not at all.

    Raises:
        OutputError: if `path` cannot be written.
    """
    with atomic(path) as temporary:
        Image.fromarray(image).save(temporary, format="PNG", optimize=True)


def save_gif(frames: Sequence[np.ndarray], path: str | Path, fps: float = 15.0) -> None:
    """Write an endlessly repeating GIF with one palette for all frames and no dithering.

    Args:
        frames: at least one image uint8[h, w, 3], all of one size.
        path: the file to write, whole or not at all.
        fps: frames a second, at most 50.

    Raises:
        OutputError: if `path` cannot be written.
    """
    palette = _common_palette(frames)
    pictures = [_with_palette(frame, palette) for frame in frames]
    delay = 10 * round(100 / min(fps, MAX_FPS))
    with atomic(path) as temporary:
        pictures[0].save(
            temporary,
            format="GIF",
            save_all=True,
            append_images=pictures[1:],
            duration=delay,
            loop=0,
            optimize=False,
        )


def _common_palette(frames: Sequence[np.ndarray]) -> Image.Image:
    """A palette image made from frames spread over the whole sequence.

    Each colour counts by the root of its area, so that small bright things keep theirs beside
    large surfaces.
    """
    samples = np.stack([frames[i] for i in evenly(len(frames), PALETTE_SAMPLES)])
    # Skipping pixels instead of averaging them keeps the colours that are really there.
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


def compose_side_by_side(
    frame: np.ndarray, map_picture: Image.Image | None, caption: Sequence[str], *, scale: int
) -> np.ndarray:
    """What the agent sees beside the map, over a line of text.

    Args:
        frame: uint8[H, W, 3].
        map_picture: the map from above, or None to leave it out.
        caption: pieces of text: the last one is set apart at the right, the others follow each
            other from the left.
        scale: whole factor by which the frame is enlarged.

    Returns:
        uint8[h, w, 3], the same size for every frame and map picture of the same sizes.
    """
    gap = 6
    view = Image.fromarray(enlarge(frame, scale))
    parts = [view] if map_picture is None else [view, map_picture]
    height = max(part.height for part in parts)
    width = sum(part.width for part in parts) + gap * (len(parts) + 1)
    sheet = Image.new("RGB", (width, height + 2 * gap + CAPTION_HEIGHT), BACKGROUND)
    left = gap
    for part in parts:
        sheet.paste(part, (left, gap + (height - part.height) // 2))
        left += part.width + gap
    _write_caption(sheet, caption, height + gap)
    return np.asarray(sheet)


def _write_caption(sheet: Image.Image, caption: Sequence[str], top: int) -> None:
    draw = ImageDraw.Draw(sheet)
    middle = top + CAPTION_HEIGHT // 2 + 3
    *facts, event = caption
    left = 12
    for fact in facts:
        draw.text((left, middle), fact, TEXT, _font(), anchor="lm")
        left += round(draw.textlength(fact, _font())) + 22
    if sheet.width - left > draw.textlength(event, _font()) + 12:
        draw.text((sheet.width - 12, middle), event, (255, 206, 84), _font(), anchor="rm")


@cache
def _font() -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(15)


def caption(episode: Episode, step: int, recent: int = 12) -> list[str]:
    """The text for a frame of an episode: step, return, variables, and the latest event.

    Args:
        episode: the episode.
        step: index of the frame, 0 to `episode.steps`.
        recent: for how many steps an event stays visible.
    """
    latest = ""
    for event in episode.events[max(0, step - recent) : step]:
        latest = event or latest
    variables = [f"{name} {values[step]:g}" for name, values in episode.variables.items()]
    return [f"step {step}", f"return {_sum_text(episode, step)}", *variables, latest]


def _sum_text(episode: Episode, step: int) -> str:
    """The return so far: a whole number where all rewards are."""
    total = float(episode.returns[step])
    if not total or np.array_equal(episode.rewards, np.round(episode.rewards)):
        return str(round(total))
    return f"{total:+.4g}"


def evenly(count: int, wanted: int) -> list[int]:
    """At most `wanted` indices spread over `range(count)`, first and last included."""
    return sorted({int(i) for i in np.linspace(0, count - 1, min(wanted, count)).round()})
