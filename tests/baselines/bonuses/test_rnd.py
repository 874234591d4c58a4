"""RND: what it rewards, what it learns, what it leaves alone."""

import dataclasses
from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("flax")

from jaxenstein.errors import SettingError
from tests.baselines.bonuses.rollouts import (
    ACTIONS,
    BATCH,
    KEY,
    bonus_of,
    experience,
    leaves,
    loop_of,
    numbers_of,
    train,
)

NUMBERS = numbers_of("rnd")


@pytest.fixture(scope="module")
def trained():
    bonus = bonus_of("rnd")
    before = jax.jit(bonus.init)(KEY)
    return bonus, before, train(bonus, before, experience(), NUMBERS, 150)[0]


def test_rnd_rewards_what_a_step_led_to(trained):
    bonus, state, _ = trained
    data = experience()
    reward, _, _ = jax.jit(bonus.reward)(state, NUMBERS, data)
    error = jax.jit(bonus.error)(state, data.obs)
    np.testing.assert_allclose(reward, error[1:], rtol=1e-5)
    assert np.all(np.asarray(error) > 0)


def test_rnd_trains_the_predictor_alone(trained):
    _, before, after = trained
    for a, b in zip(leaves(before.target), leaves(after.target), strict=True):
        np.testing.assert_array_equal(a, b)
    pairs = zip(leaves(before.predictor), leaves(after.predictor), strict=True)
    assert all(not np.array_equal(a, b) for a, b in pairs)


def test_rnd_falls_where_it_has_been(trained):
    bonus, before, after = trained
    seen, unseen = experience(), experience(seed=1)
    wanted = ~np.asarray(seen.ended)

    def mean(state, data):
        return np.mean(np.asarray(jax.jit(bonus.error)(state, data.obs))[1:][wanted])

    fall, other = (mean(after, data) / mean(before, data) for data in (seen, unseen))
    assert fall < 0.1
    assert fall < 0.8 * other


def test_rnd_ignores_the_observations_after_ends(trained):
    bonus, before, _ = trained
    data = experience()
    after_end = jnp.concatenate([jnp.zeros((1, 4), bool), data.ended])
    frames = jnp.where(after_end[..., None, None], jnp.uint8(7), data.obs[0])
    changed = data.replace(obs=(frames, data.obs[1]))
    one, other = (train(bonus, before, d, NUMBERS, 2)[0] for d in (data, changed))
    for a, b in zip(leaves(one.predictor), leaves(other.predictor), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-6)


def test_no_frames_at_all_train_nothing(trained):
    bonus, before, _ = trained
    state, metrics = train(bonus, before, experience(), numbers_of("rnd", rnd_fraction=0), 1)
    assert float(metrics["rnd_loss"]) == 0
    for a, b in zip(leaves(before.predictor), leaves(state.predictor), strict=True):
        np.testing.assert_array_equal(a, b)


def test_pixel_statistics_are_those_of_all_frames_and_used_before_they_change():
    bonus = bonus_of("rnd", rnd_normalise_observations=True)
    state, reward = jax.jit(bonus.init)(KEY), jax.jit(bonus.reward)
    seen = []
    for seed in range(3):
        data = experience(seed)
        frames = np.asarray(data.obs[0])[1:] / 255
        pixels = state.pixels
        _, state, metrics = reward(state, NUMBERS, data)
        seen.append(frames)
        every = np.concatenate(seen).reshape(-1, 8, 8, 1)
        np.testing.assert_allclose(state.pixels[0][0].mean, every.mean(0), atol=1e-5)
        np.testing.assert_allclose(state.pixels[0][0].variance, every.var(0), atol=1e-5)
        used = state.pixels if seed == 0 else pixels
        led_to = jax.tree.map(lambda leaf: leaf[1:], data.obs)
        error = jax.jit(bonus.error)(state.replace(pixels=used), led_to)
        np.testing.assert_allclose(metrics["rnd_error"], jnp.mean(error), rtol=1e-4)
        (whitened,), _ = bonus._whiten(used, led_to, jnp.float32)
        mean, deviation = (np.asarray(a)[..., 0] for a in (used[0][0].mean, used[0][0].deviation))
        expected = np.clip((frames - mean) / deviation, -5, 5)
        np.testing.assert_allclose(whitened[..., 0], expected, atol=2e-3)


class Brightening:
    """Frames of environment n are 10 n + 3 t all over after t steps; a number is the action."""

    num_actions = ACTIONS

    def reset(self, keys: Any) -> Any:
        return None, jnp.zeros(BATCH, jnp.int32)

    def step(self, keys: Any, state: Any, action: Any) -> Any:
        shade = 10 * jnp.arange(BATCH, dtype=jnp.int32) + 3 * (state + 1)
        frames = jnp.broadcast_to(shade.astype(jnp.uint8)[:, None, None], (BATCH, 8, 8))
        vector = jnp.stack([action, 0 * action], axis=-1).astype(jnp.float32)
        return SimpleNamespace(state=state + 1, obs=(frames, vector))


def test_whitening_begins_with_random_play():
    steps, own = 40, {"rnd_normalise_observations": True, "rnd_warm_up": 40}
    loop = dataclasses.replace(loop_of("rnd", **own), simulator=Brightening())  # type: ignore[arg-type]
    bonus: Any = loop.bonus
    before = bonus.init(KEY)
    state = jax.jit(loop._warm_up)(before, KEY)
    (images,), vector = state.pixels
    shades = 10 * np.arange(BATCH) + 3 * (1 + np.arange(steps))[:, None]
    assert int(images.count) == int(vector.count) == steps * BATCH
    np.testing.assert_allclose(images.mean, np.full((8, 8, 1), shades.mean() / 255), rtol=1e-5)
    np.testing.assert_allclose(images.variance, np.full((8, 8, 1), (shades / 255).var()), rtol=1e-4)
    # Of three equally frequent actions; five standard errors of 160 draws.
    np.testing.assert_allclose(vector.mean, [1.0, 0.0], atol=0.33)
    np.testing.assert_allclose(vector.variance, [2 / 3, 0.0], atol=0.2)
    for a, b in zip(leaves(before.predictor), leaves(state.predictor), strict=True):
        np.testing.assert_array_equal(a, b)
    data = experience()
    _, _, metrics = bonus.reward(state, NUMBERS, data)
    error = bonus.error(state, data.led_to)
    np.testing.assert_allclose(metrics["rnd_error"], jnp.mean(error), rtol=1e-4)
    off = loop_of("rnd", rnd_warm_up=40)
    assert off._warm_up(before, KEY) is before


def test_the_predictor_may_be_deeper():
    def layers(bonus: Any) -> list[int]:
        state = bonus.init(KEY)
        return [len(part["embedding"]["params"]) for part in (state.target, state.predictor)]

    assert layers(bonus_of("rnd")) == [3, 3]
    assert layers(bonus_of("rnd", rnd_deeper=2)) == [3, 5]
    data, bonus = experience(), bonus_of("rnd", rnd_deeper=2)
    before = bonus.init(KEY)
    after, _ = train(bonus, before, data, NUMBERS, 20)
    assert jnp.mean(bonus.error(after, data.obs)) < jnp.mean(bonus.error(before, data.obs))
    with pytest.raises(SettingError, match="rnd_deeper must be a whole number from 0, not -1"):
        bonus_of("rnd", rnd_deeper=-1)
