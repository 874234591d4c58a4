"""Billboards with textures.

Pictures that are added to what is behind them, or averaged with it, are drawn after the others,
into the colours of the few rows in which they are.
"""

from __future__ import annotations

import functools
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .._jax.batching import where_few
from .._jax.staging import repeat, staged
from ..pytree import PyTreeNode
from .camera import Camera
from .level import WORD
from .pixels import rounded, test_bit
from .scene import Theme
from .shade import ImageKind
from .sprites import Spots, is_before
from .textures import COVER, MEAN, Cutouts, Sampling, Textures, entry, shade_of

# An image with mixed pictures is cut into this many bands of rows.
BANDS = 8


class TexturedBoards(PyTreeNode):
    """What the columns of a billboard share, in any common shape.

    Attributes:
        depth: float32, in tiles; 0 if the billboard is not drawn.
        across: what tells the column of the picture, from `_across`.
        mirrored: bool, whether its columns run from right to left, or None if none do.
        column: int32, the first column of the picture in `Cutouts.opaque`.
        first: int32, its first texel in the atlas.
        height: int32, of the picture in texels.
        scale, offset, blend: as those of `TexturedLayers`.
    """

    depth: jax.Array
    across: tuple[jax.Array, ...]
    mirrored: jax.Array | None
    column: jax.Array
    first: jax.Array
    height: jax.Array
    scale: jax.Array
    offset: jax.Array
    blend: jax.Array | None


class TexturedLayers(PyTreeNode):
    """The nearest billboards over each column, near to far: K layers, W columns.

    A pixel `y` rows below the horizon shows texel `round(scale * y + offset)`.

    Attributes:
        opaque: words of uint32[K, W], bits of the opaque texels; 0 where there is no billboard.
        base: int32[K, W], index of the topmost texel.
        scale: float32[K, W or 1], texels a pixel.
        offset: float32[K, W or 1], less one half.
        blend: int32[K, W or 1], as in `Cutouts`; None if all pictures cover what is behind them.
        height: int32[K, W or 1], of the pictures in texels; likewise.
    """

    opaque: tuple[jax.Array, ...]
    base: jax.Array
    scale: jax.Array
    offset: jax.Array
    blend: jax.Array | None = None
    height: jax.Array | None = None


def dress(
    spots: Spots,
    lift: jax.Array | None,
    glare: jax.Array | None,
    *,
    theme: Theme,
    camera: Camera,
    kind: ImageKind,
) -> TexturedBoards:
    """What the columns of each billboard share; as `sprites.dress`, with `Scene.glare`."""
    del kind
    textures = theme.textures
    assert textures is not None
    cutouts, depth = textures.cutouts, spots.depth(theme)
    camera = camera.at(textures.sampling.thing)
    of = partial(entry, index=spots.picture)
    rate = of((cutouts.height / (cutouts.bottom - cutouts.top)).astype(np.float32))
    top = of(cutouts.top)
    top = top if lift is None else top + lift
    shade = brightened(shade_of(theme.light.plain(depth)), glare)
    shade = jnp.where(of(cutouts.bright), 0, shade)
    return TexturedBoards(
        depth=depth,
        across=_across(spots, cutouts, textures.sampling, camera),
        mirrored=None if cutouts.mirrored is None else of(cutouts.mirrored),
        column=of(cutouts.column),
        first=shade * textures.size + of(cutouts.first),
        height=of(cutouts.height),
        scale=_stepped(depth * rate / jnp.float32(camera.row_focal), textures.sampling, camera),
        offset=-top * rate - 0.5,
        blend=None if cutouts.blend is None else of(cutouts.blend),
    )


def project(
    boards: TexturedBoards, wall_depth: jax.Array, theme: Theme, camera: Camera
) -> TexturedLayers:
    """What the chosen billboards show in each column; as `sprites.project`."""
    assert theme.textures is not None
    # Apart, or some compilers fuse it with the fetching, whose loop is scalar.
    texels = staged(partial(_texels, textures=theme.textures, camera=camera))
    column, base = texels(boards, wall_depth)
    return TexturedLayers(
        opaque=tuple(entry(word, column) for word in theme.textures.cutouts.opaque),
        base=base,
        scale=boards.scale,
        offset=boards.offset,
        blend=boards.blend,
        height=None if boards.blend is None else boards.height,
    )


def _stepped(scale: jax.Array, sampling: Sampling, camera: Camera) -> jax.Array:
    """Texels a pixel from above, as screens of whole columns know them.

    Such screens have the rows of a texel in 65536ths, rounded down.
    """
    if not sampling.screen:
        return scale
    # These screens are 4 to 3.
    share = np.float32(65536 * 0.75 * sampling.screen / camera.height)
    return share / jnp.floor(share / jnp.maximum(scale, np.float32(1e-6)))


def _texels(
    boards: TexturedBoards, wall_depth: jax.Array, *, textures: Textures, camera: Camera
) -> tuple[jax.Array, jax.Array]:
    """int32[K, W] twice: the column of `Cutouts.opaque` and its topmost texel in the atlas."""
    texel, seen = _columns_seen(boards, textures.sampling, camera)
    seen = seen & is_before(boards.depth, wall_depth)
    none = textures.cutouts.opaque.shape[1] - 1
    column = jnp.where(seen, boards.column + texel, none)
    return column, boards.first + texel * boards.height


def brightened(shade: Any, glare: jax.Array | None) -> Any:
    """Shades that are brighter by int32[] of them; None for 0."""
    return shade if glare is None else jnp.maximum(shade - glare, 0)


def _across(
    spots: Spots, cutouts: Cutouts, sampling: Sampling, camera: Camera
) -> tuple[jax.Array, ...]:
    """What tells which column of a billboard's picture a column of the image sees.

    Returns:
        `Spots.stretch`, `Spots.start` and the width of the picture. On screens of whole columns,
        int32: the screen's first column, the one after the last, 65536ths of a column of the
        picture for each of them, and how many columns the picture has.
    """
    of = partial(entry, index=spots.picture)
    width = of(cutouts.width)
    if not sampling.screen:
        return spots.stretch, spots.start, width
    left, right = jnp.zeros_like(width), width
    if cutouts.left is not None and cutouts.right is not None:
        left, right = of(cutouts.left), of(cutouts.right)
    share = sampling.screen / camera.width
    unit = jnp.float32(camera.focal * share) / jnp.maximum(spots.stretch, jnp.float32(1e-6))
    first, after = (
        jnp.floor(
            np.float32(sampling.screen / 2)
            + (side.astype(jnp.float32) * WORD / width.astype(jnp.float32) - spots.start) * unit
        )
        for side in (left, right)
    )
    # Such screens step through a picture by 65536ths of a column, rounded down. Floats give the
    # same whole number as long as a picture has fewer than 512 columns.
    step = (right - left).astype(jnp.float32) * 65536 / jnp.maximum(after - first, 1)
    return (*(v.astype(jnp.int32) for v in (first, after, step)), right - left)


def _columns_seen(
    boards: TexturedBoards, sampling: Sampling, camera: Camera
) -> tuple[jax.Array, jax.Array]:
    """int32[K, W], the column of each picture that an image column sees; bool[K, W], if it does."""
    slopes = camera.at(sampling.thing).column_slopes()
    if not sampling.screen:
        stretch, start, width = boards.across
        across = stretch * jnp.asarray(slopes)[None] + start
        texel = (across * (width.astype(jnp.float32) * (1 / WORD))).astype(jnp.int32)
        return jnp.clip(texel, 0, width - 1), (across >= 0) & (across < WORD)
    share = sampling.screen / camera.width
    column = np.floor((np.arange(slopes.size) + 0.5) * share).astype(np.int32)[None]
    first, after, step, count = boards.across
    texel = jnp.clip((column - first) * step >> 16, 0, count - 1)
    if boards.mirrored is not None:
        texel = jnp.where(boards.mirrored, count - 1 - texel, texel)
    return texel, (first <= column) & (after > column)


def paint_over(layers: TexturedLayers, below: jax.Array, image: jax.Array) -> jax.Array:
    """int32[height, width]: the image with all unmixed layers over it, the farthest first.

    Args:
        layers: the layers, with an axis of rows after the first.
        below: float32[height, 1], rows below the horizon.
        image: int32[height, width], what is behind them.
    """
    for k in reversed(range(layers.scale.shape[0])):
        covers, own = _layer(layers, k, below)
        if layers.blend is not None:
            covers = covers & (layers.blend[k] == COVER)
        image = jnp.where(covers, own, image)
    return image


def _layer(layers: TexturedLayers, k: int, below: jax.Array) -> tuple[jax.Array, jax.Array]:
    """bool[height, width], where a layer is; int32[height, width], what it shows there."""
    # The offset is not a constant here. What is out of range becomes a number past all words.
    texel = rounded(layers.scale[k] * below + layers.offset[k])
    word, *others = (word[k] for word in layers.opaque)
    for i, other in enumerate(others, 1):
        word = jnp.where(texel < np.uint32(i * WORD), word, other)
    if others:
        within = texel < np.uint32(len(layers.opaque) * WORD)
        covers = within & test_bit(word, texel & np.uint32(WORD - 1))
    else:
        covers = test_bit(word, texel)
    return covers, layers.base[k] + texel.astype(jnp.int32)


def mix(words: jax.Array, layers: TexturedLayers, camera: Camera, textures: Textures) -> jax.Array:
    """uint32[height, width]: colours with the mixed pictures of layers, band by band.

    Args:
        words: uint32[height, width], colours with all other layers.
        layers: the layers; of several that are mixed one over another, only the nearest is.
        camera: the camera at the place of `Sampling.thing`.
        textures: the pictures.
    """
    height = words.shape[0]
    start, end = _rows_mixed(layers, camera)
    band = -(-height // BANDS)
    paint = where_few(partial(_mixed, textures=textures))
    offsets = camera.row_offsets()

    def visit(i: jax.Array, words: jax.Array, constants: Any) -> jax.Array:
        start, end, layers = constants
        row = i * band
        needed, place = (start < row + band) & (row < end), jnp.minimum(row, height - band)
        part = jax.lax.dynamic_slice_in_dim(words, place, band)
        rows = (place + jnp.arange(band))[:, None]
        below = jax.lax.dynamic_slice_in_dim(jnp.asarray(offsets), place, band)[:, None]
        # The last band may begin with rows of the one before.
        mixed = jnp.where(needed & (rows >= row), paint(needed, part, below, layers), part)
        return jax.lax.dynamic_update_slice_in_dim(words, mixed, place, 0)

    return repeat(visit)(-(-end // band), words, (start, end, layers))


def _rows_mixed(layers: TexturedLayers, camera: Camera) -> tuple[jax.Array, jax.Array]:
    """int32[] twice: the first row that a mixed picture may touch, and the one after the last."""
    assert layers.blend is not None
    assert layers.height is not None
    there = functools.reduce(jnp.bitwise_or, layers.opaque) != 0
    there = there & (layers.blend != COVER)
    offsets = camera.row_offsets()
    unit = 1 / jnp.maximum(layers.scale, 1e-6)
    top = (-0.5 - layers.offset) * unit - offsets[0]
    bottom = (layers.height.astype(jnp.float32) - layers.offset) * unit - offsets[0]
    # Rows are not at even steps on all screens, but less than one row away from them.
    start = jnp.min(jnp.where(there, jnp.clip(top - 1, 0, len(offsets)), len(offsets)))
    end = jnp.max(jnp.where(there, jnp.clip(bottom + 2, 0, len(offsets)), 0))
    return start.astype(jnp.int32), end.astype(jnp.int32)


def _mixed(
    words: jax.Array, below: jax.Array, layers: TexturedLayers, *, textures: Textures
) -> jax.Array:
    """uint32[rows, width]: colours with the mixed pictures."""
    assert textures.blends is not None
    # Fetches are stages of their own, as that of the image.
    index, cut = staged(_over)(below, layers)
    mixed = staged(_sums)(words, fetched(index, textures.atlas), cut)
    return jnp.where(index > 0, fetched(mixed, textures.blends), words)


def _over(below: jax.Array, layers: TexturedLayers) -> tuple[jax.Array, jax.Array]:
    """uint32[rows, width], twice: the nearest mixed picture's index; the bits to cut of a sum."""
    layers = jax.tree.map(lambda leaf: leaf[..., None, :], layers)
    assert layers.blend is not None
    shape = len(below), layers.base.shape[-1]
    index, cut = jnp.zeros(shape, jnp.int32), jnp.zeros(shape, jnp.uint32)
    for k in reversed(range(layers.scale.shape[0])):
        covers, own = _layer(layers, k, below)
        index = jnp.where(covers, jnp.where(layers.blend[k] == COVER, 0, own), index)
        # Three bits, and four if half the sum is meant.
        cut = jnp.where(covers, 3 + (layers.blend[k] == MEAN).astype(jnp.uint32), cut)
    return index.astype(jnp.uint32), cut


def _sums(words: jax.Array, colours: jax.Array, cut: jax.Array) -> jax.Array:
    """uint32[rows, width]: the entry of `Textures.blends` for a sum of two colours."""
    mixed = jnp.zeros(words.shape, jnp.uint32)
    for channel in (0, 8, 16):
        both = (words >> channel & 255) + (colours >> channel & 255)
        mixed = (mixed << 5) | jnp.minimum(both >> cut, 31)
    return mixed


def fetched(index: jax.Array, atlas: np.ndarray) -> jax.Array:
    """uint32[height, width]: the texels at uint32[height, width].

    The indices are unsigned, because JAX checks signed ones for values that count from the end.
    """
    return staged(lambda index: jnp.asarray(atlas).at[index].get(mode="promise_in_bounds"))(index)
