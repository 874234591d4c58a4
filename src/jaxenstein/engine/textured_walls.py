"""Which column of which picture the image's columns show of walls, and how far away."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from .camera import Camera
from .hits import Ends, Hits
from .raycast import NUDGE, direction, rays
from .textures import Sampling, Textures, entry

# Screens of whole columns round places along a wall to a fraction of a texel.
ROUNDING = 2.0**-14


class WallsSeen(NamedTuple):
    """What the W columns of an image see of walls.

    Attributes:
        material: int32[W], the row of `Textures.walls`.
        depth: float32[W], at the place in a pixel of `Sampling.wall`.
        edge_depth: float32[W], the depth that tells upper and lower edge, and the light.
        texel: int32[W], the column of the picture.
    """

    material: jax.Array
    depth: jax.Array
    edge_depth: jax.Array
    texel: jax.Array


def see_walls(heading: jax.Array, hits: Hits, textures: Textures, camera: Camera) -> WallsSeen:
    """What each column sees of the walls that the rays of `wall_camera` hit."""
    if hits.ends is None:
        return _of_tiles(heading, hits, textures, camera)
    return _of_free_walls(hits, hits.ends, textures, camera)


def _of_tiles(heading: jax.Array, hits: Hits, textures: Textures, camera: Camera) -> WallsSeen:
    walls, places = textures.walls, textures.sampling
    assert hits.side is not None
    assert hits.tile is not None
    material = _material(hits, textures)
    depth, along = hits.depth, hits.along
    if places.screen:
        depth, along = _sampled(heading, hits, camera, places)
    edge_depth = depth
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
            own = camera.at(places.wall)
            edge_depth = _from_end_to_end(heading, hits, depth, ends, own, places.screen)
    texel = _wrapped(texel, textures, material)
    return WallsSeen(material, depth, edge_depth, texel)


def _of_free_walls(hits: Hits, ends: Ends, textures: Textures, camera: Camera) -> WallsSeen:
    walls, places = textures.walls, textures.sampling
    material = _material(hits, textures)
    depth, edge_depth, share = hits.depth, hits.depth, hits.along
    if places.screen:
        slopes, near = camera.at(places.wall).column_slopes(), 1 / hits.depth
        depth, edge_depth = (
            1 / jnp.clip(nearness, near / 2, near * 2)
            for nearness in (ends.nearness(slopes), _nearness_of_edges(ends, camera, places))
        )
        share = ends.share(slopes)
    if walls.length is None:
        length = ends.length() * entry(walls.across, material).astype(jnp.float32)
    else:
        length = entry(walls.length, material).astype(jnp.float32)
    place = share * length
    place = place + ROUNDING if places.screen else place
    texel = jnp.minimum(jnp.floor(place), jnp.ceil(length) - 1).astype(jnp.int32)
    if walls.begin is not None:
        texel = texel + entry(walls.begin, material)
    return WallsSeen(material, depth, edge_depth, _wrapped(texel, textures, material))


def _wrapped(texel: jax.Array, textures: Textures, material: jax.Array) -> jax.Array:
    walls = textures.walls
    return (texel + entry(walls.offset, material)) & (entry(walls.width, material) - 1)


def _nearness_of_edges(ends: Ends, camera: Camera, places: Sampling) -> jax.Array:
    """float32[W]: one over the depth that tells edges and light of walls on a screen.

    It is that of the wall's ends, or of the places where it leaves the view, and goes in equal
    steps through the whole columns between them.
    """
    share, plane = places.screen / camera.width, np.float32(camera.half_plane)
    focal, middle = np.float32(camera.focal * share), np.float32(places.screen / 2)
    column = np.floor((np.arange(camera.width + camera.extra) + 0.5) * share).astype(np.float32)
    steps = []
    for i, (border, outermost) in enumerate(((-plane, 0), (plane, places.screen))):
        side, depth = ends.side[i], ends.depth[i]
        inside = (side >= border * depth) if i == 0 else (side <= border * depth)
        inside = inside & (depth > 0)
        safe = jnp.where(inside, depth, 1)
        first = jnp.floor(middle + focal * side / safe) + (side >= 0).astype(jnp.float32)
        steps.append((
            jnp.where(inside, first, outermost),
            jnp.where(inside, 1 / safe, ends.nearness(float(border))),
        ))  # fmt: skip
    (first, near), (after, far) = steps
    return near + (far - near) * (column - first) / jnp.maximum(after - first, 1)


def wall_camera(camera: Camera, places: Sampling) -> Camera:
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
    found = _towards(hits, rays(heading, wall_camera(camera, places)))
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
    assert hits.side is not None
    return (hits.side == 1) | (hits.side == 2)


def _towards(hits: Hits, ray: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, jax.Array]:
    """The component of each ray perpendicular to its wall, and the one along it."""
    x, y = ray
    return jnp.where(hits.horizontal, y, x), jnp.where(hits.horizontal, x, y)


def _material(hits: Hits, textures: Textures) -> jax.Array:
    """int32[W]: the row of `Textures.walls` of what each ray hit."""
    if textures.of_face is None:
        return entry(textures.of_wall, hits.wall.astype(jnp.int32))
    assert hits.face is not None
    return entry(textures.of_face.reshape(-1), hits.face)
