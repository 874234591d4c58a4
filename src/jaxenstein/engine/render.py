"""From a scene to an image: rays, then columns, then pixels.

Each stage is finished before the next one starts (see `fusion`):

1. `raycast.cast`: one ray a column finds its wall.
2. `columns.prepare`: all that the pixels of a column have in common, billboards included.
3. `pixels.paint`: one comparison tells wall from floor and ceiling, one shifted word a panel from
   its wall and a billboard from what is behind it.
"""

from __future__ import annotations

from functools import partial

import jax
from jax import lax

from .camera import Camera
from .fusion import staged
from .image_columns import prepare
from .pixels import paint
from .raycast import cast
from .scene import Scene
from .shade import ImageKind
from .sprites import choose


def render(scene: Scene, camera: Camera, kind: ImageKind = "rgb", layers: int = 4) -> jax.Array:
    """Draw what the eye sees; to automatic differentiation a picture is a constant.

    Args:
        scene: what there is to see, and from where.
        camera: size and field of view of the image.
        kind: `"rgb"` uint8[height, width, 3]; `"gray"` uint8[height, width], BT.601 luma of the
            same colours; `"depth"` float32[height, width], perpendicular distance in tiles;
            `"labels"` uint8[height, width], what each pixel shows (see `scene.Theme`).
        layers: how many billboards one column can show behind each other.
    """
    camera = camera.widened()
    # Rays end where they hit, by loops and conditionals that cannot be differentiated.
    scene = scene.replace(
        position=lax.stop_gradient(scene.position),
        heading=lax.stop_gradient(scene.heading),
        sprites=lax.stop_gradient(scene.sprites),
    )
    pose = scene.position, scene.heading
    spots = None
    if scene.sprites.look.shape[0]:
        spots = choose(*pose, scene.sprites, scene.theme, camera, layers)
    hits = cast(*pose, scene.closed, scene.level, camera)
    stage = staged(partial(prepare, theme=scene.theme, camera=camera, kind=kind))
    return paint(stage(scene.heading, hits, spots), scene, camera, kind)
