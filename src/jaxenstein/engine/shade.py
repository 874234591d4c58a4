"""Light: how colours darken with depth, and colours as packed words."""

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
# Faces that look north or south are darker, so that corners are visible.
SIDE_LIGHT = 0.8
# Wall tiles have darker edges of this width in tiles. The effect is strongest next to the eye and
# gone from SEAM_FADES tiles on. Without it, a wall that fills the view shows no motion.
SEAM_WIDTH = 0.03
SEAM_SHADE = 0.3
SEAM_FADES = 7.0


def brightness(depth: Any) -> Any:
    """The brightness of surfaces at a depth in tiles; numpy for numpy, else JAX."""
    xp = np if isinstance(depth, np.ndarray) else jnp
    return xp.maximum(np.float32(1) / (1 + np.float32(FALLOFF) * depth), np.float32(DIMMEST))


@dataclass(frozen=True)
class Light:
    """The brightness of surfaces: factors from 0 to 1 on their colours. Tasks may override it."""

    def wall(self, depth: jax.Array, horizontal: jax.Array, along: jax.Array) -> jax.Array:
        """float32: the factor for walls; the arguments are as in `hits.Hits`."""
        side = by_side(horizontal, jnp.float32(SIDE_LIGHT), 1)
        at_seam = jnp.abs(along - 0.5) > 0.5 - SEAM_WIDTH
        seam = jnp.where(at_seam, SEAM_SHADE * jnp.clip(1 - depth / SEAM_FADES, 0, 1), 0)
        return brightness(depth) * side * (1 - seam)

    def plain(self, depth: Any) -> Any:
        """float32: the factor for floor, ceiling and billboards; numpy for numpy, else JAX."""
        return brightness(depth)


def by_side(horizontal: jax.Array, lengthwise: Any, crosswise: Any) -> jax.Array:
    """The first value for walls that look north or south, the second for west and east.

    Free walls that look elsewhere have their mean (see `hits.Hits`).
    """
    if horizontal.dtype == bool:
        return jnp.where(horizontal, lengthwise, crosswise)
    return crosswise + (lengthwise - crosswise) * horizontal


def pack_rgb(colour: Any, light: Any) -> Any:
    """Pack colours under a light into words 0x00BBGGRR; numpy for numpy, else JAX.

    Args:
        colour: three float32 arrays (red, green, blue) from 0 to 255.
        light: float32, a factor from 0 to 1, in the shape of the colours.
    """
    red, green, blue = ((part * light + np.float32(0.5)).astype(np.uint32) for part in colour)
    return red | (green << np.uint32(8)) | (blue << np.uint32(16))


def luma(words: Any) -> Any:
    """uint32 grey value, 0 to 255, of packed colours."""
    return luma_of(*(words >> np.uint32(shift) & np.uint32(255) for shift in (0, 8, 16)))


def luma_of(red: Any, green: Any, blue: Any) -> Any:
    """uint32 grey value, 0 to 255, of uint32 channels, by ITU-R BT.601 in steps of 1/256."""
    weighted = red * np.uint32(77) + green * np.uint32(150) + blue * np.uint32(29)
    return (weighted + np.uint32(128)) >> np.uint32(8)


def tone(kind: ImageKind, words: Any, labels: Any, depth: Any) -> Any:
    """The value of a surface in an image of this kind, from its colour, label and depth."""
    if kind == "depth":
        return depth
    if kind == "labels":
        return labels.astype(np.uint32)
    return luma(words) if kind == "gray" else words
