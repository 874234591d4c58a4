"""What the pixels of an image column have in common."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from ..pytree import PyTreeNode
from .camera import Camera
from .level import WORD
from .raycast import Hits, rays
from .scene import Theme
from .shade import ImageKind, pack_rgb, tone
from .sprites import Layers, Spots, project

# A panel's shadow plane has the wall's colour times this.
PANEL_SHADOW = 0.45


class ImageColumns(PyTreeNode):
    """The columns of one image, ready to paint; W of them.

    Paints are what ends up in the image: packed colours, grey values, labels (uint32) or depths
    (float32).

    Attributes:
        half: float32[W], half the height of the wall in pixels.
        drop: float32[W], how far its middle is below the horizon, or None if it is not.
        wall: paint[W].
        ray: float32[2, W], the ray's direction (x, y) on the map, scaled to depth one.
        panels: the panels on the walls, or None if no wall of the theme has one.
        layers: the billboards, or None if the scene has none.
    """

    half: jax.Array
    drop: jax.Array | None
    wall: jax.Array
    ray: jax.Array
    panels: Panels | None
    layers: Layers | None


class Panels(PyTreeNode):
    """Panels: shadows and accents on a wall.

    Attributes:
        planes: uint32[2, W], words of shadow and accent, greatest bit on top.
        paint: paint[2, W].
    """

    planes: jax.Array
    paint: jax.Array


def prepare(
    heading: jax.Array,
    hits: Hits,
    spots: Spots | None,
    *,
    theme: Theme,
    camera: Camera,
    kind: ImageKind,
) -> ImageColumns:
    """Look up what each column shows.

    Args:
        heading: float32[], radians.
        hits: what the rays hit.
        spots: the billboards to draw, or None.
        theme: how everything looks.
        camera: size and field of view of the image.
        kind: the kind of image.
    """
    light = theme.light.wall(hits.depth, hits.horizontal, hits.along)
    index = hits.wall.astype(jnp.int32)
    table = jnp.asarray(theme.wall_colours)
    colour = [table[:, i].at[index].get(mode="promise_in_bounds") for i in range(3)]
    half = jnp.float32(0.5 * camera.wall * camera.row_focal) / jnp.maximum(hits.depth, 1e-6)
    return ImageColumns(
        half=half,
        drop=half * jnp.float32(camera.wall_drop) if camera.wall_drop else None,
        wall=tone(kind, pack_rgb(colour, light), hits.wall, hits.depth),
        ray=jnp.stack(rays(heading, camera)),
        panels=_panels(index, hits, colour, light, theme, kind),
        layers=None if spots is None else project(spots, hits.depth, theme, camera, kind),
    )


def _panels(
    index: jax.Array,
    hits: Hits,
    colour: list[jax.Array],
    light: jax.Array,
    theme: Theme,
    kind: ImageKind,
) -> Panels | None:
    if kind in ("depth", "labels") or not np.any(theme.wall_panels):
        return None
    panel = jnp.asarray(theme.wall_panels).at[index].get(mode="promise_in_bounds")
    texel = jnp.minimum((hits.along * WORD).astype(jnp.int32), WORD - 1)
    art = jnp.asarray(theme.panels)
    planes = [art[:, i].at[panel, texel].get(mode="promise_in_bounds") for i in (0, 1)]
    accent = [jnp.asarray(theme.panel_accent)[i] for i in range(3)]
    words = pack_rgb(colour, light * PANEL_SHADOW), pack_rgb(accent, light)
    paint = [tone(kind, word, hits.wall, hits.depth) for word in words]
    return Panels(planes=jnp.stack(planes), paint=jnp.stack(paint))
