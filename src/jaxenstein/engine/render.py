"""From a scene to an image: rays, then columns, then pixels.

Each stage is finished before the next one starts (see `_jax.staging`):

1. `raycast.cast`: one ray per column finds its wall.
2. `image_columns.prepare`: everything that the pixels of a column share, billboards included.
3. `pixels.paint`: a comparison separates wall from floor and ceiling; a shifted word separates a
   panel from its wall and a billboard from what is behind it.

With textures, `textured` has the last two stages, and one more that fetches each pixel's colour.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from .._jax.batching import by_most, by_own
from .._jax.staging import staged
from . import textured, textured_sprites
from .camera import Camera
from .image_columns import prepare
from .pixels import paint, paint_rows
from .raycast import cast
from .scene import Scene
from .shade import ImageKind
from .sprites import BLOCK, by_depth, dress, layers_seen, nearest, pick, project, see
from .textured_walls import wall_camera
from .textures import Sampling

# This many layers of billboards are always painted.
FEW = 2
# When images are painted one by one, JAX 0.10 copies the whole batch for each image and takes
# sixty times as long; JAX 0.12 does not.
_COPIES_IMAGES = jax.__version_info__ < (0, 12)


def render(scene: Scene, camera: Camera, kind: ImageKind = "rgb", layers: int = 4) -> jax.Array:
    """Render what the eye sees. Gradients do not flow through images.

    Args:
        scene: the scene and the pose of the eye.
        camera: size and field of view of the image.
        kind: `"rgb"` uint8[height, width, 3]; `"gray"` uint8[height, width], BT.601 luma of the
            same colours; `"depth"` float32[height, width], perpendicular distance in tiles;
            `"labels"` uint8[height, width], the label id of each pixel (see `scene.Theme`).
        layers: how many billboards a column can show, one behind another.
    """
    # Rays use loops and conditionals that cannot be differentiated.
    scene = scene.replace(
        position=lax.stop_gradient(scene.position),
        heading=lax.stop_gradient(scene.heading),
        sprites=lax.stop_gradient(scene.sprites),
        lift=lax.stop_gradient(scene.lift),
        held=lax.stop_gradient(scene.held),
    )
    textures = scene.theme.textures if kind in ("rgb", "gray") else None
    if textures is None:
        return _draw(scene, camera.widened(), kind, layers, Sampling(), _COLOURED)
    sized = scene.replace(theme=textured.sized(scene.theme))
    view = camera.halved() if textures.sampling.samples == 2 else camera
    index = _draw(sized, view.widened(), kind, layers, textures.sampling, _TEXTURED)
    return textured.colours(index, scene, camera, kind)


class _Way(NamedTuple):
    """How columns, billboards, rows and pixels are computed."""

    prepare: Callable[..., Any]
    dress: Callable[..., Any]
    project: Callable[..., Any]
    rows: Callable[..., Any]
    paint: Callable[..., Any]
    textured: bool


_COLOURED = _Way(prepare, dress, project, paint_rows, paint, textured=False)
_TEXTURED = _Way(
    textured.prepare,
    textured_sprites.dress,
    textured_sprites.project,
    textured.paint_rows,
    textured.paint,
    textured=True,
)


def _draw(
    scene: Scene, camera: Camera, kind: ImageKind, layers: int, places: Sampling, way: _Way
) -> Any:
    """The image, or what stands for each of its pixels."""
    pose = scene.position, scene.heading
    walls, things = wall_camera(camera, places), camera.at(places.thing)
    hits = cast(*pose, scene.closed, scene.level, walls, way.textured)
    stage = partial(way.prepare, theme=scene.theme, camera=camera, kind=kind)
    eye = (scene.lift, scene.glare) if way.textured else (scene.lift,)
    rows = way.rows(scene.theme, camera, kind, *eye)
    count = scene.sprites.picture.shape[0]
    dress = partial(way.dress, theme=scene.theme, camera=camera, kind=kind)
    spots = see(*pose, scene.sprites, scene.theme) if count else None
    if spots is None or count <= layers:
        boards = None if spots is None else dress(by_depth(spots, scene.theme), *eye)
        columns = staged(stage)(scene.heading, hits, boards, *eye)
        return way.paint(columns, rows, scene, camera, kind)
    # What is known of each billboard, and what of those that a column sees.
    few, dressed = count <= BLOCK, staged(dress)
    known = dressed(spots, *eye) if few else spots
    keys = nearest(spots, scene.theme, things, layers)

    def chosen(known: Any, keys: jax.Array, eye: Any) -> Any:
        return pick(known, keys) if few else dressed(pick(known, keys), *eye)

    if layers <= FEW:
        columns = staged(stage)(scene.heading, hits, chosen(known, keys, eye), *eye)
        return way.paint(columns, rows, scene, camera, kind)
    columns = staged(stage)(scene.heading, hits, None, *eye)
    over = staged(partial(way.project, theme=scene.theme, camera=camera))
    seen = layers_seen(keys, hits.depth, count)

    def with_layers(most: int) -> Callable[..., jax.Array]:
        def draw(columns: Any, depth: jax.Array, eye: Any, known: Any, keys: jax.Array) -> Any:
            shown = over(chosen(known, keys[:most], eye), depth)
            steps = [
                partial(_paint_layers, k, rows=rows, scene=scene, camera=camera, kind=kind, way=way)
                for k in range(most + 1)
            ]
            if _COPIES_IMAGES:
                return steps[-1](columns, shown)
            return by_own(steps)(jnp.max(seen), columns, shown)

        return draw

    # If no member of the batch sees more than a few layers, the others are not looked up.
    more = (seen > FEW).astype(jnp.int32)
    steps = [with_layers(most) for most in (FEW, layers)]
    return by_most(steps)(more, columns, hits.depth, eye, known, keys)


def _paint_layers(
    count: int,
    columns: Any,
    layers: Any,
    *,
    rows: Any,
    scene: Scene,
    camera: Camera,
    kind: ImageKind,
    way: _Way,
) -> Any:
    """The image with `count` layers of billboards."""
    nearest = jax.tree.map(lambda leaf: leaf[..., :count, :], layers)
    return way.paint(columns.replace(layers=nearest), rows, scene, camera, kind)
