"""`look="game"` beside the game's own rules, drawn slowly, at recorded views."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from fidelity.doom_picture import renderers
from fidelity.doom_views import View, drawn
from jaxenstein.engine.render import render
from jaxenstein.errors import SettingError, WadError
from jaxenstein.spec import spec_of
from jaxenstein.tasks.doom.fixed import ONE
from jaxenstein.tasks.doom.game_look import ANIMATIONS
from jaxenstein.tasks.doom.view import EYE
from jaxenstein.tasks.doom.wad import Wad, find_iwad
from tests.reference.doom_picture import GOLD
from tests.tasks.doom.test_picture_reference import RECORDED, view_of

# Every so many of the recorded views; at least so much of each picture is equal.
EACH, LEAST = 8, {"my_way_home": 0.99, "health_gathering_supreme": 0.985}


@pytest.fixture(scope="module")
def pictures() -> Wad:
    pytest.importorskip("vizdoom")
    return Wad(find_iwad())


def made(scenario: str, width: int, height: int) -> tuple[Any, Any]:
    name = f"doom-{scenario.replace('_', '-')}"
    return jaxenstein.make(name, look="game", width=width, height=height)


def ours(scenario: str, views: list[View], width: int, height: int) -> list[np.ndarray]:
    """Our pictures of views."""
    env, params = made(scenario, width, height)
    first = env.first_state(jax.random.key(0), params)
    frames = [(one.sprite, frame.letter) for one in env.animations for frame in one.frames]

    @jax.jit
    def draw(state: Any, lift: jax.Array, sprites: Any) -> jax.Array:
        scene = env.dressed(env.scene(state, params), state)
        sprites = sprites.replace(position=env.to_tiles(sprites.position))
        return render(scene.replace(lift=lift, sprites=sprites), env.camera, "rgb")

    found = []
    for view in views:
        pose, still = view.pose, jnp.zeros(2, jnp.int32)
        place = jnp.array([pose.x, pose.y], jnp.int32)
        state = env.at_pose(first, place, still, jnp.uint32(pose.angle))
        sprites = jax.tree.map(np.zeros_like, env.scene(state, params).sprites)
        places = np.zeros(sprites.position.shape, np.int32)
        for number, seen in enumerate(view.things):
            places[number] = seen.x, seen.y
            sprites.picture[number] = frames.index((seen.look.sprite, seen.look.frame))
            sprites.visible[number] = True
        lift = np.float32((pose.z - EYE * ONE) / (ONE * env.unit))
        image = np.asarray(draw(state, lift, sprites.replace(position=places))).astype(int)
        gold = np.array(GOLD) * view.gold
        found.append(((image * (256 - view.gold) + gold) >> 8).astype(np.uint8))
    return found


@pytest.mark.parametrize("scenario", LEAST)
def test_most_pixels_are_those_of_the_game(pictures: Wad, scenario: str) -> None:
    views = [view_of(row) for row in RECORDED["views"] if row["scenario"] == scenario][::EACH]
    screens = renderers(scenario, pictures)
    theirs = {
        size: [drawn(screen, pictures, view) for view in views] for size, screen in screens.items()
    }
    # Smaller frames are taken out of the screen of 320 by 240.
    theirs[64, 48] = [image[2::5, 2::5] for image in theirs.pop((320, 240))]
    for size, expected in theirs.items():
        images = ours(scenario, views, *size)
        equal = [(a == b).all(axis=-1).mean() for a, b in zip(images, expected, strict=True)]
        assert np.mean(equal) > LEAST[scenario], size
        other = (images[0] == expected[1]).all(axis=-1).mean()
        assert other < 0.5


def test_the_vest_blinks_as_in_the_game() -> None:
    shown = jax.vmap(ANIMATIONS["GreenArmor"].frame_at)(jnp.arange(39))
    np.testing.assert_array_equal(shown, [4 <= tic % 13 <= 10 for tic in range(39)])


def test_equal_environments_share_one_atlas(pictures: Wad) -> None:
    one: Any
    own: Any
    built: Any
    one, params = made("my_way_home", 64, 64)
    other, _ = made("my_way_home", 84, 84)
    assert one.game_theme.textures.atlas is other.game_theme.textures.atlas
    own = jaxenstein.make("doom-my-way-home", look="game", wad=str(pictures.path))[0]
    assert own.game_theme.textures.atlas is one.game_theme.textures.atlas
    built, _ = spec_of(own, params).build()
    assert (built.look, built.wad) == ("game", str(pictures.path))


@pytest.mark.parametrize(
    ("name", "settings", "error", "message"),
    [
        ("doom-basic", {"look": "game"}, SettingError, "look='game' is only for doom-my-way-home"),
        ("simple", {"look": "game"}, SettingError, "look='game' is only for doom-my-way-home"),
        ("doom-my-way-home", {"wad": "a.wad"}, SettingError, "wad needs look='game'"),
        (
            "doom-my-way-home",
            {"look": "game", "wad": "no/a.wad"},
            WadError,
            "no/a.wad: there is no such file",
        ),
    ],
)
def test_wrong_settings_are_refused(
    name: str, settings: dict[str, str], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        jaxenstein.make(name, **settings)
