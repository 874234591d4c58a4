"""Billboards: which of them each image column sees, nearest first.

A billboard is 32 columns of 32-bit words, so an image column fetches its words once and a pixel
shifts and tests a bit. Of the billboards over a column, the nearest few are kept.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jax import lax

from ..pytree import Record, record
from .camera import Camera
from .level import WORD
from .scene import Sprites, Theme
from .shade import ImageKind, brightness, pack_rgb, tone

# Billboards nearer than this are behind the eye or around it.
NEAREST = 0.05
_NONE = 0xFFFFFFFF


@record
class Layers(Record):
    """The nearest billboards over each column, near to far: K layers, W columns.

    A pixel `y` rows below the horizon shows bit `round(scale * y + offset)` of the planes.

    Attributes:
        planes: uint32[2, K, W], words of shape and detail; 0 where there is no billboard.
        scale: float32[K, W], bits a pixel.
        offset: float32[K, W], less one half.
        paint: paint[2, K, W] of shape and detail (see `columns.Columns`).
    """

    planes: jax.Array
    scale: jax.Array
    offset: jax.Array
    paint: jax.Array


def project(
    sprites: Sprites,
    theme: Theme,
    position: jax.Array,
    heading: jax.Array,
    wall_depth: jax.Array,
    *,
    camera: Camera,
    kind: ImageKind,
    layers: int,
) -> Layers:
    """Project billboards onto the columns of an image.

    Args:
        sprites: the billboards, N of them.
        theme: their looks.
        position: float32[2], the eye.
        heading: float32[], radians.
        wall_depth: float32[W], depth of the wall behind each column.
        camera: width and field of view.
        kind: the kind of image.
        layers: how many billboards a column can show, one behind the other.
    """
    count = sprites.look.shape[0]
    slopes = jnp.asarray(camera.column_slopes())
    radius = jnp.asarray(theme.sprite_radius)
    cos, sin = jnp.cos(heading), jnp.sin(heading)
    offset = sprites.position - position[None]
    depth = offset[:, 0] * cos + offset[:, 1] * sin
    side = offset[:, 1] * cos - offset[:, 0] * sin
    own_radius = radius[sprites.look]
    # Place on the billboard from its left edge to its right, as 0 to 32; [N, W].
    across = (slopes[None] * depth[:, None] - side[:, None]) / own_radius[:, None]
    across = (across + 1) * (WORD // 2)
    seen = (across >= 0) & (across < WORD) & (depth[:, None] < wall_depth[None])
    seen = seen & (sprites.visible & (depth > NEAREST))[:, None]
    chosen, present = _nearest(depth, seen, min(layers, count))
    look = _pick(sprites.look, chosen)
    depth = _pick(depth, chosen)
    texel = jnp.clip(_pick_rows(across, chosen), 0, WORD - 1).astype(jnp.int32)
    return _paint(look, depth, texel, present, theme, camera, kind)


def _nearest(depth: jax.Array, seen: jax.Array, layers: int) -> tuple[jax.Array, jax.Array]:
    """int32[K, W] indices of the nearest seen billboards, and bool[K, W] whether there is one.

    Depths are compared by their leading bits with the index packed below, so that one minimum
    finds both; billboards whose depths agree to about 1e-5 are ordered by index.
    """
    count, width = seen.shape
    if count == 1:
        return jnp.zeros((1, width), jnp.int32), seen
    index_bits = (count - 1).bit_length()
    mask = jnp.uint32((1 << index_bits) - 1)
    index = jnp.arange(count, dtype=jnp.uint32)
    keys = (lax.bitcast_convert_type(depth, jnp.uint32) & ~mask) | index
    keys = jnp.where(seen, keys[:, None], jnp.uint32(_NONE))
    found = []
    for _ in range(layers):
        best = lax.reduce(keys, jnp.uint32(_NONE), lax.min, (0,))
        found.append(best)
        keys = jnp.where(keys == best[None], jnp.uint32(_NONE), keys)
    best = jnp.stack(found)
    present = best != jnp.uint32(_NONE)
    return jnp.where(present, (best & mask).astype(jnp.int32), 0), present


def _pick(values: jax.Array, chosen: jax.Array) -> jax.Array:
    """values[chosen], without a gather where there is one value."""
    if values.shape[0] == 1:
        return jnp.broadcast_to(values[0], chosen.shape)
    return values.at[chosen].get(mode="promise_in_bounds")


def _pick_rows(values: jax.Array, chosen: jax.Array) -> jax.Array:
    """values[chosen[k, w], w] for values [N, W]."""
    if values.shape[0] == 1:
        return jnp.broadcast_to(values, chosen.shape)
    return jnp.take_along_axis(values, chosen, axis=0, mode="promise_in_bounds")


def _paint(
    look: jax.Array,
    depth: jax.Array,
    texel: jax.Array,
    present: jax.Array,
    theme: Theme,
    camera: Camera,
    kind: ImageKind,
) -> Layers:
    """Fetch words and colours of the chosen billboards; all arguments [K, W]."""
    art = jnp.asarray(theme.sprite_art)
    drop = _pick(jnp.asarray(theme.sprite_drop), look)
    radius = _pick(jnp.asarray(theme.sprite_radius), look)
    light = brightness(depth)
    palette = jnp.asarray(theme.sprite_colours)
    labels = _pick(jnp.asarray(theme.sprite_labels), look)
    paint = []
    for plane in (0, 1):
        colour = [_pick(palette[:, plane, channel], look) for channel in range(3)]
        paint.append(tone(kind, pack_rgb(colour, light), labels, depth))
    index = look * WORD + texel
    planes = [art[:, i].reshape(-1).at[index].get(mode="promise_in_bounds") for i in (0, 1)]
    return Layers(
        planes=jnp.stack([jnp.where(present, plane, jnp.uint32(0)) for plane in planes]),
        scale=(WORD // 2) * depth / (camera.focal * radius),
        offset=(WORD // 2) * (1 - drop / radius) - 0.5,
        paint=jnp.stack(paint),
    )
