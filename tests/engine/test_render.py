"""Whole images: against the reference, between kinds of image, and however they are computed."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given

from jaxenstein.engine.camera import Camera
from jaxenstein.engine.level import compile_level, level_from_walls
from jaxenstein.engine.render import render
from jaxenstein.engine.scene import Scene
from tests.reference import images, raycaster, scenes
from tests.reference.scenes import no_sprites, renderer
from tests.reference.search import SEEDS, search_settings
from tests.reference.worlds import World, draw_world
from tests.x64 import enable_x64

THEME = scenes.plain_theme()
NO_DOORS = np.zeros((0, 2), np.int32)
SMALL = Camera(12, 16, 75)
# Colours and depths; the other two kinds go the same ways, and compiling takes the time.
KINDS = ("rgb", "depth")


def render_arguments(scene: Scene) -> tuple:
    """The arguments of a renderer."""
    return scene.level, scene.closed, scene.position, scene.heading, scene.sprites


def hall(length: int = 9, width: int = 7, heading: float = 0.0) -> World:
    """A hall along +x with walls 9; the eye is off the middle and away from tile borders."""
    walls = np.full((width, length), 9, np.uint8)
    walls[1:-1, 1:-1] = 0
    eye = np.array([[2.3, 3.4]], np.float32)
    return World(walls, NO_DOORS, np.zeros(0, bool), eye, np.array([heading], np.float32))


CASES = [
    (Camera(24, 33, 60), (9, 12)),
    (Camera(33, 24, 90), (33, 40)),
    (Camera(1, 7, 120), (5, 7)),
    (Camera(5, 1, 30), (9, 12)),
    (Camera(64, 64, 60), (70, 66)),
    # A low eye in a high room on a screen of other pixels; a high eye in a low one.
    (Camera(24, 33, 90, eye=1.3, wall=3.25, row_focal_share=0.8), (33, 40)),
    (Camera(33, 24, 60, eye=0.7, wall=0.8), (9, 12)),
]


@pytest.mark.parametrize(("camera", "shape"), CASES)
def test_walls_floor_and_ceiling_against_the_reference(camera: Camera, shape) -> None:
    pixels = masked = 0

    @search_settings(20)
    @given(seed=SEEDS)
    def check(seed: int) -> None:
        nonlocal pixels, masked
        world, _ = scenes.draw_scene(seed, shape, 0)
        scene = scenes.scene_of(world, no_sprites(), THEME)
        wanted = scenes.picture_of(world, no_sprites(), THEME, camera, 4)
        labels = np.asarray(renderer(camera, "labels")(*render_arguments(scene)))
        depth = np.asarray(renderer(camera, "depth")(*render_arguments(scene)))
        assert labels.dtype == np.uint8
        assert depth.dtype == np.float32
        assert labels.shape == depth.shape == (camera.height, camera.width)
        sure = ~wanted.unsure
        np.testing.assert_array_equal(labels[sure], wanted.labels[sure])
        np.testing.assert_allclose(depth[sure], wanted.depth[sure], rtol=1e-4, atol=1e-6)
        assert np.isfinite(depth).all()
        pixels, masked = pixels + sure.size, masked + int((~sure).sum())

    check()
    print(f"{masked} of {pixels} pixels masked")
    # A camera of five pixels has so few of them that chance alone may mask some.
    assert masked < 0.02 * pixels + 5


def random_scenes(seed: int, count: int, shape=(9, 12)) -> list[Scene]:
    """Scenes of the same shape with sprites, each in its own map."""
    drawn = [scenes.draw_scene(seed + i, shape, 3) for i in range(count)]
    return [scenes.scene_of(world, sprites, THEME) for world, sprites in drawn]


def assert_alike(one, other, kind: str, at_most: float = 0.01) -> None:
    """Compare up to a small share of pixels on edges, and up to one level of a channel."""
    one, other = np.asarray(one, np.float64), np.asarray(other, np.float64)
    assert one.shape == other.shape
    tolerance = 1e-5 * np.abs(one) if kind == "depth" else {"labels": 0, "rgb": 1, "gray": 1}[kind]
    assert (np.abs(one - other) > tolerance).mean() <= at_most


def test_without_jit() -> None:
    camera = Camera(6, 8, 60)
    for scene in random_scenes(5, 2, (7, 7)):
        with jax.disable_jit():
            plain = render(jax.tree.map(jnp.asarray, scene).replace(theme=THEME), camera)
        assert_alike(plain, renderer(camera, "rgb")(*render_arguments(scene)), "rgb")


@pytest.mark.parametrize("kind", KINDS)
def test_vmap_equals_a_loop(kind) -> None:
    """Another map, pose and sprites in each lane; the level in the state."""
    run = renderer(SMALL, kind)
    batch = [render_arguments(scene) for scene in random_scenes(11, 6)]
    stacked = jax.tree.map(lambda *leaves: np.stack(leaves), *batch)
    together = jax.jit(jax.vmap(run))(*stacked)
    for i, one in enumerate(batch):
        assert_alike(together[i], run(*one), kind)


def test_nested_vmap_equals_a_loop() -> None:
    """Over maps and, within each, over poses."""
    run = renderer(SMALL, "rgb")
    worlds = [draw_world(i, (9, 12), bordered=True, poses=4) for i in range(3)]
    levels = [compile_level(world.walls, world.doors) for world in worlds]
    level = jax.tree.map(lambda *leaves: np.stack(leaves), *levels)
    closed = np.stack([world.closed for world in worlds])
    positions = np.stack([world.positions for world in worlds])
    headings = np.stack([world.headings for world in worlds])
    _, sprites = scenes.draw_scene(1, (9, 12), 3)
    over_poses = jax.vmap(run, (None, None, 0, 0, None))
    frames = jax.jit(jax.vmap(over_poses, (0, 0, 0, 0, None)))(
        level, closed, positions, headings, sprites
    )
    assert frames.shape == (3, 4, 12, 16, 3)
    for i, j in np.ndindex(3, 4):
        one = run(levels[i], closed[i], positions[i, j], headings[i, j], sprites)
        assert_alike(frames[i, j], one, "rgb")


@pytest.mark.parametrize("kind", KINDS)
def test_constant_levels_equal_levels_in_the_state(kind) -> None:
    world, sprites = scenes.draw_scene(3, (9, 12), 3)
    scene = scenes.scene_of(world, sprites, THEME)

    @jax.jit
    def constant(position, heading):
        return render(scene.replace(position=position, heading=heading), SMALL, kind)

    @jax.jit
    def generated(walls, doors, closed, position, heading):
        level = level_from_walls(walls, doors)
        return render(Scene(level, closed, position, heading, sprites, THEME), SMALL, kind)

    frame = constant(scene.position, scene.heading)
    assert_alike(frame, renderer(SMALL, kind)(*render_arguments(scene)), kind)
    pose = world.positions[0], world.headings[0]
    assert_alike(frame, generated(world.walls, world.doors, world.closed, *pose), kind)


@pytest.mark.parametrize("kind", KINDS)
def test_x64_changes_nothing(kind) -> None:
    scenery = [render_arguments(scene) for scene in random_scenes(21, 2)]
    single = [np.asarray(renderer(SMALL, kind)(*one)) for one in scenery]
    with enable_x64(True):
        run = renderer.__wrapped__(SMALL, kind)
        double = [np.asarray(run(*one)) for one in scenery]
    for one, other in zip(single, double, strict=True):
        assert one.dtype == other.dtype
        assert_alike(one, other, kind)


def test_gray_is_the_luma_of_the_colours() -> None:
    for scene in random_scenes(31, 6):
        rgb = np.asarray(renderer(SMALL, "rgb")(*render_arguments(scene))).astype(np.float64)
        gray = np.asarray(renderer(SMALL, "gray")(*render_arguments(scene)))
        assert gray.dtype == np.uint8
        assert gray.shape == (12, 16)
        luma = rgb @ [0.299, 0.587, 0.114]
        assert np.abs(gray - luma).max() <= 1


def test_walls_get_darker_with_depth() -> None:
    """The same wall from near to far, for each of its two kinds of faces."""
    camera = Camera(8, 9, 60)
    world = hall(30)
    level = compile_level(world.walls, NO_DOORS)
    run = renderer(camera, "rgb")

    def middle(x: float, heading: float) -> np.ndarray:
        eye = np.array([x, 3.5], np.float32)
        frame = run(level, world.closed, eye, np.float32(heading), no_sprites())
        return np.asarray(frame[4, 4], int)

    brightness = [middle(x, 0).sum() for x in (28.9, 28.0, 27.0, 25.0, 22.0)]
    assert all(near > far for near, far in itertools.pairwise(brightness))
    # Both walls are 2.5 tiles away.
    assert (middle(26.5, 0) != middle(26.5, np.pi / 2)).any()


@pytest.mark.parametrize("heading", [0.0, 0.7, np.pi / 2, 2.5, -1.9])
def test_the_floor_is_a_checker_of_tiles(heading: float) -> None:
    """Where a pixel's ray meets the floor, the parity of column + row picks its colour."""
    camera = Camera(40, 41, 75)
    world = hall(heading=heading)
    scene = scenes.scene_of(world, no_sprites(), THEME)
    rgb = np.asarray(renderer(camera, "rgb")(*render_arguments(scene))).astype(int)
    labels = np.asarray(renderer(camera, "labels")(*render_arguments(scene)))
    heading = float(world.headings[0])
    rays = raycaster.directions(heading, camera.width, camera.field_of_view)
    focal = images.focal_length(camera.width, camera.field_of_view)
    seen = {0: 0, 1: 0}
    for row, below in enumerate(images.row_offsets(camera.height)):
        distance = focal / (2 * below)
        if not 0 < distance < 3:
            continue
        for column in np.flatnonzero(labels[row] == images.FLOOR):
            place = world.positions[0].astype(np.float64) + distance * rays[column]
            if np.abs(place - np.rint(place)).min() < 1e-4:
                continue
            parity = int(np.floor(place).sum()) % 2
            red, _, blue = rgb[row, column]
            # Even tiles are red and odd ones blue in this theme.
            assert (red > blue) == (parity == 0)
            seen[parity] += 1
    assert min(seen.values()) > 50


def test_panels_are_upright_and_not_mirrored() -> None:
    """Panel columns run from left to right as seen on all four faces, highest bits on top."""
    rng = np.random.default_rng(8)
    panels = np.zeros((2, 2, 32), np.uint32)
    panels[1] = rng.integers(0, 2**32, (2, 32), dtype=np.uint32)
    with_panel = np.zeros(256, np.int32)
    with_panel[30] = 1
    colours = np.tile(np.array([200, 40, 0], np.float32), (256, 1))
    theme = scenes.plain_theme(
        panels=panels,
        wall_panels=with_panel,
        wall_colours=colours,
        panel_accent=np.array([0, 0, 250], np.float32),
    )
    camera = Camera(60, 60, 60)
    walls = np.full((7, 7), 9, np.uint8)
    walls[1:-1, 1:-1] = 0
    walls[3, 3] = 30
    level = compile_level(walls, np.array([(3, 3)], np.int32))

    @jax.jit
    def run(position, heading):
        closed = jnp.ones(1, bool)
        return render(Scene(level, closed, position, heading, no_sprites(), theme), camera)

    slopes = raycaster.slopes(60, 60)
    heights = images.row_offsets(60) / images.focal_length(60, 60)
    poses = [(2, 3.5, 0), (3.5, 2, np.pi / 2), (5, 3.5, np.pi), (3.5, 5, -np.pi / 2)]
    for x, y, heading in poses:
        rgb = np.asarray(run(np.array([x, y], np.float32), np.float32(heading))).astype(int)
        plain = rgb[30, :, 0].max()
        # At depth one the panel shows where the slope and the height are within half a tile.
        for row, column in np.ndindex(60, 60):
            texel, bit = float(slopes[column] + 0.5) * 32, float(heights[row] + 0.5) * 32
            near_edge = min(abs(texel - round(texel)), abs(bit - round(bit))) < 1e-2
            if near_edge or not (0 < texel < 32 and 0 < bit < 32):
                continue
            shadow, accent = (int(panels[1, i, int(texel)]) >> (31 - int(bit)) & 1 for i in (0, 1))
            red, _, blue = rgb[row, column]
            assert (blue > 0) == bool(accent)
            if not accent:
                # A shadow has less than half the light; a seam at the tile's edge takes a quarter.
                assert (red < 0.6 * plain) == bool(shadow)


def test_walls_have_darker_seams_that_fade_with_depth() -> None:
    """Facing a wall: columns at the edge of a tile are darker nearby and equal far away."""
    walls = np.zeros((20, 41), np.uint8)
    theme = scenes.plain_theme()
    camera = Camera(1, 64, 60)
    level = compile_level(walls, np.zeros((0, 2), np.int32))

    @jax.jit
    def run(position):
        closed, north = jnp.ones(0, bool), jnp.float32(-np.pi / 2)
        return render(Scene(level, closed, position, north, no_sprites(), theme), camera)

    for depth in (1.0, 2.0, 9.0):
        shown = np.asarray(run(np.array([20.3, depth], np.float32)))[0].astype(int).sum(axis=-1)
        along = (20.3 + raycaster.slopes(64, 60) * depth) % 1
        seam, plain = np.minimum(along, 1 - along) < 0.029, np.minimum(along, 1 - along) > 0.031
        assert seam.any()
        assert np.ptp(shown[plain]) <= 3
        if depth < 7:
            assert shown[seam].max() < 0.9 * shown[plain].min()
        else:
            assert np.ptp(shown) <= 3


def test_any_size_and_field_of_view() -> None:
    scene = random_scenes(41, 1)[0]
    for height, width, field_of_view in [(1, 1, 60), (3, 160, 120), (45, 2, 30)]:
        camera = Camera(height, width, field_of_view)
        assert renderer(camera, "rgb")(*render_arguments(scene)).shape == (height, width, 3)
