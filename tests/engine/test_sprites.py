"""Billboards: visibility, occlusion by walls and each other, layers, art, against the reference."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxenstein.engine.camera import Camera
from jaxenstein.engine.scene import Sprites
from tests.reference import images, raycaster, scenes
from tests.reference.scenes import renderer
from tests.reference.worlds import World

THEME = scenes.plain_theme()
NO_DOORS = np.zeros((0, 2), np.int32)


def show(world: World, sprites: Sprites, camera: Camera, kind, layers: int = 4) -> np.ndarray:
    """An image of the first pose of a world."""
    scene = scenes.scene_of(world, sprites, THEME)
    run = renderer(camera, kind, layers)
    return np.asarray(run(scene.level, scene.closed, scene.position, scene.heading, sprites))


def hall(length: int = 12, width: int = 7) -> World:
    """A hall along +x; the eye is in its middle, near the west end, and faces east."""
    walls = np.full((width, length), 9, np.uint8)
    walls[1:-1, 1:-1] = 0
    eye = np.array([[1.5, width / 2]], np.float32)
    return World(walls, NO_DOORS, np.zeros(0, bool), eye, np.zeros(1, np.float32))


def billboards(*places: tuple[float, float, int]) -> Sprites:
    """Visible sprites at (x, y) with a look."""
    return Sprites(
        position=jnp.array([place[:2] for place in places], jnp.float32),
        picture=jnp.array([place[2] for place in places], jnp.int32),
        visible=jnp.ones(len(places), bool),
    )


CASES = [
    (Camera(24, 33, 60), (9, 12), 6, 4),
    (Camera(17, 40, 110), (9, 12), 6, 1),
    (Camera(40, 21, 75), (20, 9), 12, 2),
    (Camera(64, 64, 60), (33, 40), 1, 4),
    (Camera(40, 30, 90, eye=1.3, wall=3.25, row_focal_share=0.8), (12, 12), 6, 2),
]


@pytest.mark.parametrize(("camera", "shape", "count", "layers"), CASES)
def test_sprites_against_the_reference(camera, shape, count: int, layers: int) -> None:
    """Labels and depth of every pixel that is not within rounding of an edge."""
    pixels = masked = on_sprites = 0
    for seed in range(30):
        world, sprites = scenes.draw_scene(seed, shape, count)
        wanted = scenes.picture_of(world, sprites, THEME, camera, layers)
        labels = show(world, sprites, camera, "labels", layers)
        depth = show(world, sprites, camera, "depth", layers)
        sure = ~wanted.unsure
        np.testing.assert_array_equal(labels[sure], wanted.labels[sure])
        np.testing.assert_allclose(depth[sure], wanted.depth[sure], rtol=1e-4, atol=1e-6)
        pixels, masked = pixels + sure.size, masked + int((~sure).sum())
        on_sprites += int((sure & (wanted.sprite >= 0)).sum())
    print(f"{masked} of {pixels} pixels masked, {on_sprites} on sprites")
    assert masked < 0.05 * pixels
    assert on_sprites > 20


@pytest.mark.parametrize("layers", [1, 2, 3])
def test_layers_limit_what_a_column_shows(layers: int) -> None:
    """Four squares behind each other: through holes, at most `layers` of them are visible."""
    world, camera = hall(), Camera(48, 48, 60)
    sprites = billboards((6.5, 3.5, 3), (3.5, 3.5, 3), (5.5, 3.5, 3), (4.5, 3.5, 1))
    wanted = scenes.picture_of(world, sprites, THEME, camera, layers)
    depth = show(world, sprites, camera, "depth", layers)
    sure = ~wanted.unsure
    np.testing.assert_allclose(depth[sure], wanted.depth[sure], rtol=1e-4)
    middle = depth[:, 23:25]
    in_front = {round(float(d), 4) for d in middle.flat} & {2.0, 3.0, 4.0, 5.0}
    assert in_front == {2.0, 3.0, 4.0, 5.0} & {float(d) for d in range(2, 2 + layers)}


def test_batch_paints_the_layers_its_members_need() -> None:
    """Each member equals a single image: none to five billboards behind each other."""
    world, camera = hall(), Camera(24, 32, 60)
    depths = [3.0 + 0.3 * i for i in range(5)]
    row = billboards(*((1.5 + d, 3.5 + 0.05 * i * d, 3) for i, d in enumerate(depths)))
    alone = renderer(camera, "depth", 4)
    scene = scenes.scene_of(world, row, THEME)
    eye = scene.level, scene.closed, scene.position, scene.heading
    seen = np.tri(6, 5, -1, dtype=bool)
    batch = row.replace(
        position=jnp.broadcast_to(row.position, (6, 5, 2)),
        picture=jnp.broadcast_to(row.picture, (6, 5)),
        visible=jnp.asarray(seen),
    )
    run = jax.jit(jax.vmap(lambda sprites: alone(*eye, sprites)))
    wanted = [np.asarray(alone(*eye, row.replace(visible=jnp.asarray(one)))) for one in seen]
    assert all((one != other).any() for one, other in itertools.pairwise(wanted))
    for chosen in ([0], [1], [0, 1], [0, 1, 2], [*range(6)]):
        images = run(jax.tree.map(lambda leaf, which=tuple(chosen): leaf[np.array(which)], batch))
        np.testing.assert_array_equal(images, [wanted[i] for i in chosen])


def test_wall_hides_part_of_a_sprite_behind_it() -> None:
    world = hall()
    world.walls[1:4, 4] = 17
    camera = Camera(32, 64, 60)
    sprites = billboards((6.0, 4.0, 0))
    labels = show(world, sprites, camera, "labels")
    wanted = scenes.picture_of(world, sprites, THEME, camera, 4)
    sure = ~wanted.unsure
    np.testing.assert_array_equal(labels[sure], wanted.labels[sure])
    columns = np.flatnonzero((labels == scenes.SPRITE_LABELS).any(axis=0))
    edge = np.flatnonzero((labels == 17).any(axis=0)).max()
    assert columns.min() == edge + 1
    uncut = show(hall(), sprites, camera, "labels")
    assert np.flatnonzero((uncut == scenes.SPRITE_LABELS).any(axis=0)).min() < edge


def test_invisible_distant_and_close_sprites() -> None:
    """Flagged invisible, behind the eye, nearer than the limit: not drawn. Just past it: drawn."""
    world, camera = hall(), Camera(16, 16, 60)
    for x, drawn in ((1.0, False), (1.5, False), (1.54, False), (1.56, True), (9.0, True)):
        sprites = billboards((x, 3.5, 0))
        labels = show(world, sprites, camera, "labels")
        assert (labels == scenes.SPRITE_LABELS).any() == drawn
        hidden = sprites.replace(visible=jnp.zeros(1, bool))
        assert not (show(world, hidden, camera, "labels") == scenes.SPRITE_LABELS).any()


@pytest.mark.parametrize("look", range(scenes.LOOKS))
def test_art_is_upright_and_not_mirrored(look: int) -> None:
    """Texture columns run from left to right as seen, highest bits on top; detail over shape."""
    world, camera = hall(), Camera(80, 80, 60)
    distance = 0.9
    sprites = billboards((1.5 + distance, 3.5, look))
    rgb = show(world, sprites, camera, "rgb").astype(int)
    wanted = scenes.picture_of(world, sprites, THEME, camera, 4)
    radius, drop = float(THEME.sprite_radius[look]), float(THEME.sprite_drop[look])
    slopes = raycaster.slopes(80, 60)
    heights = images.row_offsets(80) / images.focal_length(80, 60)
    checked = 0
    for row, column in np.argwhere((wanted.sprite == 0) & ~wanted.unsure):
        texel = int((slopes[column] * distance / radius + 1) * 16)
        bit = int(((heights[row] * distance - drop) / radius + 1) * 16)
        detail = int(THEME.sprite_art[look, 1, texel]) >> (31 - bit) & 1
        red, green, blue = rgb[row, column]
        assert (red == 0, green == 0, blue) == (detail == 1, detail == 0, 0)
        checked += 1
    assert checked > 20


def test_sprites_of_equal_depth_have_a_fixed_order() -> None:
    """A tie shows one of the two in all columns of both, not a mixture."""
    world, camera = hall(), Camera(32, 32, 60)
    sprites = billboards((4.0, 3.5, 0), (4.0, 3.5, 3))
    both = show(world, sprites, camera, "labels", layers=1)
    shown = set(np.unique(both)) & {scenes.SPRITE_LABELS, scenes.SPRITE_LABELS + 3}
    # Look 3 is smaller: columns beside it still show look 0.
    middle = set(np.unique(both[:, 15:17])) & shown
    assert len(middle) == 1


@pytest.mark.parametrize("layers", [1, 4])
def test_adjacent_sprites_of_equal_depth_are_all_drawn(layers: int) -> None:
    world, camera = hall(), Camera(32, 64, 60)
    sprites = billboards((4.0, 2.5, 0), (4.0, 4.5, 3), (4.0, 3.5, 1))
    labels = show(world, sprites, camera, "labels", layers)
    wanted = scenes.picture_of(world, sprites, THEME, camera, layers)
    sure = ~wanted.unsure
    np.testing.assert_array_equal(labels[sure], wanted.labels[sure])
    shown = {scenes.SPRITE_LABELS + look for look in (0, 1, 3)}
    assert shown <= set(np.unique(labels[sure]).tolist())


def test_more_layers_than_sprites_change_nothing() -> None:
    world, camera = hall(), Camera(24, 24, 60)
    sprites = billboards((4.0, 3.5, 0), (5.0, 3.2, 1))
    few = show(world, sprites, camera, "rgb", layers=2)
    many = show(world, sprites, camera, "rgb", layers=9)
    np.testing.assert_array_equal(few, many)
