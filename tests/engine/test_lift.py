"""An eye that is not at the camera's height, compared with the reference."""

import dataclasses
import functools

import jax
import numpy as np
import pytest

from jaxenstein.engine.camera import Camera
from jaxenstein.engine.render import render
from jaxenstein.engine.scene import Scene
from tests.reference import scenes

THEME = scenes.plain_theme()


@pytest.mark.parametrize("count", [pytest.param(2, marks=pytest.mark.slow), 9])
@pytest.mark.parametrize("lift", [pytest.param(0.4, marks=pytest.mark.variant), -0.3])
def test_lifted_eye_sees_like_a_higher_eye(lift: float, count: int) -> None:
    """Labels and depth against the reference, colours against a camera of that height."""
    camera = Camera(24, 33, 90, eye=1.3, wall=3.25, row_focal_share=0.8)
    higher = dataclasses.replace(camera, eye=camera.eye + lift)
    rows = camera.row_distances(np.float32(lift))
    np.testing.assert_allclose(rows, higher.row_distances(), rtol=1e-5)
    theme = THEME.replace(sprite_drop=THEME.sprite_drop + np.float32(lift))
    pixels = masked = 0
    for seed in range(3):
        world, sprites = scenes.draw_scene(seed, (9, 12), count)
        wanted = scenes.picture_of(world, sprites, theme, higher, 4)
        scene = scenes.scene_of(world, sprites, THEME)
        images = lifted(camera)(
            scene.level,
            scene.closed,
            scene.position,
            scene.heading,
            scene.sprites,
            np.float32(lift),
        )
        sure = ~wanted.unsure
        np.testing.assert_array_equal(np.asarray(images["labels"])[sure], wanted.labels[sure])
        depth = np.asarray(images["depth"])
        np.testing.assert_allclose(depth[sure], wanted.depth[sure], rtol=1e-4, atol=1e-6)
        plain = render(scene.replace(theme=theme), higher, "rgb")
        apart = np.abs(np.asarray(images["rgb"], int) - np.asarray(plain, int)) > 1
        assert apart.mean() <= 0.01
        pixels, masked = pixels + sure.size, masked + int((~sure).sum())
    assert masked < 0.05 * pixels


@functools.cache
def lifted(camera: Camera):
    """A jitted render of several kinds for an eye that is not at the camera's height."""

    @jax.jit
    def run(level, closed, position, heading, sprites, lift):
        scene = Scene(level, closed, position, heading, sprites, THEME, lift)
        return {kind: render(scene, camera, kind) for kind in ("labels", "depth", "rgb")}

    return run
