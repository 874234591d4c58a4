"""`look="random"`: which pictures an episode shows, by the colours in its frames."""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import numpy as np
import pytest

import jaxenstein
from jaxenstein.engine.textures import SHADES
from jaxenstein.tasks.doom.random_look import PICTURES, random_pictures
from jaxenstein.tasks.doom.view import label_of
from jaxenstein.tasks.draws import mixed

COUNT = 4
# With these, `look_range` leaves some textures as they are.
SHARE = 0.5


def made(**settings: Any) -> tuple[Any, Any]:
    size = {"width": 64, "height": 48}
    return jaxenstein.make("doom-my-way-home", look="random", **size, **settings)


def begun(env: Any, params: Any) -> Any:
    keys = jax.vmap(jax.random.key)(np.arange(COUNT, dtype=np.uint32))
    return jax.jit(jax.vmap(lambda key: env.first_state(key, params)))(keys)


def drawn(env: Any, params: Any, states: Any, kind: str) -> np.ndarray:
    return np.asarray(jax.jit(jax.vmap(lambda s: env.draw(s, params, kind)))(states))


def numbers_of(seed: int, surfaces: int, kinds: int) -> np.ndarray:
    """The number of the picture of each texture."""
    count = surfaces + kinds
    index = np.arange(2 * count, dtype=np.uint32) * np.uint32(0x9E3779B9)
    words = mixed(mixed(np.array([seed], np.uint32)) + index)
    unit = (words >> np.uint32(8)) / 2**24
    return np.where(
        unit[:surfaces] < SHARE,
        (unit[count : count + surfaces] * PICTURES).astype(int),
        np.arange(surfaces) % PICTURES,
    )


def codes(colours: np.ndarray) -> np.ndarray:
    return colours.reshape(-1, 3).astype(int) @ [1, 256, 65536]


def shaded(number: int) -> np.ndarray:
    """The codes of all colours of a picture, in all shades."""
    light = (1 - np.arange(SHADES) / SHADES).astype(np.float32)[:, None, None, None]
    return codes((random_pictures()[number][None] * light + 0.5).astype(np.uint8))


def inner(same: np.ndarray) -> np.ndarray:
    """The pixels whose eight neighbours also have a label."""
    padded = np.pad(same, 1)
    rows, columns = same.shape
    parts = [padded[i : i + rows, j : j + columns] for i in range(3) for j in range(3)]
    return np.all(parts, axis=0)


def test_each_texture_shows_the_picture_that_the_seed_draws() -> None:
    env, params = made(look_range=SHARE)
    states = begun(env, params)
    images, labels = (drawn(env, params, states, kind) for kind in ("rgb", "labels"))
    textures = sorted({wall.texture for wall in env.doom_map.walls})
    of_surface = [*map(label_of, textures), 0, 1]
    checked, changed = set(), 0
    for seed, image, seen in zip(np.asarray(states.look), images, labels, strict=True):
        numbers = numbers_of(int(seed), len(of_surface), len(set(env.theme.sprite_labels)))
        for surface, label in enumerate(of_surface):
            pixels = codes(image[inner(seen == label)])
            assert np.isin(pixels, shaded(numbers[surface])).all()
            if len(pixels) > 20:
                checked.add(surface)
                changed += int(numbers[surface] != surface % PICTURES)
                assert not np.isin(pixels, shaded((numbers[surface] + 1) % PICTURES)).all()
    assert len(checked) > 4
    assert 0 < changed < sum(len(set(seen.ravel())) for seen in labels)


def test_things_have_shades_and_their_own_one_without_a_range() -> None:
    env: Any
    env, params = jaxenstein.make("doom-health-gathering", look="random", width=64, height=48)
    states = begun(env, params)
    own: Any = dataclasses.replace(env, look_range=0.0)
    looks = jax.device_get(jax.vmap(lambda s: env.dressed(env.scene(s, params), s).theme)(states))
    plain = jax.device_get(jax.vmap(lambda s: own.dressed(own.scene(s, params), s).theme)(states))
    assert len(set(looks.textures.cutouts.first[:, 0].tolist())) > 1
    table = env.random_look.things
    assert set(looks.textures.cutouts.first[:, 0].tolist()) <= set(table[:, 0].tolist())
    np.testing.assert_array_equal(plain.textures.cutouts.first, table[:1].repeat(COUNT, 0))
    walls = np.unique(plain.textures.walls.first, axis=0)
    assert len(walls) == 1


def test_only_the_look_is_drawn_with_the_same_keys() -> None:
    env, params = made()
    states, rest = begun(env, params), begun(dataclasses.replace(env, look="plain"), params)
    assert len(set(np.asarray(states.look).tolist())) == COUNT
    # The eye bobs only in pictures of the game's screen.
    assert states.gait is not None
    assert rest.gait is None
    same = jax.tree.leaves(states.replace(look=None, gait=None))
    for one, other in zip(same, jax.tree.leaves(rest), strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("id", ["doom-deathmatch", "doom-predict-position"])
def test_scenarios_without_the_games_look_have_random_ones(id: str) -> None:
    env, params = jaxenstein.make(id, look="random", width=32, height=24)
    scene = jax.eval_shape(
        lambda k: env.observe(env.first_state(k, params), params), jax.random.key(0)
    )
    assert (scene.shape, scene.dtype) == ((24, 32, 3), np.uint8)
