"""Overlays on the view: bars in a strip below it, and a coloured frame."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from ..engine.shade import ImageKind, luma_of
from ..errors import SettingError

# Rows of the strip per row of the whole image, and the fewest.
SHARE, FEWEST = 0.1, 4
EMPTY = (38, 38, 42)
RIM = (12, 12, 14)
Levels = tuple[tuple[float, tuple[int, int, int]], ...]
"""The colour of a bar up to each level, so that an agent can recognise danger at a glance."""
LEVELS: Levels = (
    (0.3, (226, 44, 36)),
    (0.6, (238, 190, 36)),
    (1.0, (66, 200, 72)),
)
AMMUNITION: Levels = ((0.2, (206, 60, 190)), (1.0, (84, 138, 240)))


def check_overlay(name: str, wanted: bool, observation: str) -> None:
    """Raise if a setting adds colours to an image without colours or greys.

    Args:
        name: the name of the setting.
        wanted: its value.
        observation: the kind of observation.

    Raises:
        SettingError: the setting is True, and the observation has neither colours nor greys.
    """
    if wanted and observation not in ("rgb", "gray", "dict"):
        raise SettingError(
            f"{name}=True needs observation 'rgb', 'gray' or 'dict', not {observation!r}"
        )


def check_strip(hud: bool, observation: str, height: int) -> None:
    """Raise if a strip is wanted but does not fit the observation or its height in pixels."""
    check_overlay("hud", hud, observation)
    if hud and strip_rows(height) * 2 > height:
        raise SettingError(f"hud=True needs a height of at least 8 pixels, not {height}")


def strip_rows(height: int) -> int:
    """The rows of the strip in an image of this height in pixels."""
    return max(FEWEST, round(SHARE * height))


def bar(
    level: jax.Array, rows: int, width: int, kind: ImageKind, levels: Levels = LEVELS
) -> jax.Array:
    """A bar that is full at level 1 and empty at 0.

    Args:
        level: float32[].
        rows: rows of the strip, at least 3.
        width: columns of the strip.
        kind: `"rgb"` for uint8[rows, width, 3], `"gray"` for uint8[rows, width].
        levels: the colours of the bar.
    """
    rim = np.ones((rows, width), bool)
    rim[1:-1, 1:-1] = False
    inner = max(width - 2, 1)
    filled = (np.arange(width, dtype=np.float32) - 0.5) / np.float32(inner) < level
    colour = jnp.asarray(levels[-1][1], jnp.uint8)
    for bound, paint in reversed(levels[:-1]):
        colour = jnp.where(level <= bound, jnp.asarray(paint, jnp.uint8), colour)
    row = jnp.where(filled[:, None], colour[None], jnp.asarray(EMPTY, jnp.uint8)[None])
    strip = jnp.where(rim[..., None], jnp.asarray(RIM, jnp.uint8)[None, None], row[None])
    return strip if kind == "rgb" else _gray(strip)


def frame(image: jax.Array, colour: jax.Array, label: jax.Array, kind: ImageKind) -> jax.Array:
    """Draw a coloured frame over the border of an image, 2 pixels wide in a 64x64 image.

    Args:
        image: an image of this kind; depth images are not changed.
        colour: uint8[3].
        label: uint8[], the label of the frame in an image of labels.
        kind: the kind of image.
    """
    if kind == "depth":
        return image
    wide = max(1, min(image.shape[:2]) // 32)
    if kind != "rgb":
        colour = label if kind == "labels" else _gray(colour[None, None])[0, 0]
    # Four strips: selecting every byte of the image would take as long as rendering it.
    for strip in np.s_[:wide], np.s_[-wide:], np.s_[:, :wide], np.s_[:, -wide:]:
        image = image.at[strip].set(colour)
    return image


def _gray(image: jax.Array) -> jax.Array:
    """uint8[height, width]: the luma of a colour image."""
    return luma_of(*jnp.moveaxis(image.astype(jnp.uint32), -1, 0)).astype(jnp.uint8)
