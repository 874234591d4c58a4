"""Light: how colours fall off with depth, and colours as packed words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np

ImageKind = Literal["rgb", "gray", "depth", "labels"]

# A surface at depth d has the brightness 1 / (1 + FALLOFF * d), but at least DIMMEST.
FALLOFF = 0.13
DIMMEST = 0.22
# Faces that look north or south are darker, so that corners show.
SIDE_LIGHT = 0.8
# Tiles of a wall have darker edges of this width in tiles, by this much next to the eye and by
# nothing from SEAM_FADES tiles on: without them, a wall that fills the view shows no motion.
SEAM_WIDTH = 0.03
SEAM_SHADE = 0.3
SEAM_FADES = 7.0
# ITU-R BT.601 luma weights, in 1/256.
LUMA = (77, 150, 29)


def brightness(depth: Any) -> Any:
    """Factor on colours for surfaces at a depth in tiles; numpy in, numpy out."""
    xp = np if isinstance(depth, np.ndarray) else jnp
    return xp.maximum(np.float32(1) / (1 + np.float32(FALLOFF) * depth), np.float32(DIMMEST))


@dataclass(frozen=True)
class Light:
    """How bright things are: factors from 0 to 1 on their colours. Tasks may have another."""

    def wall(self, depth: jax.Array, horizontal: jax.Array, along: jax.Array) -> jax.Array:
        """float32: of walls; the arguments are as in `raycast.Hits`."""
        side = jnp.where(horizontal, jnp.float32(SIDE_LIGHT), 1)
        at_seam = jnp.abs(along - 0.5) > 0.5 - SEAM_WIDTH
        seam = jnp.where(at_seam, SEAM_SHADE * jnp.clip(1 - depth / SEAM_FADES, 0, 1), 0)
        return brightness(depth) * side * (1 - seam)

    def plain(self, depth: Any) -> Any:
        """float32: of floor, ceiling and billboards, numpy in, numpy out."""
        return brightness(depth)


def pack_rgb(colour: Any, light: Any) -> Any:
    """Words 0x00BBGGRR of colours under a light; numpy in, numpy out.

    Args:
        colour: three float32 arrays (red, green, blue) from 0 to 255.
        light: float32, a factor from 0 to 1 of the colours' common shape.
    """
    red, green, blue = ((part * light + np.float32(0.5)).astype(np.uint32) for part in colour)
    return red | (green << np.uint32(8)) | (blue << np.uint32(16))


def luma(words: Any) -> Any:
    """uint32 grey value, 0 to 255, of packed colours, by ITU-R BT.601."""
    red, green, blue = (words >> np.uint32(shift) & np.uint32(255) for shift in (0, 8, 16))
    weighted = red * np.uint32(LUMA[0]) + green * np.uint32(LUMA[1]) + blue * np.uint32(LUMA[2])
    return (weighted + np.uint32(128)) >> np.uint32(8)


def tone(kind: ImageKind, words: Any, labels: Any, depth: Any) -> Any:
    """What a surface leaves in an image of this kind, of its packed colour, label and depth."""
    if kind == "depth":
        return depth
    if kind == "labels":
        return labels.astype(np.uint32)
    return luma(words) if kind == "gray" else words
