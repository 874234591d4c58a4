"""Observations of any kind as colour images, which notebooks can show."""

from __future__ import annotations

import dataclasses
import io
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from ..errors import SettingError, quoted
from ..fields import check_whole
from ..maps.symbols import label_colours, label_name
from .recording import enlarge, evenly, mosaic, save_png, scale_to

# Depth in tiles at which a depth image is at half brightness.
HALF_DEPTH = 1.3
KINDS = ("rgb", "gray", "depth", "labels")
# The least height in pixels at which a single image, or a batch of images, is shown.
SHOWN_HEIGHT = 256
BATCH_HEIGHT = 480
MOST_SHOWN = 64


def image_of(obs: Any) -> Any:
    """The image of an observation: the one of a `dict`, or the observation itself."""
    return obs["image"] if isinstance(obs, dict) else obs


def picture(image: np.ndarray, kind: str) -> np.ndarray:
    """Convert an image observation to uint8[..., H, W, 3].

    Args:
        image: images with any leading axes.
        kind: the environment's `observation`. Depth becomes brightness (near is bright), labels
            become the colours of the map.
    """
    if kind in ("rgb", "dict"):
        return image
    if kind == "labels":
        return label_colours()[image]
    if kind == "depth":
        image = np.round(255 * HALF_DEPTH / (HALF_DEPTH + image)).astype(np.uint8)
    return np.repeat(image[..., None], 3, axis=-1)


@dataclasses.dataclass(frozen=True)
class Frame:
    """An image that a notebook shows as the value of a cell.

    Attributes:
        image: uint8[H, W, 3].
        scale: whole factor by which it is enlarged when shown; pixels stay square.
    """

    image: np.ndarray
    scale: int = 1

    def __repr__(self) -> str:
        """Its size."""
        height, width, _ = self.image.shape
        return f"<Frame of {width}x{height} pixels>"

    def _repr_png_(self) -> bytes:
        """The enlarged image as a PNG, for notebooks."""
        stream = io.BytesIO()
        Image.fromarray(enlarge(self.image, self.scale)).save(stream, format="PNG")
        return stream.getvalue()

    def save(self, path: str | Path) -> None:
        """Write the enlarged image as a PNG.

        Raises:
            SettingError: `path` does not end in .png.
            OutputError: the file cannot be written.
        """
        if Path(path).suffix.lower() != ".png":
            raise SettingError(f"{path} should end in .png")
        save_png(enlarge(self.image, self.scale), path)


def show(observation: Any, kind: str | None = None, *, scale: int | None = None) -> Frame:
    """Show an observation, or a batch of them, as an image in a notebook.

    Args:
        observation: an observation from `reset` or `step`, with any leading axes; of a large
            batch, 64 observations are shown.
        kind: the environment's `observation`; needed for `"labels"`, which would otherwise be
            shown as gray.
        scale: whole factor by which pixels are enlarged; None chooses one.

    Raises:
        SettingError: the value is not an observation of that kind.

    Examples:
        >>> import jax, jaxenstein
        >>> env, params = jaxenstein.make("simple", height=8, width=8)
        >>> observation, state = env.reset(jax.random.key(0), params)
        >>> show(observation)
        <Frame of 8x8 pixels>
    """
    image = np.asarray(image_of(observation))
    kind = _kind_of(image) if kind in (None, "dict") else kind
    _check(image, kind)
    if scale is not None:
        scale = check_whole("scale", scale, 1, 64)
    frames = picture(image, kind)
    if frames.ndim == 3:
        return Frame(frames, scale or scale_to(frames.shape[:2], SHOWN_HEIGHT))
    frames = frames.reshape(-1, *frames.shape[-3:])
    frames = frames[evenly(len(frames), MOST_SHOWN)]
    columns = int(np.ceil(np.sqrt(len(frames))))
    rows = -(-len(frames) // columns)
    size = scale or scale_to((rows * frames.shape[1], columns * frames.shape[2]), BATCH_HEIGHT)
    return Frame(mosaic(frames, columns, scale=size))


def _kind_of(image: np.ndarray) -> str:
    if image.dtype.kind == "f":
        return "depth"
    return "rgb" if image.ndim >= 3 and image.shape[-1] == 3 else "gray"


def _check(image: np.ndarray, kind: str) -> None:
    """Raise a SettingError unless there is at least one image of this kind with a size above 0."""
    if kind not in KINDS:
        raise SettingError(f"kind must be one of {', '.join(KINDS)} or dict, not {quoted(kind)}")
    axes = 3 if kind == "rgb" else 2
    shape = "[..., height, width, 3]" if kind == "rgb" else "[..., height, width]"
    dtype = "float32" if kind == "depth" else "uint8"
    fits = image.ndim >= axes and image.size and (kind != "rgb" or image.shape[-1] == 3)
    if not fits or image.dtype != dtype:
        raise SettingError(
            f"a {kind} observation is {dtype}{shape}, not {image.dtype}{list(image.shape)}"
        )
    if kind == "labels":
        for label in np.unique(image):
            label_name(int(label))
