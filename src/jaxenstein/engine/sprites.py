"""Billboards: which ones each image column sees, nearest first.

A billboard is 32 columns of 32-bit words, so an image column fetches its words once, and a pixel
shifts and tests a bit. Only the nearest few billboards of a column are kept.

1. `see` projects all billboards.
2. `nearest` finds the nearest ones of each column, and `pick` fetches what is known of them.
3. `dress` computes what the columns of a billboard share: for all billboards before step 2 if they
   are few, else for those of each column.
4. `project` adds what differs between columns.
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
# Billboards are searched in a loop over blocks of this size, to bound the program. Of more than one
# block, what is known of a billboard is fetched.
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
        detail: uint32[K, W], words of the detail, none of which is outside the shape.
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


class Boards(PyTreeNode):
    """What the columns of a billboard share, in any common shape.

    Attributes:
        stretch, start, picture: as those of `Spots`.
        depth: float32, in tiles; 0 if the billboard is not drawn.
        offset, shape_paint, detail_paint: as those of `Layers`.
    """

    stretch: jax.Array
    start: jax.Array
    picture: jax.Array
    depth: jax.Array
    offset: jax.Array
    shape_paint: jax.Array
    detail_paint: jax.Array


def see(position: jax.Array, heading: jax.Array, sprites: Sprites, theme: Theme) -> Spots:
    """The N billboards as the eye sees them, [N].

    Args:
        position: float32[2], the eye.
        heading: as `Scene.heading`.
        sprites: the billboards.
        theme: their pictures.
    """
    return staged(partial(_spot, theme=theme))(position, heading, sprites)


def by_depth(spots: Spots, theme: Theme) -> Spots:
    """All billboards from near to far, [N, 1]."""
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


def nearest(spots: Spots, theme: Theme, camera: Camera, layers: int) -> jax.Array:
    """uint32[layers, W]: sort keys of the nearest billboards in each column, in order.

    Walls are ignored.
    """
    return staged(partial(_nearest, theme=theme, camera=camera, layers=layers))(spots)


def pick(things: Any, keys: jax.Array) -> Any:
    """What is known of the billboards of keys from `nearest`.

    Args:
        things: a pytree of arrays [N].
        keys: uint32[K, W].

    Returns:
        The same of arrays [K, W], zeros where there is no billboard.
    """
    return staged(_pick)(things, keys)


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


def dress(
    spots: Spots, lift: jax.Array | None, *, theme: Theme, camera: Camera, kind: ImageKind
) -> Boards:
    """What the columns of each billboard share.

    Args:
        spots: the billboards.
        lift: `Scene.lift`.
        theme: their pictures.
        camera: size and field of view of the image.
        kind: the kind of image.
    """
    del camera
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
    offset = (WORD // 2) * (1 - drop / radius) - 0.5
    return Boards(spots.stretch, spots.start, spots.picture, depth, offset, *paint)


def project(boards: Boards, wall_depth: jax.Array, theme: Theme, camera: Camera) -> Layers:
    """The pixels of the billboards in each column.

    Args:
        boards: [K, W or 1], near to far.
        wall_depth: float32[W], depth of the wall behind each column.
        theme: their pictures.
        camera: size and field of view of the image.
    """
    # A separate stage, or some compilers fuse it with the lookup, whose loop is scalar.
    words = staged(partial(_words, theme=theme, camera=camera))(boards, wall_depth)
    shapes, details = np.moveaxis(np.asarray(theme.sprite_art), 1, 0)
    tables = [np.append(art, np.uint32(0)) for art in (shapes, shapes & details)]
    shape, detail = (jnp.asarray(t).at[words].get(mode="promise_in_bounds") for t in tables)
    return Layers(
        shape=shape,
        detail=detail,
        scale=boards.stretch / camera.row_focal,
        offset=boards.offset,
        shape_paint=boards.shape_paint,
        detail_paint=boards.detail_paint,
    )


def _words(boards: Boards, wall_depth: jax.Array, *, theme: Theme, camera: Camera) -> jax.Array:
    """int32[K, W]: the word of the art that each column sees; past the end for none."""
    across = boards.stretch * jnp.asarray(camera.column_slopes())[None] + boards.start
    seen = (across >= 0) & (across < WORD) & is_before(boards.depth, wall_depth)
    texel = jnp.clip(across.astype(jnp.int32), 0, WORD - 1)
    pictures = theme.sprite_art.shape[0]
    # With a single picture, no column needs to look up its picture.
    row = boards.picture if pictures > 1 else jnp.zeros_like(boards.picture)
    return jnp.where(seen, row * WORD + texel, np.int32(pictures * WORD))


def is_before(depth: jax.Array, wall_depth: jax.Array) -> jax.Array:
    """bool[K, W]: whether billboards at depths [K, W or 1] are drawn and before the walls, [W]."""
    return (depth > 0) & (depth < wall_depth[None])


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

    none = (jnp.full(slopes.shape, _NONE, jnp.uint32),) * layers
    if blocks == 1:
        return jnp.stack(visit(jnp.int32(0), none, (filled, slopes)))
    last = jnp.max(jnp.where(spots.stretch > 0, index.astype(np.int32) + 1, 0))
    return jnp.stack(repeat(visit)(-(-last // BLOCK), none, (filled, slopes)))


def _index_mask(count: int) -> np.uint32:
    return np.uint32((1 << (count - 1).bit_length()) - 1)


def _pick(things: Any, keys: jax.Array) -> Any:
    count = jax.tree.leaves(things)[0].shape[0]
    none = keys == np.uint32(_NONE)
    index = (keys & _index_mask(count)).astype(jnp.int32)
    if count > BLOCK:
        index = jnp.where(none, 0, index)
        picked = jax.tree.map(lambda v: v.at[index].get(mode="promise_in_bounds"), things)
        return jax.tree.map(lambda v: jnp.where(none, jnp.zeros_like(v), v), picked)
    index = jnp.where(none, -1, index)

    def one(values: jax.Array) -> jax.Array:
        chosen = jnp.zeros(index.shape, values.dtype)
        for i in range(count):
            chosen = jnp.where(index == i, values[i], chosen)
        return chosen

    return jax.tree.map(one, things)
