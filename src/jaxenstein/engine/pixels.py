"""Painting: one expression a pixel, over its row's constants and its column's words."""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from .camera import Camera
from .fusion import staged
from .image_columns import ImageColumns
from .level import WORD
from .scene import CEILING, FLOOR, Scene, Theme
from .shade import ImageKind, pack_rgb, tone
from .sprites import Layers

# Depths in tiles from which to which the floor's checker fades: beyond, it is finer than a pixel.
CHECKER_FADES = (3.0, 14.0)
# Adding this to a float32 of magnitude below 2**22 leaves its nearest integer in the low bits.
_ROUNDER = 1.5 * 2**23
_ROUNDER_BITS = int(np.float32(_ROUNDER).view(np.uint32))


def paint(columns: ImageColumns, scene: Scene, camera: Camera, kind: ImageKind) -> jax.Array:
    """Paint an image; see `render.render` for its shape and type."""
    stage = partial(paint_words, theme=scene.theme, camera=camera, kind=kind)
    # Without extra columns, one pass paints and cuts pixels to bytes.
    image = (staged(stage) if camera.extra else stage)(scene.position, columns)
    image = image[:, : camera.width]
    if kind == "rgb":
        # Bytes of whole words vectorise; an image made with three channels does not.
        return lax.bitcast_convert_type(image, jnp.uint8)[..., :3]
    return image if kind == "depth" else image.astype(jnp.uint8)


def paint_words(
    position: jax.Array, columns: ImageColumns, *, theme: Theme, camera: Camera, kind: ImageKind
) -> jax.Array:
    """paint[height, width + extra]."""
    columns = jax.tree.map(lambda leaf: leaf[..., None, :], columns)
    below = jnp.asarray(camera.row_offsets())[:, None]
    image = _background(columns, below, position, theme, camera, kind)
    # Rows are counted from the horizon, or from the walls' middle where that is lower or higher.
    across = below if columns.drop is None else below - columns.drop
    image = jnp.where(jnp.abs(across) < columns.half, _walls(columns, across), image)
    return image if columns.layers is None else _billboards(columns.layers, below, image)


def _whole(value_less_half: jax.Array) -> jax.Array:
    """uint32: the integer part of a value, modulo 2**32, given the value less one half.

    For magnitudes below 2**22. A conversion would do, but XLA clamps those, which costs more
    than all the rest of a pixel. The bound keeps the rounder apart from constants in the value,
    with which some compilers would merge it, and it cannot hold their fractions.
    """
    bounded = jnp.maximum(value_less_half, jnp.float32(-(2.0**22)))
    bits = lax.bitcast_convert_type(bounded + jnp.float32(_ROUNDER), jnp.uint32)
    return bits - jnp.uint32(_ROUNDER_BITS)


def _test(word: jax.Array, bit: jax.Array) -> jax.Array:
    """bool: whether a bit of a word, counted from its greatest, is set; never for bits past it.

    As the sign of a number, which takes one shift and no mask.
    """
    return lax.bitcast_convert_type(jnp.left_shift(word, bit), jnp.int32) < 0


def _background(
    columns: ImageColumns,
    below: jax.Array,
    position: jax.Array,
    theme: Theme,
    camera: Camera,
    kind: ImageKind,
) -> jax.Array:
    """paint[height, width or 1] of floor and ceiling."""
    distance = camera.row_distances()[:, None]
    if kind == "depth":
        return jnp.asarray(distance)
    ceiling, even, odd = _row_paints(theme, distance, kind)
    if kind == "labels":
        return jnp.where(below > 0, even, ceiling)
    if np.array_equal(*np.asarray(theme.floor)):
        return jnp.where(below > 0, even, ceiling)
    eye = position - jnp.float32(0.5)
    x, y = (_whole(eye[i] + distance * columns.ray[i]) for i in (0, 1))
    floor = jnp.where((x ^ y) & jnp.uint32(1) != 0, odd, even)
    return jnp.where(below > 0, floor, ceiling)


def _row_paints(
    theme: Theme, distance: np.ndarray, kind: ImageKind
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """paint[height, 1] of the ceiling and of the floor's even and odd tiles, on the host."""
    light = theme.light.plain(distance)
    near, far = CHECKER_FADES
    contrast = np.clip((far - distance) / (far - near), 0, 1).astype(np.float32)
    floor = np.asarray(theme.floor)
    mean = floor.mean(axis=0)
    even, odd = (
        [m + (c - m) * contrast for c, m in zip(tile, mean, strict=True)] for tile in floor
    )
    ceiling = list(np.asarray(theme.ceiling))
    labels = np.uint32(CEILING), np.uint32(FLOOR), np.uint32(FLOOR)
    paints = zip((ceiling, even, odd), labels, strict=True)
    first, second, third = (tone(kind, pack_rgb(c, light), label, distance) for c, label in paints)
    return first, second, third


def _walls(columns: ImageColumns, across: jax.Array) -> jax.Array:
    """paint[height or 1, width] of the walls, as if they filled the image."""
    panels = columns.panels
    if panels is None:
        return columns.wall
    scale = (WORD // 2) / columns.half
    bit = _whole(across * scale + jnp.float32(WORD // 2 - 0.5))
    image = jnp.where(_test(panels.planes[0], bit), panels.paint[0], columns.wall)
    return jnp.where(_test(panels.planes[1], bit), panels.paint[1], image)


def _billboards(layers: Layers, below: jax.Array, image: jax.Array) -> jax.Array:
    """The image with the billboards over it, the farthest first."""
    for k in reversed(range(layers.scale.shape[0])):
        bit = _whole(layers.scale[k] * below + layers.offset[k])
        own = jnp.where(_test(layers.planes[1, k], bit), layers.paint[1, k], layers.paint[0, k])
        image = jnp.where(_test(layers.planes[0, k], bit), own, image)
    return image
