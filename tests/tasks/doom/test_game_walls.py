"""Walls at any angle in the game's look, beside the game's own rules, with pictures made here."""

from __future__ import annotations

import functools
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxenstein.engine.render import render
from jaxenstein.engine.scene import Scene
from jaxenstein.tasks.doom.defend_the_center import DoomDefendTheCenter
from jaxenstein.tasks.doom.fixed import ONE, direction, to_fixed
from jaxenstein.tasks.doom.game_look import game_pictures, sampling
from jaxenstein.tasks.doom.game_things import Look
from jaxenstein.tasks.doom.game_walls import free_walls
from jaxenstein.tasks.doom.my_way_home import DoomMyWayHome
from jaxenstein.tasks.doom.view import EYE
from jaxenstein.tasks.doom.wad import Wad
from tests.reference.doom_nodes import GameMap, Line, Seg
from tests.reference.doom_picture import Pose, Renderer
from tests.reference.scenes import no_sprites
from tests.reference.wads import write_names, write_picture, write_textures, write_wad

MAP = "defend-the-center"
# Far from walls, and beside some of them. From all these places every wall is seen whole, so that
# their order does not matter.
POSES = [Pose(0, 0, EYE * ONE, 5 << 27), Pose(9 * ONE + 77, -5 * ONE, 43 * ONE + 99, 3 << 29)]
POSES += [Pose(-700 * ONE, 41 * ONE + 5, EYE * ONE, turn << 28) for turn in (3, 7, 11)]
POSES += [Pose(610 * ONE + 7, 290 * ONE, EYE * ONE, turn << 27) for turn in (1, 9, 25)]


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Wad:
    """A file with random pictures of the wall, the floor and the ceiling of the map."""
    draw = np.random.default_rng(0)
    path: Path = tmp_path_factory.mktemp("wads") / "own.wad"
    shades = draw.permuted(np.tile(np.arange(256, dtype=np.uint8), (34, 1)), axis=1)
    flats = draw.integers(0, 256, (2, 64, 64), dtype=np.uint8)
    path.write_bytes(write_wad([
        ("PLAYPAL", draw.permutation(256 * 3).astype(np.uint8).tobytes()),
        ("COLORMAP", shades.tobytes()),
        ("TEXTURE1", write_textures({"TANROCK2": ((128, 64), [(0, 0, 0)])})),
        ("PNAMES", write_names(["ROCK"])),
        ("P_START", b""),
        ("ROCK", write_picture(draw.integers(0, 256, (128, 64)).astype(np.int16))),
        ("P_END", b""),
        ("F_START", b""),
        ("FLOOR0_5", flats[0].tobytes()),
        ("CEIL4_1", flats[1].tobytes()),
        ("F_END", b""),
        ("S_START", b""),
        ("ARM1A0", write_picture(np.zeros((1, 1), np.int16))),
        ("S_END", b""),
    ]))  # fmt: skip
    return Wad(path)


@functools.cache
def game_map() -> GameMap:
    """The map for the reference: whole walls, in any order."""
    found, segs = DoomDefendTheCenter().doom_map, []
    for wall in found.walls:
        start, end = (to_fixed(wall.x0), to_fixed(wall.y0)), (to_fixed(wall.x1), to_fixed(wall.y1))
        line = Line(start, end, wall.texture, (wall.offset * ONE, 0), from_below=False)
        segs.append(Seg(start, end, line))
    return GameMap(
        nodes=(),
        pieces=(tuple(segs),),
        floor=to_fixed(found.floor),
        ceiling=to_fixed(found.ceiling),
        floor_flat=found.flats[0],
        ceiling_flat=found.flats[1],
        light=int(found.light),
    )


def ours(pictures: Wad, height: int, width: int) -> np.ndarray:
    """uint8[poses, height, width, 3]."""
    env = DoomDefendTheCenter(height=height, width=width)
    textures = game_pictures(str(pictures.path), MAP, (Look("ARM1"),), (), env.unit)[0]
    theme = env.theme.replace(textures=textures.replace(sampling=sampling(height, width)))
    level = env.level.replace(free_walls=free_walls(env.doom_map, env.tiles))

    def look(place: jax.Array, lift: jax.Array, angle: jax.Array) -> jax.Array:
        cosine, sine = direction(angle)
        heading = jnp.stack([cosine, -sine]).astype(jnp.float32) * np.float32(1 / ONE)
        position, doors = env.to_tiles(place), jnp.zeros(0, bool)
        scene = Scene(level, doors, position, heading, no_sprites(), theme, lift)
        return render(scene, env.camera)

    places = np.array([(pose.x, pose.y) for pose in POSES], np.int32)
    lifts = np.array([(pose.z / ONE - EYE) / env.unit for pose in POSES], np.float32)
    angles = np.array([pose.angle for pose in POSES], np.uint32)
    return np.asarray(jax.jit(jax.vmap(look))(places, lifts, angles))


@pytest.mark.parametrize(
    ("size", "screen", "each"),
    [((120, 160), (120, 160), np.s_[:, :]), ((48, 64), (240, 320), np.s_[2::5, 2::5])],
    ids=["screen", "small"],
)
def test_oblique_walls_are_those_of_the_game(pictures: Wad, size, screen, each) -> None:
    """Frames of a screen, and smaller ones that are taken out of a screen."""
    renderer = Renderer(game_map(), pictures, *screen)
    expected = [renderer.draw(pose)[each] for pose in POSES]
    found = ours(pictures, *size)
    assert found.dtype == np.uint8
    shares = [np.mean((a == b).all(axis=-1)) for a, b in zip(found, expected, strict=True)]
    assert np.mean(shares) > 0.9975, shares
    assert np.mean((found[0] == expected[1]).all(axis=-1)) < 0.2


def test_walls_on_the_lattice_are_not_free() -> None:
    env = DoomMyWayHome()
    assert free_walls(env.doom_map, env.tiles) is None
    assert DoomDefendTheCenter().level.free_walls is None
