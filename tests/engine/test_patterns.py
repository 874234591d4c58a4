"""Patterns on walls and floor against the reference, as constants and as parts of a state."""

import jax
import numpy as np
import pytest

from jaxenstein.engine.art.patterns import FLOOR_PATTERNS, WALL_PATTERNS, wall_patterns
from jaxenstein.engine.camera import Camera
from jaxenstein.engine.render import render
from jaxenstein.engine.scene import Theme
from tests.reference import colours, scenes
from tests.reference.scenes import no_sprites

# With and without columns past the edge of the image, which are painted in another way.
CAMERAS = (Camera(24, 32, 75), Camera(17, 20, 60))
VARYING = ("wall_colours", "wall_panels", "floor", "ceiling", "floor_words")


def patterned_theme(seed: int) -> Theme:
    """Panels of random bits on most walls, some of which fade; accents on the last one."""
    rng = np.random.default_rng(seed)
    panels = rng.integers(0, 2**32, (4, 2, 32), dtype=np.uint32)
    panels[0] = 0
    panels[:3, 1] = 0
    return scenes.plain_theme(
        panels=panels,
        wall_panels=rng.integers(0, 4, 256).astype(np.int32),
        panel_reach=np.array([1, 6, np.inf, np.inf], np.float32),
        floor_words=rng.integers(0, 2**32, 2, dtype=np.uint32),
    )


@pytest.mark.parametrize("camera", CAMERAS, ids=("whole", "widened"))
@pytest.mark.parametrize("varying", [False, True], ids=("constant", "varying"))
def test_patterns_against_the_reference(camera: Camera, varying: bool) -> None:
    """With a constant theme, or with all variable parts of the theme as a batch."""
    theme = patterned_theme(3)
    drawn = [scenes.draw_scene(seed, (9, 12), 0) for seed in range(6)]
    batch = [scenes.scene_of(world, no_sprites(), theme) for world, _ in drawn]
    given = [
        (s.level, s.closed, s.position, s.heading, {name: getattr(theme, name) for name in VARYING})
        for s in batch
    ]

    @jax.jit
    @jax.vmap
    def run(level, closed, position, heading, looks):
        look = theme.replace(**looks) if varying else theme
        scene = batch[0].replace(level=level, closed=closed, position=position, heading=heading)
        return render(scene.replace(theme=look), camera), render(
            scene.replace(theme=look), camera, "labels"
        )

    images, labels = run(*jax.tree.map(lambda *leaves: np.stack(leaves), *given))
    compared = 0
    for i, (world, _) in enumerate(drawn):
        picture = scenes.picture_of(world, no_sprites(), theme, camera, 4)
        wanted, sure = colours.paint(picture, world, theme, camera)
        off = np.abs(np.asarray(images[i]).astype(np.float64) - wanted).max(axis=-1)
        assert (off[sure] <= 1).all(), (i, np.argwhere(sure & (off > 1))[:5])
        known = ~picture.unsure
        np.testing.assert_array_equal(np.asarray(labels[i])[known], picture.labels[known])
        compared += int(sure.sum())
    assert compared > 0.6 * len(drawn) * camera.height * camera.width


def test_wall_patterns_continue_over_tiles_and_differ() -> None:
    """Left and right edges match: no more texels change there than between other columns."""
    words = wall_patterns()
    assert words.shape == (len(WALL_PATTERNS), 2, 32)
    assert not words[:, 1].any()
    bits = words[:, 0, :, None] >> np.arange(31, -1, -1, dtype=np.uint32) & 1
    for name, plane in zip(WALL_PATTERNS, bits, strict=True):
        changes = (plane != np.roll(plane, 1, axis=0)).sum(axis=1)
        assert changes[0] <= changes[1:].max(), name
        assert 0.08 < plane.mean() < 0.5, name
    assert len(np.unique(words[:, 0], axis=0)) == len(WALL_PATTERNS)
    assert len(set(FLOOR_PATTERNS.values())) == len(FLOOR_PATTERNS)
