"""Walls at any place and angle, against a slow cast, and against tiles with the same faces."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxenstein.engine.camera import Camera
from jaxenstein.engine.level import FreeWalls, Level, compile_level
from jaxenstein.engine.raycast import cast
from jaxenstein.engine.render import render
from jaxenstein.engine.scene import Scene
from jaxenstein.engine.textures import Textures
from tests.engine.test_textured import DOOM, SHAPE, draw_looks, textures_of
from tests.reference import free_walls, raycaster, scenes
from tests.reference.worlds import World, draw_world

CAMERA = Camera(4, 21, 90)
AROUND = 12


def draw_walls(seed: int, count: int) -> FreeWalls:
    """A ring of walls about the origin, and walls anywhere, of which some cross each other.

    The ends of neighbours in the ring differ by a rounding error.
    """
    rng = np.random.default_rng(seed)
    turns = (np.arange(AROUND) + rng.uniform(0, 0.8, AROUND)) * (2 * np.pi / AROUND)
    corners = np.stack([np.cos(turns), np.sin(turns)], axis=1) * rng.uniform(4, 9, (AROUND, 1))
    loose = rng.uniform(-8, 8, (2, count - AROUND, 2))
    # Seen from within, angles grow to the right.
    left = np.concatenate([corners, loose[0]]).astype(np.float32)
    right = np.concatenate([np.roll(corners, -1, axis=0), loose[1]]).astype(np.float32)
    aside = rng.choice([-np.inf, np.inf], (AROUND, 2)).astype(np.float32)
    right[:AROUND] = np.nextafter(right[:AROUND], aside)
    return FreeWalls(left, right, rng.integers(2, 256, count).astype(np.uint8))


def draw_poses(seed: int, walls: FreeWalls, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Places near the origin; every second heading is straight at an end of a wall."""
    rng = np.random.default_rng(seed)
    places = rng.uniform(-1.5, 1.5, (count, 2)).astype(np.float32)
    way = np.asarray(walls.left)[rng.integers(0, len(walls.left), count)] - places
    at_end = np.arctan2(way[:, 1], way[:, 0])
    anywhere = rng.uniform(-np.pi, 2 * np.pi, count)
    return places, np.where(np.arange(count) % 2, at_end, anywhere).astype(np.float32)


def level_of(walls: FreeWalls) -> Level:
    tiles = compile_level(np.full((3, 3), 2, np.uint8), np.zeros((0, 2), np.int32))
    return tiles.replace(free_walls=walls)


@pytest.mark.parametrize(("count", "constant"), [(18, True), (18, False), (70, False)])
def test_random_walls_against_the_reference(count: int, constant: bool) -> None:
    """Few walls and blocks of many, as constants of the program and as arguments of it."""
    worlds = [draw_walls(seed, count) for seed in range(1 if constant else 12)]
    poses = [draw_poses(seed, walls, 96 // len(worlds)) for seed, walls in enumerate(worlds)]
    places, headings = (np.stack(part) for part in zip(*poses, strict=True))
    over_poses = jax.vmap(
        lambda level, place, heading: cast(place, heading, jnp.zeros(0, bool), level, CAMERA),
        in_axes=(None, 0, 0),
    )
    if constant:
        run = jax.jit(lambda *pose: over_poses(level_of(worlds[0]), *pose))
        hits = jax.tree.map(lambda leaf: leaf[None], run(places[0], headings[0]))
    else:
        levels = jax.tree.map(lambda *leaves: np.stack(leaves), *map(level_of, worlds))
        hits = jax.jit(jax.vmap(over_poses))(levels, places, headings)
    assert (hits.depth.dtype, hits.face.dtype, hits.wall.dtype) == (np.float32, np.int32, np.uint8)
    sures = []
    for i, walls in enumerate(worlds):
        left, right = (np.asarray(end, np.float64) for end in (walls.left, walls.right))
        for j, place in enumerate(places[i]):
            rays = raycaster.directions(float(headings[i, j]), CAMERA.width, CAMERA.field_of_view)
            wanted = free_walls.cast(left, right, place.astype(np.float64), rays)
            depth, face, along, wall = (
                np.asarray(part)[i, j] for part in (hits.depth, hits.face, hits.along, hits.wall)
            )
            sure = wanted.sure
            np.testing.assert_array_equal(face[sure], wanted.number[sure])
            np.testing.assert_allclose(depth[sure], wanted.depth[sure], rtol=1e-3)
            np.testing.assert_allclose(along[sure], wanted.along[sure], atol=2e-3)
            np.testing.assert_array_equal(wall, walls.wall[face])
            # Rays at a corner do not get out either.
            assert depth.max() < 20
            sures.append(sure)
    assert 0.9 < np.mean(sures) < 1


def faces_of(world: World) -> tuple[FreeWalls, np.ndarray, np.ndarray]:
    """The faces of a map's solid tiles as free walls.

    Also int64[L, 3], the side, row and column of each face; and int64[L], how far its left end is
    along the axis on which textures lie.
    """
    solid, found = world.solid, []
    for row, column in np.argwhere(solid):
        for side, (x, y) in enumerate(((-1, 0), (1, 0), (0, -1), (0, 1))):
            inside = 0 <= row + y < solid.shape[0] and 0 <= column + x < solid.shape[1]
            if inside and not solid[row + y, column + x]:
                # The middle of the face, and the way to its right end.
                middle = np.array([column + 0.5 + x / 2, row + 0.5 + y / 2])
                right = np.array([y, -x]) * 0.5
                begin = (row, -row - 1, -column - 1, column)[side]
                found.append((middle - right, middle + right, (side, row, column), begin))
    left, right, faces, begin = (np.array(part) for part in zip(*found, strict=True))
    labels = world.walls[faces[:, 1], faces[:, 2]]
    return FreeWalls(left.astype(np.float32), right.astype(np.float32), labels), faces, begin


def on_free_walls(textures: Textures, faces: np.ndarray, begin: np.ndarray) -> Textures:
    """The same pictures, with a row for each face."""
    assert textures.of_face is not None
    rows = textures.of_face[tuple(faces.T)]
    walls = jax.tree.map(lambda table: table[rows], textures.walls)
    across = walls.across
    walls = walls.replace(begin=(begin * across).astype(np.int32), length=across)
    return textures.replace(walls=walls, of_face=np.arange(len(faces), dtype=np.int32))


def test_walls_around_tiles_look_like_the_tiles() -> None:
    """With textures and without; each free wall is as long as a tile."""
    camera = Camera(24, 32, 75, eye=0.6, wall=1.5)
    world = draw_world(5, SHAPE, bordered=True, poses=32)
    walls, faces, begin = faces_of(world)
    assert len(walls.left) > 32
    tiles = compile_level(world.walls, world.doors)
    theme = scenes.plain_theme()
    looks, table = draw_looks(1, camera.wall, of_face=True)
    textures = textures_of(looks, table, DOOM)
    ways = [
        (tiles, theme.replace(textures=textures)),
        (
            tiles.replace(free_walls=walls),
            theme.replace(textures=on_free_walls(textures, faces, begin)),
        ),
    ]

    @jax.jit
    @jax.vmap
    def run(place, heading):
        return [
            [
                render(
                    Scene(
                        level, jnp.asarray(world.closed), place, heading, scenes.no_sprites(), look
                    ),
                    camera,
                )
                for look in (theme, textured)
            ]
            for level, textured in ways
        ]

    by_tiles, by_walls = run(world.positions, world.headings)
    for one, other in zip(by_tiles, by_walls, strict=True):
        assert one.dtype == other.dtype == np.uint8
        assert np.mean(np.asarray(one) == np.asarray(other)) > 0.998
        assert len(np.unique(one)) > 10


def test_walls_at_an_angle_are_lit_as_between_the_others() -> None:
    """Such as those of a room with eight sides; the eye is in its middle."""
    turns = (np.arange(8) - 0.5) * (np.pi / 4)
    corners = np.round(np.stack([np.cos(turns), np.sin(turns)], axis=1) * 4, 3).astype(np.float32)
    walls = FreeWalls(corners, np.roll(corners, -1, axis=0), np.full(8, 3, np.uint8))
    theme = scenes.plain_theme()
    camera = Camera(2, 1, 90, eye=50, wall=100)
    headings = (np.arange(8) * (np.pi / 4)).astype(np.float32)

    def look(heading):
        place = jnp.zeros(2, jnp.float32)
        return render(
            Scene(level_of(walls), jnp.zeros(0, bool), place, heading, scenes.no_sprites(), theme),
            camera,
        )

    colours = np.asarray(jax.jit(jax.vmap(look))(headings))[:, 1, 0].astype(float)
    # The first wall looks west, the third one north.
    ratio = colours.mean(axis=1) / colours[0].mean()
    np.testing.assert_allclose(ratio, [1, 0.9, 0.8, 0.9] * 2, atol=0.01)
