"""Drawing with textures: compute an index into the atlas for each pixel, then fetch one word each.

The fetch is a separate stage. Fused with the arithmetic of the index, it would make all of it
scalar, which takes three times as long.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from .._jax.staging import staged
from ..pytree import PyTreeNode
from .camera import Camera
from .image_columns import drop_of, half_height
from .level import WORD, Array
from .pixels import rounded, test_bit, whole
from .raycast import NUDGE, Hits, direction, rays
from .scene import Scene, Theme
from .shade import ImageKind, luma
from .sprites import Spots
from .textures import Cutouts, Sampling, Textures, entry, shade_of

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


class TexturedLayers(PyTreeNode):
    """The nearest billboards over each column, near to far: K layers, W columns.

    A pixel `y` rows below the horizon shows texel `round(scale * y + offset)`.

    Attributes:
        opaque: uint32[words, K, W], bits of the opaque texels; 0 where there is no billboard.
        base: int32[K, W], the index of the topmost texel.
        scale: float32[K, W or 1], texels per pixel.
        offset: float32[K, W or 1], the texel at the horizon, minus one half.
    """

    opaque: jax.Array
    base: jax.Array
    scale: jax.Array
    offset: jax.Array


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
    spots: Spots | None,
    lift: jax.Array | None = None,
    *,
    theme: Theme,
    camera: Camera,
    kind: ImageKind,
) -> TexturedColumns:
    """Look up what each column shows; for the arguments, see `image_columns.prepare`."""
    textures = textures_of(theme)
    walls, places = textures.walls, textures.sampling
    assert hits.side is not None
    material = _material(hits, textures)
    depth, along = hits.depth, hits.along
    if places.screen:
        depth, along = _sampled(heading, hits, camera, places)
    edge_depth, camera = depth, camera.at(places.wall)
    across = entry(walls.across, material)
    # Texel columns run from left to right in the image, over all tiles of a wall.
    column, row = hits.tile[:, 0], hits.tile[:, 1]
    tile = jnp.where(hits.side < 2, row, column)
    tile = jnp.where(_mirrored(hits), -1 - tile, tile)
    within = along * across.astype(jnp.float32)
    texel = tile * across + (jnp.floor(within) if places.screen else within).astype(jnp.int32)
    if walls.begin is not None and walls.length is not None:
        begin, length = entry(walls.begin, material), entry(walls.length, material)
        texel = jnp.clip(texel, begin, begin + length - 1)
        if places.screen:
            left = (begin - tile * across).astype(jnp.float32) - within
            ends = [
                end / across.astype(jnp.float32)
                for end in (left, left + length.astype(jnp.float32))
            ]
            edge_depth = _from_end_to_end(heading, hits, depth, ends, camera, places.screen)
    texel = (texel + entry(walls.offset, material)) & (entry(walls.width, material) - 1)
    # Pictures have their own seams, so use the light of the middle of a tile.
    light = theme.light.wall(edge_depth, hits.horizontal, jnp.full_like(hits.along, 0.5))
    height = entry(walls.height, material)
    down = entry(walls.down, material)
    above = jnp.float32(camera.wall - camera.eye) - (0 if lift is None else lift)
    half = half_height(edge_depth, camera)
    return TexturedColumns(
        half=half,
        drop=drop_of(half, lift, camera),
        base=shade_of(light) * textures.size + entry(walls.first, material) + texel * height,
        last=height - 1,
        scale=depth * down / jnp.float32(camera.row_focal),
        offset=above * down - 0.5,
        ray=jnp.stack(rays(heading, camera.at(places.plane))),
        layers=None if spots is None else project(spots, hits.depth, lift, theme, camera, kind),
    )


def of_walls(camera: Camera, places: Sampling) -> Camera:
    """The camera whose rays find the wall of each column.

    On a screen of whole columns, a wall that begins within a column covers it in the left half of
    the image, and not in the right half.
    """
    camera = camera.at(places.wall)
    if not places.screen:
        return camera
    return dataclasses.replace(camera, shift=camera.width / places.screen)


def _sampled(
    heading: jax.Array, hits: Hits, camera: Camera, places: Sampling
) -> tuple[jax.Array, jax.Array]:
    """Where the ray at `Sampling.wall` meets the plane of the wall of each column.

    Returns:
        float32[W] each: the depth, and the counterpart of `Hits.along`, which can be beyond the
        tile.
    """
    found = _towards(hits, rays(heading, of_walls(camera, places)))
    own = _towards(hits, rays(heading, camera.at(places.wall)))
    depth = hits.depth / jnp.clip(own[0] / found[0], 0.5, 2)
    aside = depth * own[1] - hits.depth * found[1] - NUDGE * jnp.sign(found[1])
    # Sines from a table make rays that are a little too short. Depth is along them, in their scale.
    scale = jnp.sum(jnp.square(jnp.stack(direction(heading))))
    return depth * scale, hits.along + jnp.where(_mirrored(hits), -aside, aside)


def _from_end_to_end(
    heading: jax.Array,
    hits: Hits,
    depth: jax.Array,
    ends: Sequence[jax.Array],
    camera: Camera,
    screen: int,
) -> jax.Array:
    """float32[W]: the depth that tells upper and lower edge and the light of each column.

    On a screen of whole columns, these go straight from the first column of a wall to its last one,
    although its ends are within columns.

    Args:
        heading: as in `prepare`.
        hits: as in `prepare`.
        depth: float32[W], of the place where a column samples its wall.
        ends: float32[W], tiles from that place rightwards to the left end of the wall, and to its
            right end.
        camera: with the places of walls.
        screen: columns of the screen.
    """
    plane, half = np.float32(camera.half_plane), np.float32(screen / 2)
    scale = half / plane
    slopes = jnp.asarray(camera.column_slopes())
    cos, sin = direction(heading)
    (through, along), (through_aside, along_aside) = (
        _towards(hits, way) for way in ((cos, sin), (-sin, cos))
    )
    sign = jnp.where(_mirrored(hits), jnp.float32(-1), jnp.float32(1))
    exact, whole = [], []
    for end, border in zip(ends, (-plane, plane), strict=True):
        aside = depth * slopes + end * sign * along_aside
        ahead = depth + end * sign * along
        seen = aside >= -plane * ahead if border < 0 else aside <= plane * ahead
        slope = jnp.where(seen, aside / jnp.maximum(ahead, jnp.float32(1e-6)), border)
        column = jnp.floor(slope * scale + half) + (slope >= 0).astype(jnp.float32)
        exact.append(slope)
        whole.append(jnp.minimum(column, 2 * half))
    share = slopes * scale + half - whole[0]
    share = share / jnp.maximum(whole[1] - whole[0], 1)
    straight = exact[0] + (exact[1] - exact[0]) * share
    nearer = (through + straight * through_aside) / (through + slopes * through_aside)
    return depth / jnp.clip(nearer, 0.5, 2)


def _mirrored(hits: Hits) -> jax.Array:
    """bool[W]: whether x or y falls from left to right on the wall."""
    return (hits.side == 1) | (hits.side == 2)


def _towards(hits: Hits, ray: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, jax.Array]:
    """The component of each ray perpendicular to its wall, and the one along it."""
    x, y = ray
    return jnp.where(hits.horizontal, y, x), jnp.where(hits.horizontal, x, y)


def _material(hits: Hits, textures: Textures) -> jax.Array:
    """int32[W]: the row of `Textures.walls` that each ray hit."""
    if textures.of_face is None:
        return entry(textures.of_wall, hits.wall.astype(jnp.int32))
    assert hits.face is not None
    return entry(textures.of_face.reshape(-1), hits.face)


def project(
    spots: Spots,
    wall_depth: jax.Array,
    lift: jax.Array | None,
    theme: Theme,
    camera: Camera,
    kind: ImageKind,
) -> TexturedLayers:
    """The texels of the chosen billboards in each column, like `sprites.project`."""
    del kind
    textures = textures_of(theme)
    cutouts = textures.cutouts
    camera = camera.at(textures.sampling.thing)
    # A separate stage: some compilers would fuse it with the fetch, whose loop is scalar.
    texels = staged(partial(_texels, theme=theme, camera=camera))
    column, base = texels(spots, wall_depth)
    opaque = [jnp.asarray(w).at[column].get(mode="promise_in_bounds") for w in cutouts.opaque]
    rate = cutouts.height / (cutouts.bottom - cutouts.top)
    rate = entry(rate.astype(np.float32), spots.picture)
    top = entry(cutouts.top, spots.picture)
    top = top if lift is None else top + lift
    return TexturedLayers(
        opaque=jnp.stack(opaque),
        base=base,
        scale=spots.depth(theme) * rate / jnp.float32(camera.row_focal),
        offset=-top * rate - 0.5,
    )


def _texels(
    spots: Spots, wall_depth: jax.Array, *, theme: Theme, camera: Camera
) -> tuple[jax.Array, jax.Array]:
    """int32[K, W] each: the column of `Cutouts.opaque`, and its topmost texel in the atlas."""
    textures = textures_of(theme)
    cutouts, depth = textures.cutouts, spots.depth(theme)
    width = entry(cutouts.width, spots.picture)
    texel, seen = _columns_seen(spots, width, cutouts, textures.sampling, camera)
    seen = seen & (depth < wall_depth[None])
    none = cutouts.opaque.shape[1] - 1
    column = jnp.where(seen, entry(cutouts.column, spots.picture) + texel, none)
    shade = shade_of(theme.light.plain(depth))
    shade = jnp.where(entry(cutouts.bright, spots.picture), 0, shade)
    first = shade * textures.size + entry(cutouts.first, spots.picture)
    return column, first + texel * entry(cutouts.height, spots.picture)


def _columns_seen(
    spots: Spots, width: jax.Array, cutouts: Cutouts, sampling: Sampling, camera: Camera
) -> tuple[jax.Array, jax.Array]:
    """The picture column int32[K, W] in each image column, and bool[K, W]: whether there is one."""
    slopes = camera.column_slopes()
    if not sampling.screen:
        across = spots.stretch * jnp.asarray(slopes)[None] + spots.start
        texel = (across * (width.astype(jnp.float32) * (1 / WORD))).astype(jnp.int32)
        return jnp.clip(texel, 0, width - 1), (across >= 0) & (across < WORD)
    share = sampling.screen / camera.width
    column = np.floor((np.arange(slopes.size) + 0.5) * share).astype(np.int32)[None]
    left, right = jnp.zeros_like(width), width
    if cutouts.left is not None and cutouts.right is not None:
        left, right = (entry(side, spots.picture) for side in (cutouts.left, cutouts.right))
    unit = jnp.float32(camera.focal * share) / jnp.maximum(spots.stretch, jnp.float32(1e-6))
    first, after = (
        jnp.floor(
            np.float32(sampling.screen / 2)
            + (side.astype(jnp.float32) * WORD / width.astype(jnp.float32) - spots.start) * unit
        )
        for side in (left, right)
    )
    # Such a screen steps through a picture in 65536ths of a column, rounded down. Floats give the
    # same integers if a picture has fewer than 512 columns.
    step = (right - left).astype(jnp.float32) * 65536 / jnp.maximum(after - first, 1)
    first, after = first.astype(jnp.int32), after.astype(jnp.int32)
    texel = left + ((column - first) * step.astype(jnp.int32) >> 16)
    seen = (first <= column) & (after > column) & (spots.stretch > 0)
    return jnp.clip(texel, left, right - 1), seen


def paint_rows(
    theme: Theme, camera: Camera, kind: ImageKind, lift: jax.Array | None = None
) -> TexturedRows:
    """The values that the pixels of each row share; on the host unless the eye can be lifted."""
    del kind
    textures = textures_of(theme)
    flats, places = textures.flats, textures.sampling
    camera = camera.at(places.plane)
    distance = _distances(camera, lift, places)[:, None]
    lit = camera.at((0.5, places.light_row)).row_distances(lift)[:, None]
    plane = _plane(camera)
    scale = np.asarray(flats.scale, np.float32)[plane]
    base = shade_of(theme.light.plain(lit)) * np.int32(textures.size) + flats.first[plane]
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
    """int32[height, width + extra]: the atlas index of each pixel."""
    del kind
    stage = partial(_indices, rows=rows, theme=scene.theme, camera=camera)
    return staged(stage)(scene.position, columns)


def _indices(
    position: jax.Array,
    columns: TexturedColumns,
    *,
    rows: TexturedRows,
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
    if columns.layers is None:
        return image
    return _billboards(columns.layers, _below(camera.at(textures.sampling.thing)), image)


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


def _billboards(layers: TexturedLayers, below: jax.Array, image: jax.Array) -> jax.Array:
    """The image with the billboards painted on it, from far to near."""
    for k in reversed(range(layers.scale.shape[0])):
        texel = whole(layers.scale[k] * below + layers.offset[k])
        # A texel of another word is beyond the end of this word, where bits count as 0.
        words = enumerate(layers.opaque)
        there = [test_bit(word[k], texel - np.uint32(i * WORD)) for i, word in words]
        covers = functools.reduce(jnp.logical_or, there)
        image = jnp.where(covers, layers.base[k] + texel.astype(jnp.int32), image)
    return image


def colours(index: jax.Array, theme: Theme, camera: Camera, kind: ImageKind) -> jax.Array:
    """The image for these indices: uint8[height, width, 3], or grey uint8[height, width]."""
    textures = textures_of(theme)
    samples = textures.sampling.samples
    words = staged(partial(_fetched, atlas=textures.atlas))(index)[:, : samples * camera.width]
    if samples == 2:
        left, right = words[:, 0::2], words[:, 1::2]
        # The mean of each channel. The mask keeps the lowest bit of a channel out of the next one.
        words = (left & right) + ((left ^ right) >> 1 & jnp.uint32(0x7F7F7F))
    if kind == "gray":
        return luma(words).astype(jnp.uint8)
    return lax.bitcast_convert_type(words, jnp.uint8)[..., :3]


def _fetched(index: jax.Array, *, atlas: np.ndarray) -> Any:
    # Unsigned indices need no check for negative values.
    return jnp.asarray(atlas).at[index.astype(jnp.uint32)].get(mode="promise_in_bounds")
