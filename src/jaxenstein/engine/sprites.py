"""Billboards: which ones each image column sees, nearest first.

A billboard is 32 columns of 32-bit words, so an image column fetches its words once, and a pixel
shifts and tests a bit. Only the nearest few billboards of a column are kept.
"""

from __future__ import annotations

import functools
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from .._jax.staging import repeat, staged
from ..pytree import PyTreeNode
from .camera import Camera
from .level import WORD, Array
from .raycast import direction
from .scene import Sprites, Theme
from .shade import ImageKind, pack_rgb, tone

# Billboards nearer than this are behind the eye or around it.
NEAREST = 0.05
# Billboards are searched in a loop over blocks of this size, to bound the program.
BLOCK = 8
# Of more pictures than this, what differs between them is fetched.
MOST_SELECTS = 64
_NONE = 0xFFFFFFFF


class Layers(PyTreeNode):
    """The nearest billboards of each column, near to far: K layers, W columns.

    A pixel `y` rows below the horizon shows bit `round(scale * y + offset)` of the planes. Values
    that are equal in all columns have one column.

    Attributes:
        shape: uint32[K, W], words of the shape; 0 where there is no billboard.
        detail: uint32[K, W], words of the detail.
        scale: float32[K, W or 1], bits per pixel.
        offset: float32[K, W or 1], minus one half.
        shape_paint: paint[K, W or 1] of the shape (see `image_columns.ImageColumns`).
        detail_paint: paint[K, W or 1] of the detail.
    """

    shape: jax.Array
    detail: jax.Array
    scale: jax.Array
    offset: jax.Array
    shape_paint: jax.Array
    detail_paint: jax.Array


class Spots(PyTreeNode):
    """Billboards as the eye sees them, in any common shape.

    An image column of slope s sees column `stretch * s + start` of a billboard's 32 columns.

    Attributes:
        stretch: float32, 0 if the billboard is not drawn.
        start: float32, -1 if the billboard is not drawn.
        picture: int32.
    """

    stretch: jax.Array
    start: jax.Array
    picture: jax.Array

    def depth(self, theme: Theme) -> jax.Array:
        """float32: depth in tiles."""
        return self.stretch * _of_picture(theme.sprite_radius, self.picture) / (WORD // 2)


def choose(
    position: jax.Array,
    heading: jax.Array,
    sprites: Sprites,
    theme: Theme,
    camera: Camera,
    layers: int,
) -> Spots:
    """The billboards to draw in each column, [K, W] near to far, ignoring walls.

    Args:
        position: float32[2], the eye.
        heading: float32[], radians.
        sprites: the N billboards.
        theme: their pictures.
        camera: width and field of view.
        layers: how many billboards a column can show, one behind another. If there are no more
            than that, the result is [N, 1], all of them.
    """
    spots = see(position, heading, sprites, theme)
    if sprites.picture.shape[0] <= layers:
        return _sorted(spots, theme)
    return pick(spots, nearest(spots, theme, camera, layers))


def see(position: jax.Array, heading: jax.Array, sprites: Sprites, theme: Theme) -> Spots:
    """All billboards, [N]; the arguments are as in `choose`."""
    return staged(partial(_spot, theme=theme))(position, heading, sprites)


def nearest(spots: Spots, theme: Theme, camera: Camera, layers: int) -> jax.Array:
    """uint32[layers, W]: sort keys of the nearest billboards in each column, in order."""
    return staged(partial(_nearest, theme=theme, camera=camera, layers=layers))(spots)


def pick(spots: Spots, keys: jax.Array) -> Spots:
    """The billboards for keys from `nearest`, [K, W]."""
    return staged(_pick)(spots, keys)


def layers_seen(keys: jax.Array, wall_depth: jax.Array, count: int) -> jax.Array:
    """int32[W]: how many layers of keys from `nearest` may be visible in front of the walls.

    Args:
        keys: uint32[layers, W].
        wall_depth: float32[W].
        count: the number of billboards.
    """
    depth = lax.bitcast_convert_type(wall_depth, jnp.uint32)
    before = (keys & ~_index_mask(count)) <= depth[None]
    layer = np.arange(1, keys.shape[0] + 1, dtype=np.int32)[:, None]
    return functools.reduce(jnp.maximum, jnp.where(before, layer, 0))


def project(
    spots: Spots,
    wall_depth: jax.Array,
    lift: jax.Array | None,
    theme: Theme,
    camera: Camera,
    kind: ImageKind,
) -> Layers:
    """The pixels of the chosen billboards in each column.

    Args:
        spots: the billboards from `choose`.
        wall_depth: float32[W], depth of the wall behind each column.
        lift: `Scene.lift`.
        theme: their pictures.
        camera: width and field of view.
        kind: the kind of image.
    """
    depth = spots.depth(theme)
    drop, radius = (
        _of_picture(table, spots.picture) for table in (theme.sprite_drop, theme.sprite_radius)
    )
    drop = drop if lift is None else drop + lift
    light = theme.light.plain(depth)
    palette = np.asarray(theme.sprite_colours)
    labels = _of_picture(theme.sprite_labels, spots.picture)
    paint = []
    for plane in (0, 1):
        colour = [_of_picture(palette[:, plane, channel], spots.picture) for channel in range(3)]
        paint.append(tone(kind, pack_rgb(colour, light), labels, depth))
    # A separate stage, or some compilers fuse it with the lookup, whose loop is scalar.
    words = staged(partial(_words, theme=theme, camera=camera))(spots, wall_depth)
    art = np.asarray(theme.sprite_art)
    tables = [np.append(art[:, i].reshape(-1), np.uint32(0)) for i in (0, 1)]
    shape, detail = (jnp.asarray(t).at[words].get(mode="promise_in_bounds") for t in tables)
    return Layers(
        shape=shape,
        detail=detail,
        scale=spots.stretch / camera.row_focal,
        offset=(WORD // 2) * (1 - drop / radius) - 0.5,
        shape_paint=paint[0],
        detail_paint=paint[1],
    )


def _words(spots: Spots, wall_depth: jax.Array, *, theme: Theme, camera: Camera) -> jax.Array:
    """int32[K, W]: the word of the art that each column sees; past the end for none."""
    depth = spots.depth(theme)
    across = spots.stretch * jnp.asarray(camera.column_slopes())[None] + spots.start
    seen = (across >= 0) & (across < WORD) & (depth < wall_depth[None])
    texel = jnp.clip(across.astype(jnp.int32), 0, WORD - 1)
    pictures = theme.sprite_art.shape[0]
    # With a single picture, no column needs to look up its picture.
    row = spots.picture if pictures > 1 else jnp.zeros_like(spots.picture)
    return jnp.where(seen, row * WORD + texel, np.int32(pictures * WORD))


def _spot(position: jax.Array, heading: jax.Array, sprites: Sprites, *, theme: Theme) -> Spots:
    """Project N billboards, [N]."""
    cos, sin = direction(heading)
    offset = sprites.position - position[None]
    depth = offset[:, 0] * cos + offset[:, 1] * sin
    side = offset[:, 1] * cos - offset[:, 0] * sin
    drawn = sprites.visible & (depth > NEAREST)
    unit = (WORD // 2) / _of_picture(theme.sprite_radius, sprites.picture)
    return Spots(
        stretch=jnp.where(drawn, depth * unit, 0),
        start=jnp.where(drawn, WORD // 2 - side * unit, -1),
        picture=sprites.picture,
    )


def _of_picture(table: Array, picture: jax.Array) -> jax.Array:
    """table[picture] for a table [s], without a gather where there are few pictures."""
    values = np.asarray(table)
    if len(values) > MOST_SELECTS:
        return jnp.asarray(values).at[picture].get(mode="promise_in_bounds")
    chosen = jnp.full(picture.shape, values[0])
    for i in range(1, len(values)):
        chosen = jnp.where(picture == i, values[i], chosen)
    return chosen


def _sorted(spots: Spots, theme: Theme) -> Spots:
    """All billboards by depth, [N, 1]."""
    depth = spots.depth(theme)
    index = np.arange(depth.shape[0], dtype=np.int32)
    nearer = depth[:, None] < depth[None]
    tied = (depth[:, None] == depth[None]) & (index[:, None] < index[None])
    rank = jnp.sum(nearer | tied, axis=0, dtype=jnp.int32)
    at_rank = rank[None] == index[:, None]

    def reorder(values: jax.Array) -> jax.Array:
        chosen = jnp.where(at_rank, values[None], 0)
        return jnp.sum(chosen, axis=1, keepdims=True, dtype=values.dtype)

    return jax.tree.map(reorder, spots)


def _nearest(spots: Spots, *, theme: Theme, camera: Camera, layers: int) -> jax.Array:
    """uint32[layers, W]: sort keys of the nearest billboards in each column.

    A key has the leading bits of a depth and, below them, the index of the billboard, so that one
    minimum finds both. Billboards whose depths agree to about 1e-5 are ordered by index.
    """
    count = spots.picture.shape[0]
    index = np.arange(count, dtype=np.uint32)
    depth = lax.bitcast_convert_type(spots.depth(theme), jnp.uint32)
    keys = depth & ~_index_mask(count) | index
    blocks = -(-count // BLOCK)
    rest = (0, blocks * BLOCK - count)
    filled = [
        jnp.pad(values, rest, constant_values=filler).reshape(blocks, BLOCK)
        for values, filler in ((spots.stretch, 0), (spots.start, -1), (keys, 0))
    ]
    slopes = jnp.asarray(camera.column_slopes())

    def visit(i: jax.Array, best: Any, constants: Any) -> Any:
        filled, slopes = constants
        stretch, start, key = (values[i] for values in filled)
        near = list(best)
        for j in range(BLOCK):
            across = stretch[j] * slopes + start[j]
            new = jnp.where((across >= 0) & (across < WORD), key[j], np.uint32(_NONE))
            for k in range(layers):
                near[k], new = jnp.minimum(near[k], new), jnp.maximum(near[k], new)
        return tuple(near)

    last = jnp.max(jnp.where(spots.stretch > 0, index.astype(np.int32) + 1, 0))
    none = jnp.full(slopes.shape, _NONE, jnp.uint32)
    return jnp.stack(repeat(visit)(-(-last // BLOCK), (none,) * layers, (filled, slopes)))


def _index_mask(count: int) -> np.uint32:
    return np.uint32((1 << (count - 1).bit_length()) - 1)


def _pick(spots: Spots, keys: jax.Array) -> Spots:
    """The billboards for keys from `_nearest`; where there is none, one that is not drawn."""
    none = keys == np.uint32(_NONE)
    index = jnp.where(none, np.uint32(0), keys & _index_mask(spots.picture.shape[0]))
    chosen = index.astype(jnp.int32)
    picked = jax.tree.map(lambda v: v.at[chosen].get(mode="promise_in_bounds"), spots)
    return picked.replace(
        stretch=jnp.where(none, 0, picked.stretch), start=jnp.where(none, -1, picked.start)
    )
