"""What is drawn over or below the view: bars in a strip, and a frame in a colour."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from ..engine.shade import LUMA, ImageKind
from ..errors import SettingError

# Rows of the strip for each row of the whole image, and the fewest.
SHARE, FEWEST = 0.1, 4
EMPTY = (38, 38, 42)
RIM = (12, 12, 14)
Levels = tuple[tuple[float, tuple[int, int, int]], ...]
"""A bar's colour up to each level; a level of its own lets an agent tell danger at a glance."""
LEVELS: Levels = (
    (0.3, (226, 44, 36)),
    (0.6, (238, 190, 36)),
    (1.0, (66, 200, 72)),
)
AMMUNITION: Levels = ((0.2, (206, 60, 190)), (1.0, (84, 138, 240)))


def check_overlay(name: str, wanted: bool, observation: str) -> None:
    """Raise if a setting adds to a picture that has neither colours nor grays.

    Args:
        name: of the setting.
        wanted: its value.
        observation: the kind of observation.

    Raises:
        SettingError: it is true, and the observation has neither colours nor grays.
    """
    if wanted and observation not in ("rgb", "gray", "dict"):
        raise SettingError(
            f"{name}=True needs observation 'rgb', 'gray' or 'dict', not {observation!r}"
        )


def check_strip(hud: bool, observation: str, height: int) -> None:
    """Raise unless a strip can be drawn where it is wanted, in an image of a height in pixels."""
    check_overlay("hud", hud, observation)
    if hud and strip_rows(height) * 2 > height:
        raise SettingError(f"hud=True needs a height of at least 8 pixels, not {height}")


def strip_rows(height: int) -> int:
    """Rows of the strip in an image of a height in pixels."""
    return max(FEWEST, round(SHARE * height))


def bar(
    level: jax.Array, rows: int, width: int, kind: ImageKind, levels: Levels = LEVELS
) -> jax.Array:
    """A bar that is full at level 1 and empty at 0.

    Args:
        level: float32[].
        rows: rows of the strip, at least 3.
        width: its columns.
        kind: `"rgb"` for uint8[rows, width, 3], `"gray"` for uint8[rows, width].
        levels: its colours.
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
    """An image with a frame in a colour over its border: 2 pixels wide in one of 64 by 64.

    Args:
        image: of a kind; a depth image stays as it is.
        colour: uint8[3].
        label: uint8[], what the frame says in an image of labels.
        kind: of the image.
    """
    if kind == "depth":
        return image
    wide = max(1, min(image.shape[:2]) // 32)
    if kind != "rgb":
        colour = label if kind == "labels" else _gray(colour[None, None])[0, 0]
    # Four strips: a choice for every byte of the image takes as long as all of its drawing.
    for strip in np.s_[:wide], np.s_[-wide:], np.s_[:, :wide], np.s_[:, -wide:]:
        image = image.at[strip].set(colour)
    return image


def _gray(image: jax.Array) -> jax.Array:
    """uint8[height, width]: the luma of an image in colours."""
    weights = jnp.asarray(LUMA, jnp.int32)
    weighted = jnp.sum(image.astype(jnp.int32) * weights[None, None], axis=-1, dtype=jnp.int32)
    return ((weighted + 128) >> 8).astype(jnp.uint8)
