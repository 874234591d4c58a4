"""Painting: one expression per pixel, from the constants of its row and the words of its column."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from .._jax.staging import staged
from ..pytree import PyTreeNode
from .camera import Camera
from .image_columns import ImageColumns
from .level import WORD, Array
from .scene import CEILING, FLOOR, Scene, Theme
from .shade import ImageKind, Light, pack_rgb, tone
from .sprites import Layers

# The range of depths, in tiles, over which the floor's checker and its finer stripes fade;
# farther away they are finer than a pixel.
CHECKER_FADES = (3.0, 14.0)
STRIPES_FADE = (1.0, 9.0)
# Stripes per tile; a floor word covers two tiles.
STRIPES = WORD // 2
# Billboards that are so far below the eye, in tiles, are below the horizon in spite of rounding.
CLEARANCE = 1e-3
# Adding this to a float32 of magnitude below 2**22 leaves its nearest integer in the low bits.
_ROUNDER = 1.5 * 2**23
_ROUNDER_BITS = int(np.float32(_ROUNDER).view(np.uint32))


class Rows(PyTreeNode):
    """The values that the pixels of a row share.

    Attributes:
        distance: float32[height, 1], the depth of floor and ceiling.
        ceiling: paint[height, 1].
        first: paint[height, 1], the floor's first colour.
        second: paint[height, 1], its second colour.
        words: `Theme.floor_words`.
    """

    distance: Array
    ceiling: Array
    first: Array
    second: Array
    words: Array | None


def paint(
    columns: ImageColumns, rows: Rows, scene: Scene, camera: Camera, kind: ImageKind
) -> jax.Array:
    """Paint an image; see `render.render` for its shape and dtype."""
    reach = scene.theme.sprite_drop - scene.theme.sprite_radius
    top = first_row(reach, camera, scene.lift)
    stage = partial(paint_words, rows=rows, top=top, theme=scene.theme, camera=camera, kind=kind)
    # Without extra columns, a single pass paints pixels and unpacks their bytes.
    image = (staged(stage) if camera.extra else stage)(scene.position, columns)
    image = image[:, : camera.width]
    if kind == "rgb":
        # Unpacking bytes from whole words vectorises; computing three channels does not.
        return lax.bitcast_convert_type(image, jnp.uint8)[..., :3]
    return image if kind == "depth" else image.astype(jnp.uint8)


def paint_words(
    position: jax.Array,
    columns: ImageColumns,
    *,
    rows: Rows,
    top: int,
    theme: Theme,
    camera: Camera,
    kind: ImageKind,
) -> jax.Array:
    """paint[height, width + extra]; billboards from the row `top` on."""
    columns = jax.tree.map(lambda leaf: leaf[..., None, :], columns)
    below = jnp.asarray(camera.row_offsets())[:, None]
    image = _background(columns, rows, below, position, theme, kind)
    # Rows relative to the horizon, or to the walls' middle if that is lower or higher.
    across = below if columns.drop is None else below - columns.drop
    image = jnp.where(jnp.abs(across) < columns.half, _walls(columns, across), image)
    if columns.layers is None:
        return image
    return from_row(top, partial(_billboards, columns.layers), below, image)


def first_row(reach: Array, camera: Camera, lift: jax.Array | None) -> int:
    """The first row that billboards can cover, for tiles from the eye down to their upper edges."""
    low = lift is None and bool((reach > CLEARANCE).all())
    return int((camera.row_offsets() <= 0).sum()) if low else 0


def from_row(top: int, paint: Callable[..., jax.Array], below: jax.Array, image: jax.Array) -> Any:
    """The image with `paint(below, image)` in its rows from `top` on.

    On CPUs a loop over the rows above and one over the others, without a copy.
    """
    if not top:
        return paint(below, image)
    return jnp.concatenate([image[:top], paint(below[top:], image[top:])])


def whole(value_less_half: jax.Array) -> jax.Array:
    """uint32: the integer part of a value, modulo 2**32, from the value minus one half.

    For magnitudes below 2**22. XLA clamps ordinary conversions, which costs more than the rest of
    a pixel. The bound keeps compilers from merging the rounding constant with constants in the
    value, whose fractions it could not hold.
    """
    return rounded(jnp.maximum(value_less_half, jnp.float32(-(2.0**22))))


def rounded(value: jax.Array) -> jax.Array:
    """uint32: the nearest integer of a value of magnitude below 2**22, modulo 2**32.

    Other values, infinities and NaN give numbers from 2**22 to 2**32 - 2**22.
    """
    bits = lax.bitcast_convert_type(value + jnp.float32(_ROUNDER), jnp.uint32)
    return bits - jnp.uint32(_ROUNDER_BITS)


def test_bit(word: jax.Array, bit: jax.Array) -> jax.Array:
    """bool: whether a bit of a word is set, counted from the highest; False for bits past it.

    Tests the sign, which takes one shift and no mask.
    """
    return lax.bitcast_convert_type(jnp.left_shift(word, bit), jnp.int32) < 0


def _background(
    columns: ImageColumns,
    rows: Rows,
    below: jax.Array,
    position: jax.Array,
    theme: Theme,
    kind: ImageKind,
) -> jax.Array:
    """paint[height, width or 1] of floor and ceiling."""
    if kind == "depth":
        return jnp.asarray(rows.distance)
    one_colour = isinstance(theme.floor, np.ndarray) and np.array_equal(*theme.floor)
    if kind == "labels" or one_colour:
        return jnp.where(below > 0, rows.first, rows.ceiling)
    second = _second_colour(columns, rows.distance, position, rows.words)
    return jnp.where(below > 0, jnp.where(second, rows.second, rows.first), rows.ceiling)


def _second_colour(
    columns: ImageColumns, distance: Array, position: jax.Array, words: Array | None
) -> jax.Array:
    """bool[height, width]: where the floor has its second colour; see `Theme.floor_words`."""
    if words is None:
        eye = position - jnp.float32(0.5)
        x, y = (whole(eye[i] + distance * columns.ray[i]) for i in (0, 1))
        return (x ^ y) & jnp.uint32(1) != 0
    eye = position * jnp.float32(STRIPES) - jnp.float32(0.5)
    ahead = distance * np.float32(STRIPES)
    stripes = (whole(eye[i] + ahead * columns.ray[i]) & jnp.uint32(WORD - 1) for i in (0, 1))
    # One of the signs, but not both.
    across = [jnp.left_shift(jnp.asarray(words)[i], stripe) for i, stripe in enumerate(stripes)]
    return lax.bitcast_convert_type(across[0] ^ across[1], jnp.int32) < 0


def paint_rows(
    theme: Theme, camera: Camera, kind: ImageKind, lift: jax.Array | None = None
) -> Rows:
    """The shared values of the rows of an image; on the host if they are constants."""
    distance = camera.row_distances(lift)[:, None]
    paints = partial(
        _row_paints,
        light=theme.light,
        fades=CHECKER_FADES if theme.floor_words is None else STRIPES_FADE,
        kind=kind,
    )
    looks = theme.floor, theme.ceiling, theme.floor_words, distance
    known = all(part is None or isinstance(part, np.ndarray) for part in looks)
    if known or kind in ("depth", "labels"):
        return paints(*looks)
    # A separate stage, or some compilers compute this again for each pixel.
    return staged(paints)(*jax.tree.map(jnp.asarray, looks))


def _row_paints(
    floor: Array,
    ceiling: Array,
    words: Array | None,
    distance: Any,
    *,
    light: Light,
    fades: tuple[float, float],
    kind: ImageKind,
) -> Rows:
    near, far = fades
    xp = np if isinstance(distance, np.ndarray) else jnp
    contrast = xp.clip((far - distance) / (far - near), 0, 1).astype(np.float32)
    mean = floor.mean(axis=0)
    even, odd = (
        [m + (c - m) * contrast for c, m in zip(tile, mean, strict=True)] for tile in floor
    )
    labels = np.uint32(CEILING), np.uint32(FLOOR), np.uint32(FLOOR)
    paints = zip((list(ceiling), even, odd), labels, strict=True)
    bright = light.plain(distance)
    above, first, second = (tone(kind, pack_rgb(c, bright), label, distance) for c, label in paints)
    return Rows(distance, above, first, second, words)


def _walls(columns: ImageColumns, across: jax.Array) -> jax.Array:
    """paint[height or 1, width] of the walls, as if they filled the image."""
    panels = columns.panels
    if panels is None:
        return columns.wall
    # Bounded on the wall; other pixels are hidden. The offset is not a constant here.
    bit = rounded(across * panels.scale + panels.offset)
    image = columns.wall
    for plane in range(panels.planes.shape[0]):
        image = jnp.where(test_bit(panels.planes[plane], bit), panels.paint[plane], image)
    return image


def _billboards(layers: Layers, below: jax.Array, image: jax.Array) -> jax.Array:
    """The image with the billboards painted over it, farthest first."""
    for k in reversed(range(layers.scale.shape[0])):
        # Neither factor is a constant here. What is out of range becomes a number past the word.
        bit = rounded(layers.scale[k] * below + layers.offset[k])
        image = jnp.where(test_bit(layers.shape[k], bit), layers.shape_paint[k], image)
        # No detail is outside the shape.
        image = jnp.where(test_bit(layers.detail[k], bit), layers.detail_paint[k], image)
    return image
