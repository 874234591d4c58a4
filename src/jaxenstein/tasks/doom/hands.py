"""The player's weapon at the lower edge of the picture, and the flash of its shots."""

from __future__ import annotations

import functools

import jax
import jax.numpy as jnp
import numpy as np

from ...engine.art import SIZE, load_art
from ...engine.shade import ImageKind, luma, pack_rgb
from ...maps.things import RGB
from .weapons import Trigger, Weapon

Layer = tuple[str, tuple[RGB, RGB]]
"""A picture of `engine/art`, and the colours of its shape and of its detail."""
_FIST: Layer = "fist", ((196, 148, 108), (120, 84, 60))
LOOKS: dict[str, tuple[Layer, ...]] = {
    "fist": (_FIST,),
    "pistol": (_FIST, ("pistol", ((40, 40, 46), (104, 106, 114)))),
    "rocket launcher": (_FIST, ("rocket-launcher", ((84, 92, 72), (40, 44, 38)))),
}
"""What a weapon looks like, the farthest first."""
FLASH: Layer = "muzzle-flash", ((240, 132, 28), (255, 244, 190))
# Shares of the picture's rows and columns that the art takes, and tics for which the flash is seen.
ROWS, COLUMNS, TICS = 0.4, 0.3, 4


def show(image: jax.Array, weapon: Weapon, trigger: Trigger, kind: ImageKind) -> jax.Array:
    """A picture with the weapon over it, once that is drawn.

    Args:
        image: uint8[height, width, 3], or uint8[height, width] of grays.
        weapon: what the player holds.
        trigger: what it does.
        kind: of the image; those without colours or grays stay as they are.
    """
    if kind not in ("rgb", "gray"):
        return image
    height, width = image.shape[:2]
    rows, columns = max(1, round(ROWS * height)), max(1, round(COLUMNS * width))
    there, paint = _stamps(weapon.look, rows, columns, kind)
    ends = min(weapon.shot + TICS, weapon.ready)
    fires = (trigger.tics >= weapon.shot) & (trigger.tics < ends)
    covers = jnp.where(fires, there[1], there[0]) & (trigger.wait == 0)
    colour = jnp.where(fires, paint[1], paint[0])
    left = (width - columns) // 2
    place = np.s_[height - rows :, left : left + columns]
    covers = covers if kind == "gray" else covers[..., None]
    return image.at[place].set(jnp.where(covers, colour, image[place]))


@functools.cache
def _stamps(look: str, rows: int, columns: int, kind: ImageKind) -> tuple[np.ndarray, np.ndarray]:
    """Of a weapon at rest and of one that fires: bool[2, rows, columns] and its colours there."""
    pictures = [_piled(LOOKS[look]), _piled((FLASH, *LOOKS[look]))]
    there, colours = (np.stack(parts) for parts in zip(*pictures, strict=True))
    row = ((np.arange(rows) + 0.5) * SIZE / rows).astype(int)[:, None]
    column = ((np.arange(columns) + 0.5) * SIZE / columns).astype(int)[None]
    there, colours = there[:, row, column], colours[:, row, column]
    if kind == "gray":
        words = pack_rgb(list(np.moveaxis(colours, -1, 0).astype(np.float32)), np.float32(1))
        colours = luma(words)
    return there, colours.astype(np.uint8)


def _piled(layers: tuple[Layer, ...]) -> tuple[np.ndarray, np.ndarray]:
    """bool[32, 32] where one of the pictures is, and uint8[32, 32, 3] the colours of the last."""
    there, image = np.zeros((SIZE, SIZE), bool), np.zeros((SIZE, SIZE, 3), np.uint8)
    bits = np.arange(SIZE, dtype=np.uint32)[::-1]
    for art, colours in layers:
        shape, detail = (load_art(art)[:, None] >> bits[None, :, None] & 1).astype(bool)
        there |= shape
        for plane, colour in zip((shape, detail), colours, strict=True):
            image[plane] = colour
    return there, image
