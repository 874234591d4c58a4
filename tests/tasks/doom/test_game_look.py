"""`look="game"` beside the game's own rules, drawn slowly, at recorded views."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from fidelity.doom_looks import SMALL, ours
from fidelity.doom_picture import SIZES, moved, renderers
from fidelity.doom_views import Look, Seen, View, drawn
from jaxenstein.adapters.vizdoom_buffers import picked_image
from jaxenstein.engine.camera import Camera
from jaxenstein.engine.render import render
from jaxenstein.errors import SettingError, WadError
from jaxenstein.spec import spec_of
from jaxenstein.tasks.doom.fixed import ONE
from jaxenstein.tasks.doom.game_things import ANIMATIONS
from jaxenstein.tasks.doom.view import EYE
from jaxenstein.tasks.doom.wad import Wad, find_iwad
from tests.reference.doom_picture import GOLD, Pose
from tests.tasks.doom.test_picture_reference import RECORDED, view_of

# One of so many recorded views is drawn; at least so much of the pictures is equal. Recorded views
# are whole, but for blood and the smoke of bullets, which we do not draw.
ONE_OF = 8
LEAST = {
    "my_way_home": 0.9985,
    "health_gathering_supreme": 0.9985,
    "basic": 0.985,
    "take_cover": 0.995,
    "defend_the_line": 0.99,
    "defend_the_center": 0.995,
}
CASES = [
    pytest.param(name, marks=[pytest.mark.variant] if number > 1 else [])
    for number, name in enumerate(LEAST)
]


@pytest.fixture(scope="module")
def pictures() -> Wad:
    pytest.importorskip("vizdoom")
    return Wad(find_iwad())


def made(width: int, height: int) -> tuple[Any, Any]:
    return jaxenstein.make("doom-my-way-home", look="game", width=width, height=height)


@pytest.mark.parametrize("scenario", CASES)
def test_most_pixels_match_the_game(pictures: Wad, scenario: str) -> None:
    views = [view_of(row) for row in RECORDED["views"] if row["scenario"] == scenario][::ONE_OF]
    screens = renderers(scenario, pictures)
    small, large = SIZES
    theirs = {size: [drawn(screens[size], pictures, view) for view in views] for size in SIZES}
    # Smaller frames are taken out of a screen of the game.
    expected = {
        small: theirs[small],
        SMALL: [picked_image(frame, (SMALL[1], SMALL[0])) for frame in theirs[large]],
    }
    for size, frames in expected.items():
        images = ours(scenario, views, size)
        equal = [(a == b).all(axis=-1).mean() for a, b in zip(images, frames, strict=True)]
        assert np.mean(equal) > LEAST[scenario], size
        assert (images[0] == frames[1]).all(axis=-1).mean() < 0.5


@pytest.mark.parametrize(
    ("scenario", "sprite", "places"),
    [
        ("predict_position", "HEAD", [(-544, 0), (-300, 500), (100, -500)]),
        pytest.param(
            "deathmatch",
            "CELP",
            [(200, 300), (800, 600), (1150, 400), (30, 700)],
            marks=pytest.mark.variant,
        ),
    ],
)
def test_maps_with_steps_are_drawn_flat(
    pictures: Wad, scenario: str, sprite: str, places: list[tuple[int, int]]
) -> None:
    """Walls at their own texture offsets, and a floor with a wall's texture."""
    shown = []
    for number, (x, y) in enumerate(places):
        pose = Pose(x * ONE, y * ONE, EYE * ONE, (number * 5 + 1) % 16 << 28)
        thing = Seen(Look(sprite, "A", 0, bright=False), 60 * ONE, 60 * ONE, 0)
        shown.append(View(pose, (thing,), (), 0, 0, np.zeros(0)))
    screen = renderers(scenario, pictures)[SIZES[0]]
    images = ours(scenario, shown, SIZES[0])
    for view, image in zip(shown, images, strict=True):
        expected = drawn(screen, pictures, view)
        assert (image == expected).all(axis=-1).mean() > 0.985
        other = drawn(screen, pictures, moved(view, x=ONE))
        assert (image == other).all(axis=-1).mean() < 0.9


@pytest.mark.parametrize("size", [(48, 64), (84, 84), (48, 128)])
def test_small_frames_are_pixels_of_the_screen(size: tuple[int, int]) -> None:
    small, large = Camera(*size, 90, screen=(240, 320)), Camera(240, 320, 90)
    rows, columns = (
        ((np.arange(few) + 0.5) * many / few).astype(int)
        for few, many in zip(size, (240, 320), strict=True)
    )
    slopes = large.column_slopes()[columns]
    np.testing.assert_allclose(small.column_slopes(), slopes, atol=1e-6)
    offsets = large.row_offsets()[rows] * size[0] / 240
    np.testing.assert_allclose(small.row_offsets(), offsets, atol=1e-4)


def test_vest_blinks_as_in_the_game() -> None:
    shown = ANIMATIONS["GreenArmor"].look_at(jnp.arange(39))
    np.testing.assert_array_equal(shown, [4 <= tic % 13 <= 10 for tic in range(39)])


@pytest.mark.parametrize(("name", "letters"), [("Medikit", "A"), ("Poison", "ABCDCB")])
def test_things_of_scripts_fall_and_move_as_in_the_game(name: str, letters: str) -> None:
    height, speed, frame, left = 20, 0, 0, 6
    expected = []
    for _ in range(100):
        # A tic of one of the game's actors.
        height, speed = max(height + speed, 0), speed - 1
        left -= 1
        if left == 0:
            frame, left = (frame + 1) % len(letters), 6
        expected.append((letters[frame], height))
    one = ANIMATIONS[name]
    shown = [one.looks[i] for i in np.asarray(one.look_at(jnp.arange(100)))]
    assert [(look.letter, look.height) for look in shown] == expected


def test_things_know_when_they_appeared() -> None:
    env: Any
    env, params = jaxenstein.make("doom-health-gathering-supreme")
    state = env.first_state(jax.random.key(0), params)
    appear = jax.jit(env.pickups.appear)
    born = np.zeros(len(state.number), int)
    for time in range(1, 160):
        before = np.asarray(state.number)
        state = appear(state, jax.random.key(time), jnp.int32(time)).replace(time=jnp.int32(time))
        born = np.where(np.asarray(state.number) != before, time, born)
        age = np.asarray(env.pickups.sprites(state).age)
        np.testing.assert_array_equal(age[state.present], (time - born)[state.present])
    assert len(set(born.tolist())) == 7


def test_equal_environments_share_one_atlas(pictures: Wad) -> None:
    one: Any
    own: Any
    built: Any
    one, params = made(64, 64)
    other, _ = made(84, 84)
    assert one.game_look.theme.textures.atlas is other.game_look.theme.textures.atlas
    own = jaxenstein.make("doom-my-way-home", look="game", wad=str(pictures.path))[0]
    assert own.game_look.theme.textures.atlas is one.game_look.theme.textures.atlas
    built, _ = spec_of(own, params).build()
    assert (built.look, built.wad) == ("game", str(pictures.path))


@pytest.mark.parametrize(
    ("name", "settings", "error", "message"),
    [
        ("simple", {"look": "game"}, SettingError, "look='game' is only for doom-my-way-home, "),
        ("doom-my-way-home", {"wad": "a.wad"}, SettingError, "wad needs look='game'"),
        ("doom-my-way-home", {"samples": 2}, SettingError, "samples needs look='game' or 'r"),
        (
            "doom-my-way-home",
            {"look": "game", "wad": "no/a.wad"},
            WadError,
            "no/a.wad: there is no such file",
        ),
    ],
)
def test_wrong_settings_are_refused(
    name: str, settings: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        jaxenstein.make(name, **settings)


@pytest.mark.usefixtures("pictures")
def test_labels_have_no_things_of_the_games_look_alone() -> None:
    """In an empty Deathmatch that look adds copies of the player and items that nobody can take."""
    images = []
    for look in ("plain", "game"):
        env: Any
        env, params = jaxenstein.make(
            "doom-deathmatch", look=look, observation="labels", height=48, width=64
        )
        state = env.first_state(jax.random.key(0), params)
        position = jnp.array([200 * ONE, 700 * ONE], jnp.int32)
        state = env.at_pose(state, position, jnp.zeros(2, jnp.int32), jnp.uint32(1 << 29))
        images.append(np.asarray(jax.jit(env.observe)(state, params)))
    np.testing.assert_array_equal(*images)
    corridor: Any = jaxenstein.make("doom-deadly-corridor", look="game")[0]
    pictures = {look.sprite: look.picture for look in corridor.game_look.looks}
    assert pictures["CLIP"] == pictures["SHOT"] == -1


@pytest.mark.usefixtures("pictures")
def test_weapon_of_the_game_is_not_painted_over() -> None:
    images = []
    for shown in (False, True):
        env: Any
        env, params = jaxenstein.make(
            "doom-basic", look="game", show_weapon=shown, height=48, width=64
        )
        state = env.first_state(jax.random.key(0), params)
        images.append(np.asarray(jax.jit(env.observe)(state, params)))
    np.testing.assert_array_equal(*images)


def test_eye_bobs_and_view_flashes_gold_when_armour_is_taken(pictures: Wad) -> None:
    env, params = made(64, 48)
    action = jnp.int32(env.action_names.index("forward"))
    step = jax.jit(env.transition)
    state = env.first_state(jax.random.key(0), params)
    lifts = []
    for time in range(20):
        state = step(jax.random.key(0), state, action, params)[0].replace(time=jnp.int32(time + 1))
        lifts.append(float(env.lift(state)))
    assert max(lifts) > 0 > min(lifts)
    bare = state.replace(taken=jnp.bool_(True))
    hidden = np.asarray(render(env.dressed(env.scene(bare, params), bare), env.camera)).astype(int)
    gold = (hidden * (256 - 48) + np.array(GOLD) * 48) >> 8
    np.testing.assert_array_equal(env.observe(bare, params), gold)
