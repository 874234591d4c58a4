"""Monsters, missiles and weapons in the game's look, beside the game's own rules."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxenstein.engine.render import render
from jaxenstein.engine.scene import Held, Scene, Sprites
from jaxenstein.engine.textures import ADD, MEAN
from jaxenstein.tasks.doom.basic import DoomBasic
from jaxenstein.tasks.doom.fixed import ONE, direction, to_fixed
from jaxenstein.tasks.doom.game_look import game_pictures, sampling
from jaxenstein.tasks.doom.game_things import Look, Shown, dressed, side_seen
from jaxenstein.tasks.doom.game_weapon import WEAPON_LOOKS, WeaponLook, held
from jaxenstein.tasks.doom.monster_ai import turned
from jaxenstein.tasks.doom.view import EYE
from jaxenstein.tasks.doom.wad import Wad
from jaxenstein.tasks.doom.weapons import Trigger
from tests.reference.doom_nodes import GameMap, Line, Seg
from tests.reference.doom_picture import Pose, Renderer
from tests.reference.doom_things import Thing, Weapon
from tests.reference.wads import write_names, write_picture, write_textures, write_wad

SIZE = 120, 160
LOOKS = (
    Look("TROO", "A"),
    Look("PLAY", "A", picture=1),
    Look("BAL1", "A", bright=True, blend=ADD, height=32),
    Look("PUFF", "A", blend=MEAN, height=40),
)
BLENDS: tuple[Any, ...] = ("cover", "cover", "add", "mean")
WEAPON = WeaponLook("PISG", (), "PISF", WEAPON_LOOKS["pistol"].flashes)
# From these places and angles the walls that are seen are seen whole.
POSES = [Pose(-381 * ONE + 99, 30 * ONE + 7, EYE * ONE, 0), Pose(-400 * ONE, 5, 43 * ONE, 1 << 28)]


def blob(draw: np.random.Generator, height: int, width: int) -> np.ndarray:
    """int16[height, width]: random pixels with one hole, and no two runs in a column but there."""
    pixels = draw.integers(0, 256, (height, width)).astype(np.int16)
    pixels[height // 3 : height // 2, width // 3 : width // 2] = -1
    return pixels


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Wad:
    draw = np.random.default_rng(3)
    path: Path = tmp_path_factory.mktemp("wads") / "own.wad"
    shades = draw.permuted(np.tile(np.arange(256, dtype=np.uint8), (34, 1)), axis=1)
    # The game knows no colour 0 among those to which sums are rounded.
    palette = draw.integers(0, 256, (256, 3)).astype(np.uint8)
    monsters = [
        (name, write_picture(blob(draw, 50 + i, 30 + i), 14 + i, 48))
        for i, name in enumerate(["TROOA1", "TROOA2A8", "TROOA3A7", "TROOA4A6", "TROOA5"])
    ]
    path.write_bytes(write_wad([
        ("PLAYPAL", palette.tobytes()),
        ("COLORMAP", shades.tobytes()),
        ("TEXTURE1", write_textures({"BRICK9": ((128, 64), [(0, 0, 0)])})),
        ("PNAMES", write_names(["BRICK"])),
        ("P_START", b""),
        ("BRICK", write_picture(draw.integers(0, 256, (128, 64)).astype(np.int16))),
        ("P_END", b""),
        ("F_START", b""),
        ("FLOOR0_1", draw.integers(0, 256, 4096).astype(np.uint8).tobytes()),
        ("FLAT4", draw.integers(0, 256, 4096).astype(np.uint8).tobytes()),
        ("F_END", b""),
        ("S_START", b""),
        *monsters,
        ("PLAYA0", write_picture(blob(draw, 56, 33), 16, 54)),
        ("BAL1A0", write_picture(blob(draw, 40, 33), 17, 21)),
        ("PUFFA0", write_picture(blob(draw, 20, 22), 8, 9)),
        ("PISGA0", write_picture(blob(draw, 92, 82), -125, -97)),
        ("PISFA0", write_picture(blob(draw, 30, 32), -144, -69)),
        ("S_END", b""),
    ]))  # fmt: skip
    return Wad(path)


def game_map() -> GameMap:
    found, segs = DoomBasic().doom_map, []
    for wall in found.walls:
        start, end = (to_fixed(wall.x0), to_fixed(wall.y0)), (to_fixed(wall.x1), to_fixed(wall.y1))
        line = Line(start, end, wall.texture, (wall.offset * ONE, 0), from_below=False)
        segs.append(Seg(start, end, line))
    floor, ceiling = found.flats
    heights = int(found.floor) * ONE, int(found.ceiling) * ONE
    return GameMap((), (tuple(segs),), *heights, floor, ceiling, int(found.light))


def side_of(pose: Pose, place: tuple[int, int], facing: int) -> int:
    """The side that the eye sees, from the angle between heading and line of sight."""
    towards = math.degrees(math.atan2(place[1] - pose.y, place[0] - pose.x))
    return int((towards - facing / 2**32 * 360 + 202.5) % 360 // 45)


def test_things_and_weapon_are_drawn_as_in_the_game(pictures: Wad) -> None:
    """Sides, mirrors, another green, light, flash, sums and means, and what hides what."""
    draw = np.random.default_rng(0)
    environment = DoomBasic(height=SIZE[0], width=SIZE[1])
    textures, views = game_pictures(str(pictures.path), "basic", LOOKS, (WEAPON,), environment.unit)
    theme = views.themed(environment.theme, np.zeros(len(LOOKS), int))
    theme = theme.replace(textures=textures.replace(sampling=sampling(*SIZE)))
    count = 8
    looks = np.array([0, 0, 0, 0, 1, 2, 2, 3], np.int32)
    places = draw.integers([-330, -60], [40, 130], (count, 2)).astype(np.int32) * ONE
    facing = draw.integers(0, 2**32, count).astype(np.uint32)
    hands = [("A", 2.5, 36.25), ("A", 2.5, 36.25)]

    @jax.jit
    def ours(eye: jax.Array, angle: jax.Array, lift: jax.Array, glare: jax.Array) -> jax.Array:
        cosine, sine = direction(angle)
        heading = jnp.stack([cosine, -sine]).astype(jnp.float32) * np.float32(1 / ONE)
        here = jnp.ones(count, bool)
        shown = Shown(jnp.asarray(places), jnp.asarray(looks), here, jnp.asarray(facing))
        sprites = Sprites(environment.to_tiles(shown.places), views.rows(shown, eye), here)
        over = Held(
            jnp.array([1, 0], np.int32),
            jnp.array([at for _, *at in hands], np.float32),
            jnp.ones(2, bool),
        )
        position, doors = environment.to_tiles(eye), jnp.zeros(0, bool)
        level = environment.level
        scene = Scene(level, doors, position, heading, sprites, theme, lift, over, glare)
        return render(scene, environment.camera, layers=count)

    renderer, shares = Renderer(game_map(), pictures, *SIZE), []
    sprites = [pictures.sprite(look.sprite, look.letter) for look in LOOKS]
    for pose in POSES:
        for flash in (0, 16):
            things = []
            for look, (x, y), turn in zip(looks.tolist(), places.tolist(), facing, strict=True):
                side = side_of(pose, (x, y), int(turn))
                picture = dressed(LOOKS[look], sprites[look][side])
                z, bright = LOOKS[look].height * ONE, LOOKS[look].bright
                things.append(Thing(picture, x, y, z, bright, BLENDS[look]))
            weapons = [
                Weapon(pictures.sprite(name, "A")[0], *map(to_fixed, hands[0][1:]), bright=True)
                for name in ("PISG", "PISF")
            ]
            expected = renderer.draw(pose, things, weapons, flash=flash)
            bare = renderer.draw(pose, flash=flash)
            lift = np.float32((pose.z / ONE - EYE) / environment.unit)
            place = jnp.array([pose.x, pose.y], jnp.int32)
            image = np.asarray(ours(place, jnp.uint32(pose.angle), lift, jnp.int32(flash // 4)))
            assert image.dtype == np.uint8
            over = (expected != bare).any(axis=-1)
            assert over.mean() > 0.1
            shares.append((image == expected).all(axis=-1)[over].mean())
    assert np.mean(shares) > 0.97, shares


def test_sides_are_eighths_of_a_turn() -> None:
    draw = np.random.default_rng(0)
    places = draw.integers(-500, 500, (400, 2)).astype(np.int32) * ONE
    facing = draw.integers(0, 2**32, 400).astype(np.uint32)
    pose = Pose(7 * ONE, -9 * ONE, 0, 0)
    eye = jnp.array([pose.x, pose.y], jnp.int32)
    found = side_seen(eye, jnp.asarray(places), jnp.asarray(facing))
    assert found.dtype == jnp.int32
    expected = [side_of(pose, (x, y), int(f)) for (x, y), f in zip(places, facing, strict=True)]
    # The table of sines has steps of a 22nd of a degree.
    assert np.mean(np.asarray(found) == expected) > 0.99


def test_the_pistol_fires_as_in_the_game() -> None:
    """What was seen in the game from the tic of a pull of the trigger to the next one."""
    look, guns, lights = WEAPON_LOOKS["pistol"], "", []
    for tics in range(20):
        trigger = Trigger(jnp.int32(tics), jnp.bool_(False), jnp.int32(9), jnp.int32(0))
        shown, glare = held((look,), trigger, jnp.float32(8), jnp.int32(40))
        guns += look.pictures()[int(shown.picture[1])][1]
        lights.append(int(glare))
        assert bool(shown.shown[0]) == (4 <= tics <= 10)
        # It swings only when it is ready: here as far as it goes, to the left and down.
        swings = (-8 * math.sin(math.radians(45)), 8 * math.sin(math.radians(45)))
        aside, down = swings if tics == 19 else (0, 0)
        np.testing.assert_allclose(shown.place, [[aside, 32.375 + down]] * 2, atol=1e-2)
    assert guns == "AAAABBBBBBCCCCBBBBBA"
    assert lights == [0] * 4 + [4] * 7 + [0] * 9


def test_the_pistol_is_raised_as_in_the_game() -> None:
    trigger = Trigger(jnp.int32(19), jnp.bool_(False), jnp.int32(9), jnp.int32(0))
    rows = [
        float(
            held((WEAPON_LOOKS["pistol"],), trigger, jnp.float32(0), jnp.int32(tic))[0].place[0, 1]
        )
        for tic in range(10, 17)
    ]
    assert rows == [62, 56, 50, 44, 38, 32.375, 32.375]


def test_monsters_turn_by_eighths_and_face_their_enemy() -> None:
    class Few:
        facing = jnp.array([0, 3 << 29, (3 << 29) + 99, 1 << 29, 7 << 29], jnp.uint32)
        direction = jnp.array([4, 3, 1, 8, 0], jnp.int32)

    offset = jnp.array([[5, 0]] * 4 + [[0, 5]], jnp.int32) * ONE
    walks: Any = Few()
    all_step, none = jnp.ones(5, bool), jnp.zeros(5, bool)
    found = turned(walks, all_step, none, offset)
    assert found.dtype == jnp.uint32
    np.testing.assert_array_equal(found, np.array([1, 3, 2, 1, 0], np.uint32) << 29)
    np.testing.assert_array_equal(turned(walks, none, none, offset), Few.facing)
    faces = np.asarray(turned(walks, all_step, all_step, offset)).astype(np.int64)
    np.testing.assert_allclose(faces, [0, 0, 0, 0, 1 << 30], atol=1 << 12)
