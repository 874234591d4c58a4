"""Pictures that lie over an image with textures, such as a weapon in the player's hands.

They are layers of columns, as billboards, in the part of the image in which they can be.
"""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from .._jax.staging import staged
from .camera import Camera
from .scene import Held
from .textured_sprites import TexturedLayers, fetched, paint_over
from .textures import Stamps, Textures, entry

# The screen on which places of `Stamps` are.
STAMP_WIDTH, STAMP_HEIGHT = 320, 200


def stamped(words: jax.Array, held: Held, textures: Textures, camera: Camera) -> jax.Array:
    """uint32[height, width]: colours with pictures over them."""
    assert textures.stamps is not None
    rows, columns = _block(textures.stamps, camera)
    layers = _stamps(held, columns, textures, camera)
    below = jnp.asarray(camera.at(textures.sampling.thing).row_offsets()[rows])
    index = staged(_stamped)(below, layers)
    block = jnp.where(index > 0, fetched(index, textures.atlas), words[rows, columns])
    return words.at[rows, columns].set(block)


def _stamped(below: jax.Array, layers: TexturedLayers) -> jax.Array:
    """uint32[rows, columns]: what pictures show in the block, 0 where there are none."""
    layers = jax.tree.map(lambda leaf: leaf[..., None, :], layers)
    nothing = jnp.zeros((len(below), layers.base.shape[-1]), jnp.int32)
    return paint_over(layers, below[:, None], nothing).astype(jnp.uint32)


def _block(stamps: Stamps, camera: Camera) -> tuple[slice, slice]:
    """The rows and columns of an image that stamps may cover."""
    aside, least, most = stamps.sway
    left = int((-stamps.left).min()) - aside
    right = int((stamps.width - stamps.left).max()) + aside
    top = int((-stamps.top).min()) + least
    bottom = int((stamps.height - stamps.top).max()) + most
    across, along = camera.width / STAMP_WIDTH, camera.height / STAMP_HEIGHT
    columns = slice(max(0, int(left * across) - 1), min(camera.width, int(right * across) + 2))
    return slice(max(0, int(top * along) - 1), min(camera.height, int(bottom * along) + 2)), columns


def _stamps(held: Held, columns: slice, textures: Textures, camera: Camera) -> TexturedLayers:
    """The columns of the pictures over an image."""
    stamps = textures.stamps
    assert stamps is not None
    column, base, offset = staged(
        partial(_stamp_columns, columns=columns, textures=textures, camera=camera)
    )(held)
    return TexturedLayers(
        opaque=tuple(entry(word, column) for word in stamps.opaque),
        base=base,
        scale=jnp.full(offset.shape, np.float32(STAMP_HEIGHT / camera.height)),
        offset=offset,
    )


def _stamp_columns(
    held: Held, *, columns: slice, textures: Textures, camera: Camera
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """int32[K, columns] twice, as `_texels`; float32[K, 1], `TexturedLayers.offset`."""
    stamps = textures.stamps
    assert stamps is not None
    picture, place = held.picture[:, None], held.place[:, :, None]
    screen = textures.sampling.screen or camera.width
    column = np.floor((np.arange(camera.width) + 0.5) * (screen / camera.width))[None, columns]
    scale, middle = np.float32(screen / STAMP_WIDTH), np.float32(screen / 2)
    side = place[:, 0] - entry(stamps.left, picture).astype(jnp.float32) - STAMP_WIDTH // 2
    width = entry(stamps.width, picture)
    first = jnp.floor(middle + side * scale)
    after = jnp.floor(middle + (side + width.astype(jnp.float32)) * scale)
    texel = jnp.floor((column.astype(np.float32) - first) / scale).astype(jnp.int32)
    seen = (column >= first) & (column < after) & held.shown[:, None]
    texel = jnp.clip(texel, 0, width - 1)
    none = stamps.opaque.shape[1] - 1
    top = entry(stamps.top, picture).astype(jnp.float32) - place[:, 1]
    return (
        jnp.where(seen, entry(stamps.column, picture) + texel, none),
        entry(stamps.first, picture) + texel * entry(stamps.height, picture),
        top + (STAMP_HEIGHT / 2 - 0.5),
    )
