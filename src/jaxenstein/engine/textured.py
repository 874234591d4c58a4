"""Drawing with textures: compute an index into the atlas for each pixel, then fetch one word each.

The fetch is a separate stage. Fused with the arithmetic of the index, it would make all of it
scalar, which takes three times as long.
"""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from .._jax.staging import staged
from ..pytree import PyTreeNode
from .camera import Camera
from .hits import Hits
from .image_columns import drop_of, half_height
from .level import Array
from .pixels import first_row, from_row, rounded, whole
from .raycast import rays
from .scene import Scene, Theme
from .shade import ImageKind, luma
from .textured_sprites import (
    TexturedBoards,
    TexturedLayers,
    brightened,
    fetched,
    mix,
    paint_over,
    project,
)
from .textured_stamps import stamped
from .textured_walls import see_walls
from .textures import Sampling, Textures, entry, shade_of

# A whole, on screens of whole columns.
ONE = 65536


class TexturedColumns(PyTreeNode):
    """The W columns of one image, ready to paint.

    A pixel of a wall `y` rows below the horizon shows texel `round(scale * y + offset)` of its
    column, modulo the height of the picture.

    Attributes:
        half: float32[W], half the height of the wall in pixels.
        drop: float32[W], how far the middle of the wall is below the horizon, or None if it is not.
        base: int32[W], the index of the topmost texel of the column of the wall's picture.
        last: int32[W], the height of that picture minus one.
        scale: float32[W], texels per pixel.
        offset: float32[W], the texel at the horizon, minus one half.
        ray: float32[2, W], the direction (x, y) of the ray on floor and ceiling, scaled to depth 1.
        layers: the billboards, or None if the scene has none.
    """

    half: jax.Array
    drop: jax.Array | None
    base: jax.Array
    last: jax.Array
    scale: jax.Array
    offset: jax.Array
    ray: jax.Array
    layers: TexturedLayers | None


class TexturedRows(PyTreeNode):
    """The values that all floor and ceiling pixels of a row share.

    Attributes:
        ahead: [2] of float32[height, 1], texels along x and y per unit of the ray of a column.
        base: int32[height, 1], the index of the first texel of the picture.
    """

    ahead: tuple[Array, Array]
    base: Array


def textures_of(theme: Theme) -> Textures:
    """The textures of a theme, which must have some."""
    assert theme.textures is not None
    return theme.textures


def sized(theme: Theme) -> Theme:
    """A theme whose billboards are as wide as their textures."""
    return theme.replace(sprite_radius=textures_of(theme).cutouts.half_width)


def prepare(
    heading: jax.Array,
    hits: Hits,
    boards: TexturedBoards | None,
    lift: jax.Array | None = None,
    glare: jax.Array | None = None,
    *,
    theme: Theme,
    camera: Camera,
    kind: ImageKind,
) -> TexturedColumns:
    """Look up what each column shows.

    The arguments are those of `image_columns.prepare`, and `Scene.glare`.
    """
    textures = textures_of(theme)
    walls, places = textures.walls, textures.sampling
    seen = see_walls(heading, hits, textures, camera)
    material = seen.material
    camera = camera.at(places.wall)
    # Pictures have their own seams, so use the light of the middle of a tile.
    light = theme.light.wall(seen.edge_depth, hits.horizontal, jnp.full_like(hits.along, 0.5))
    # A stage, or some compilers fuse the light with the lookups, whose loop is scalar.
    looked = staged(lambda row: [entry(t, row) for t in (walls.height, walls.down, walls.first)])
    height, down, first = looked(material)
    above = jnp.float32(camera.wall - camera.eye) - (0 if lift is None else lift)
    offset = above * down - 0.5
    if walls.row is not None:
        offset = offset + entry(walls.row.astype(np.float32), material)
    half = half_height(seen.edge_depth, camera)
    return TexturedColumns(
        half=half,
        drop=drop_of(half, lift, camera),
        base=brightened(shade_of(light), glare) * textures.size + first + seen.texel * height,
        last=height - 1,
        scale=seen.depth * down / jnp.float32(camera.row_focal),
        offset=offset,
        ray=jnp.stack(rays(heading, camera.at(places.plane))),
        layers=None if boards is None else project(boards, hits.depth, theme, camera),
    )


def paint_rows(
    theme: Theme,
    camera: Camera,
    kind: ImageKind,
    lift: jax.Array | None = None,
    glare: jax.Array | None = None,
) -> TexturedRows:
    """What the rows of floor and ceiling share; on the host, but for a lifted eye or glare."""
    del kind
    textures = textures_of(theme)
    flats, places = textures.flats, textures.sampling
    camera = camera.at(places.plane)
    distance = _distances(camera, lift, places)[:, None]
    lit = camera.at((0.5, places.light_row)).row_distances(lift)[:, None]
    plane = _plane(camera)
    scale = np.asarray(flats.scale, np.float32)[plane]
    shade = brightened(shade_of(theme.light.plain(lit)), glare)
    base = shade * np.int32(textures.size) + flats.first[plane]
    return TexturedRows((distance * scale[..., 0], distance * scale[..., 1]), base)


def _distances(camera: Camera, lift: jax.Array | None, places: Sampling) -> Array:
    """float32[height]: the depth in tiles at which each row shows floor or ceiling."""
    if not places.screen:
        return camera.row_distances(lift)
    # Such screens multiply the height of the eye by a slope in 65536ths.
    below = camera.row_offsets()
    slopes = np.floor(camera.row_focal / np.maximum(np.abs(below), 0.01) * ONE) / ONE
    heights = np.where(below > 0, camera.eye, camera.wall - camera.eye).astype(np.float32)
    heights = heights if lift is None else heights + np.sign(below) * lift
    return heights * slopes.astype(np.float32)


def _plane(camera: Camera) -> np.ndarray:
    """int[height, 1]: 0 where a row shows the ceiling and 1 where it shows the floor."""
    return (camera.row_offsets() > 0).astype(int)[:, None]


def paint(
    columns: TexturedColumns, rows: TexturedRows, scene: Scene, camera: Camera, kind: ImageKind
) -> jax.Array:
    """uint32[height, width + extra]: the index in the atlas of each pixel.

    It is the colour of each pixel if some pictures are mixed with what is behind them.
    """
    del kind
    textures = textures_of(scene.theme)
    top = first_row(textures.cutouts.top, camera.at(textures.sampling.thing), scene.lift)
    stage = partial(_indices, rows=rows, top=top, theme=scene.theme, camera=camera)
    index = staged(stage)(scene.position, columns)
    if textures.blends is None:
        return index
    words = fetched(index, textures.atlas)
    if columns.layers is None:
        return words
    return mix(words, columns.layers, camera.at(textures.sampling.thing), textures)


def _indices(
    position: jax.Array,
    columns: TexturedColumns,
    *,
    rows: TexturedRows,
    top: int,
    theme: Theme,
    camera: Camera,
) -> jax.Array:
    textures = textures_of(theme)
    columns = jax.tree.map(lambda leaf: leaf[..., None, :], columns)
    image = _floor_and_ceiling(position, columns, rows, textures, camera)
    below = _below(camera.at(textures.sampling.wall))
    across = below if columns.drop is None else below - columns.drop
    texel = rounded(below * columns.scale + columns.offset).astype(jnp.int32) & columns.last
    image = jnp.where(jnp.abs(across) < columns.half, columns.base + texel, image)
    if columns.layers is not None:
        below = _below(camera.at(textures.sampling.thing))
        image = from_row(top, partial(paint_over, columns.layers), below, image)
    return image.astype(jnp.uint32)


def _below(camera: Camera) -> jax.Array:
    return jnp.asarray(camera.row_offsets())[:, None]


def _floor_and_ceiling(
    position: jax.Array,
    columns: TexturedColumns,
    rows: TexturedRows,
    textures: Textures,
    camera: Camera,
) -> jax.Array:
    """int32[height, width]: floor and ceiling, as if they filled the image."""
    flats = textures.flats
    plane = _plane(camera.at(textures.sampling.plane))
    width, height = (np.asarray(side)[plane] for side in (flats.width, flats.height))
    texels = []
    for i, side in enumerate((width, height)):
        scale, origin = (np.asarray(t, np.float32)[plane, i] for t in (flats.scale, flats.origin))
        eye = position[i] * scale + (origin - np.float32(0.5))
        place = whole(eye + rows.ahead[i] * columns.ray[i])
        texels.append(place.astype(jnp.int32) & (side - 1))
    return rows.base + texels[0] * height + texels[1]


def colours(image: jax.Array, scene: Scene, camera: Camera, kind: ImageKind) -> jax.Array:
    """uint8[height, width, 3] or, of greys, uint8[height, width]: the image from `paint`."""
    textures = textures_of(scene.theme)
    samples = textures.sampling.samples
    words = fetched(image, textures.atlas) if textures.blends is None else image

    def finish(words: jax.Array) -> jax.Array:
        return _finished(words[:, : samples * camera.width], samples, kind)

    if scene.held is None or textures.stamps is None:
        return finish(words)
    view = camera.halved() if samples == 2 else camera
    # A stage, so that only the pictures' part of the image is written twice.
    return staged(finish)(stamped(words, scene.held, textures, view))


def _finished(words: jax.Array, samples: int, kind: ImageKind) -> jax.Array:
    """Pixels from colours of packed words."""
    if samples == 2:
        left, right = words[:, 0::2], words[:, 1::2]
        # The mean of each channel. The mask keeps the lowest bit of a channel out of the next one.
        words = (left & right) + ((left ^ right) >> 1 & jnp.uint32(0x7F7F7F))
    if kind == "gray":
        return luma(words).astype(jnp.uint8)
    return lax.bitcast_convert_type(words, jnp.uint8)[..., :3]
