"""Frames with textures against a slow sampler of the same pictures."""

import dataclasses
import re

import jax
import numpy as np
import pytest

from jaxenstein.engine.camera import Camera
from jaxenstein.engine.level import compile_level
from jaxenstein.engine.render import render
from jaxenstein.engine.scene import Scene, Sprites
from jaxenstein.engine.shade import luma
from jaxenstein.engine.textures import (
    Cutouts,
    Flats,
    Materials,
    Sampling,
    Textures,
    build_atlas,
    pack_opaque,
)
from tests.reference import scenes, textured
from tests.reference.textured import Flat, Looks, Thing, Wall
from tests.reference.worlds import World

SHAPE = (9, 12)
LABELS = 256


def draw_looks(seed: int, wall: float, *, of_face: bool) -> tuple[Looks, np.ndarray]:
    """Random pictures of many sizes, and the materials int32[256] or int32[4, 9, 12]."""
    rng = np.random.default_rng(seed)

    def picture(height: int, width: int, channels: int = 3) -> np.ndarray:
        return rng.integers(0, 256, (height, width, channels), dtype=np.uint8)

    walls = [
        Wall(picture(16, 8), 8, 16 / wall, 0),
        Wall(picture(4, 32), 16, 3.7, 5),
        Wall(picture(1, 2), 1, 1.0, 1),
        Wall(picture(32, 16), 8, 8.0, 3),
    ]
    things = []
    for height, width in ((8, 8), (40, 13), (70, 5), (3, 20)):
        rgba = picture(height, width, 4)
        rgba[..., 3] = np.where(rng.random((height, width)) < 0.6, 255, 0)
        top = rng.uniform(-0.4, 0.2)
        things.append(Thing(rgba, rng.uniform(0.1, 0.5), top, top + 0.4, height == 8))
    table = rng.integers(0, len(walls), (4, *SHAPE) if of_face else LABELS).astype(np.int32)

    def wall_of(face: int, tile: tuple[int, int], label: int) -> int:
        return int(table[face, tile[1], tile[0]] if of_face else table[label])

    ceiling = Flat(picture(8, 4), (2.0, 4.0), (0.5, 1.25))
    floor = Flat(picture(16, 16), (8.0, 8.0), (0.0, 3.0))
    return Looks(walls, ceiling, floor, things, wall_of), table


def textures_of(looks: Looks, table: np.ndarray, places: Sampling) -> Textures:
    """The same pictures for the engine."""
    flats = [looks.ceiling, looks.floor]
    groups = [looks.walls, flats, looks.things]
    pictures = [look.picture[..., :3] for group in groups for look in group]
    atlas, first = build_atlas(pictures)
    firsts = np.split(first, np.cumsum([len(group) for group in groups])[:-1])

    def sides(group) -> tuple[np.ndarray, np.ndarray]:
        shapes = [look.picture.shape for look in group]
        return np.array([s[1] for s in shapes], np.int32), np.array(
            [s[0] for s in shapes], np.int32
        )

    def values(group, name: str, kind: type = np.float32) -> np.ndarray:
        return np.array([getattr(look, name) for look in group], kind)

    column, opaque = pack_opaque([look.picture[..., 3] > 0 for look in looks.things])
    walls, things = looks.walls, looks.things
    return Textures(
        atlas=atlas,
        walls=Materials(
            firsts[0], *sides(walls),
            across=values(walls, "across", np.int32),
            down=values(walls, "down"),
            offset=values(walls, "offset", np.int32),
        ),
        of_wall=table if table.ndim == 1 else np.zeros(LABELS, np.int32),
        of_face=None if table.ndim == 1 else table,
        flats=Flats(firsts[1], *sides(flats), values(flats, "scale"), values(flats, "origin")),
        cutouts=Cutouts(
            firsts[2], *sides(things),
            half_width=values(things, "half_width"),
            top=values(things, "top"),
            bottom=values(things, "bottom"),
            bright=values(things, "bright", np.bool_),
            column=column,
            opaque=opaque,
        ),
        sampling=places,
    )  # fmt: skip


def draw_scene(seed: int, count: int) -> tuple[World, Sprites]:
    world, sprites = scenes.draw_scene(seed, SHAPE, count)
    return world, sprites.replace(picture=np.asarray(sprites.picture) % 4)


DOOM = Sampling(wall=(0, 1), plane=(1, 0.5), thing=(0.5, 0.75), light_row=0.0)
CASES = [
    pytest.param(Camera(24, 33, 75), Sampling(), None, False, 3, 4, id="usual"),
    pytest.param(
        Camera(20, 32, 90, eye=1.3, wall=3.25, row_focal_share=0.8), DOOM, 0.4, True, 9, 3,
        id="all-apart",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("camera", "places", "lift", "of_face", "count", "layers"), CASES)
def test_frames_against_the_reference(camera, places, lift, of_face, count, layers) -> None:
    """A batch of maps: by label or by face, with the eye lifted or not, few things or many."""
    looks, table = draw_looks(1, camera.wall, of_face=of_face)
    theme = scenes.plain_theme(
        sprite_art=np.zeros((4, 2, 32), np.uint32), sprite_radius=np.full(4, 0.3, np.float32)
    ).replace(textures=textures_of(looks, table, places))
    drawn = [draw_scene(seed, count) for seed in range(8)]

    @jax.jit
    @jax.vmap
    def run(level, closed, position, heading, sprites):
        direction = heading if lift is None else jax.numpy.stack([
            jax.numpy.cos(heading), jax.numpy.sin(heading)
        ])  # fmt: skip
        high = None if lift is None else jax.numpy.float32(lift)
        scene = Scene(level, closed, position, direction, sprites, theme, high)
        kinds = ("rgb", "gray") if lift is None else ("rgb",)
        return [render(scene, camera, kind, layers) for kind in kinds]

    batch = [
        (compile_level(w.walls, w.doors), w.closed, w.positions[0], w.headings[0], s)
        for w, s in drawn
    ]
    images, *greys = run(*jax.tree.map(lambda *leaves: np.stack(leaves), *batch))
    assert images.dtype == np.uint8
    assert images.shape == (len(drawn), camera.height, camera.width, 3)
    raised = dataclasses.replace(camera, eye=camera.eye + (lift or 0))
    # A billboard is as much lower as the eye is higher.
    lowered = [
        dataclasses.replace(t, top=t.top + (lift or 0), bottom=t.bottom + (lift or 0))
        for t in looks.things
    ]
    looks = dataclasses.replace(looks, things=lowered)
    equal, sures = [], []
    for image, (world, s) in zip(np.asarray(images), drawn, strict=True):
        things = tuple(np.asarray(part) for part in (s.position, s.picture, s.visible))
        wanted, sure = textured.draw(looks, world, things, raised, places, layers)
        same = (image == wanted).all(axis=-1)
        assert same[sure].all(), np.argwhere(sure & ~same)[:5]
        equal.append(same)
        sures.append(sure)
    print(f"{np.mean(equal):.4%} of all pixels are equal, {np.mean(sures):.2%} are sure")
    assert np.mean(equal) > 0.995
    assert np.mean(sures) > 0.8
    for grey in greys:
        words = np.asarray(images).astype(np.uint32) << np.array([0, 8, 16], np.uint32)
        np.testing.assert_array_equal(grey, luma(words.sum(axis=-1, dtype=np.uint32)))


def traced(theme, kind: str) -> str:
    """The program of a batch of images as text, without the addresses that old versions print."""
    world, sprites = draw_scene(3, 3)
    scene = scenes.scene_of(world, sprites, theme)

    def run(position):
        return render(scene.replace(position=position), Camera(6, 8, 60), kind)  # type: ignore[arg-type]

    program = str(jax.make_jaxpr(jax.vmap(run))(np.zeros((2, 2), np.float32)))
    return re.sub(r" at 0x[0-9a-f]+", "", program)


@pytest.mark.parametrize("kind", ["depth", "labels"])
def test_textures_change_neither_depth_nor_labels(kind: str) -> None:
    theme = scenes.plain_theme()
    looks, table = draw_looks(2, 1.0, of_face=False)
    with_textures = theme.replace(textures=textures_of(looks, table, DOOM))
    assert traced(with_textures, kind) == traced(theme, kind)


def test_two_samples_average_an_image_twice_as_wide() -> None:
    """Rounded down; square pixels stay as high as they were."""
    camera = Camera(12, 10, 70)
    twice = dataclasses.replace(
        camera, width=20, row_focal_share=camera.row_focal * camera.half_plane / 12
    )
    looks, table = draw_looks(3, 1.0, of_face=False)
    world, sprites = draw_scene(4, 3)
    images = []
    for view, samples in ((camera, 2), (twice, 1)):
        textures = textures_of(looks, table, Sampling(samples=samples))
        theme = scenes.plain_theme().replace(textures=textures)
        scene = scenes.scene_of(world, sprites, theme)
        images.append(
            np.asarray(
                jax.jit(lambda p, s=scene, v=view: render(s.replace(position=p), v))(scene.position)
            )
        )
    pairs = images[1].astype(int).reshape(12, 10, 2, 3)
    np.testing.assert_array_equal(images[0], pairs.sum(axis=2) // 2)
