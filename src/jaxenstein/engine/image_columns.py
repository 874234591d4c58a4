"""The values that all pixels of an image column share."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..pytree import PyTreeNode
from .camera import Camera
from .hits import Hits
from .level import WORD, Array
from .raycast import rays
from .scene import Theme
from .shade import ImageKind, pack_rgb, tone
from .sprites import Boards, Layers, project

# The colour of a panel's shadow plane is the wall's colour times this.
PANEL_SHADOW = 0.45


class ImageColumns(PyTreeNode):
    """The W columns of one image, ready to paint.

    Paints are the values in the image: packed colours, grey values or labels (uint32), or depths
    (float32).

    Attributes:
        half: float32[W], half the height of the wall in pixels.
        drop: float32[W], how far the wall's middle is below the horizon, or None if it is not.
        wall: paint[W].
        ray: float32[2, W], the direction (x, y) of the ray on the map, scaled to depth 1.
        panels: the panels on the walls, or None if no wall of the theme has a panel.
        layers: the billboards, or None if the scene has none.
    """

    half: jax.Array
    drop: jax.Array | None
    wall: jax.Array
    ray: jax.Array
    panels: Panels | None
    layers: Layers | None


class Panels(PyTreeNode):
    """Shadows and accents on the walls.

    Attributes:
        scale: float32[W], bits per pixel.
        offset: float32[W], the bit at the middle of the wall, minus one half.
        planes: uint32[P, W], words of shadow and, if used, accent; the top is the highest bit.
        paint: paint[P, W].
    """

    scale: jax.Array
    offset: jax.Array
    planes: jax.Array
    paint: jax.Array


def prepare(
    heading: jax.Array,
    hits: Hits,
    boards: Boards | None,
    lift: jax.Array | None = None,
    *,
    theme: Theme,
    camera: Camera,
    kind: ImageKind,
) -> ImageColumns:
    """Look up what each column shows.

    Args:
        heading: as `Scene.heading`.
        hits: the walls that the rays hit.
        boards: the billboards to draw, or None.
        lift: `Scene.lift`.
        theme: the colours and pictures.
        camera: size and field of view of the image.
        kind: the kind of image.
    """
    light = theme.light.wall(hits.depth, hits.horizontal, hits.along)
    index = hits.wall.astype(jnp.int32)
    table = jnp.asarray(theme.wall_colours)
    colour = [table[:, i].at[index].get(mode="promise_in_bounds") for i in range(3)]
    half = half_height(hits.depth, camera)
    return ImageColumns(
        half=half,
        drop=drop_of(half, lift, camera),
        wall=tone(kind, pack_rgb(colour, light), hits.wall, hits.depth),
        ray=jnp.stack(rays(heading, camera)),
        panels=_panels(index, hits, half, colour, light, theme, kind),
        layers=None if boards is None else project(boards, hits.depth, theme, camera),
    )


def half_height(depth: jax.Array, camera: Camera) -> jax.Array:
    """float32[W]: half the height in pixels of walls at a depth."""
    return jnp.float32(0.5 * camera.wall * camera.row_focal) / jnp.maximum(depth, 1e-6)


def drop_of(half: jax.Array, lift: jax.Array | None, camera: Camera) -> jax.Array | None:
    """float32[W]: how far the middle of the wall is below the horizon; None if it is not."""
    if lift is None:
        return half * jnp.float32(camera.wall_drop) if camera.wall_drop else None
    return half * (lift * jnp.float32(2 / camera.wall) + jnp.float32(camera.wall_drop))


def _panels(
    index: jax.Array,
    hits: Hits,
    half: jax.Array,
    colour: list[jax.Array],
    light: jax.Array,
    theme: Theme,
    kind: ImageKind,
) -> Panels | None:
    if kind in ("depth", "labels") or not may_hold(theme.wall_panels):
        return None
    texel = jnp.minimum((hits.along * WORD).astype(jnp.int32), WORD - 1)
    # Combine tables on the host if they are known, so that a column needs a single lookup.
    known = isinstance(theme.wall_panels, np.ndarray)
    panel = index if known else _looked_up(theme.wall_panels, index)
    rows: Any = theme.wall_panels if known else slice(None)
    used = (0, 1) if may_hold(theme.panels[:, 1]) else (0,)
    planes = [
        _looked_up(theme.panels[rows, i].reshape(-1), panel * np.int32(WORD) + texel) for i in used
    ]
    shadow = light * PANEL_SHADOW
    if theme.panel_reach is not None:
        # The first panel is empty, so its reach does not matter.
        one = len(np.unique(theme.panel_reach[1:])) == 1
        reach = theme.panel_reach[1] if one else _looked_up(theme.panel_reach[rows], panel)
        left = jnp.clip(1 - hits.depth / reach, 0, 1)
        shadow = light * (1 - (1 - PANEL_SHADOW) * left)
    accent = [jnp.asarray(theme.panel_accent)[i] for i in range(3)]
    words = pack_rgb(colour, shadow), pack_rgb(accent, light)
    paint = [tone(kind, words[i], hits.wall, hits.depth) for i in used]
    return Panels(
        scale=(WORD // 2) / half,
        offset=jnp.full_like(half, WORD // 2 - 0.5),
        planes=jnp.stack(planes),
        paint=jnp.stack(paint),
    )


def _looked_up(table: Array, index: jax.Array) -> jax.Array:
    return jnp.asarray(table).at[index].get(mode="promise_in_bounds")


def may_hold(table: Array) -> bool:
    """Whether a table may have a nonzero entry; True if its values are traced."""
    return not isinstance(table, np.ndarray) or bool(table.any())
