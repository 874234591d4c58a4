"""RND: what it rewards, what it learns, what it leaves alone."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("flax")

from tests.baselines.bonuses.rollouts import KEY, bonus_of, experience, leaves, numbers_of, train

NUMBERS = numbers_of("rnd")


@pytest.fixture(scope="module")
def trained():
    bonus = bonus_of("rnd")
    before = bonus.init(KEY)
    return bonus, before, train(bonus, before, experience(), NUMBERS, 150)[0]


def test_rnd_rewards_what_a_step_led_to(trained):
    bonus, state, _ = trained
    data = experience()
    reward, _, _ = jax.jit(bonus.reward)(state, NUMBERS, data)
    error = bonus.error(state, data.obs)
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
        return np.mean(np.asarray(bonus.error(state, data.obs))[1:][wanted])

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
    state, reward = bonus.init(KEY), jax.jit(bonus.reward)
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
        error = bonus.error(state.replace(pixels=used), led_to)
        np.testing.assert_allclose(metrics["rnd_error"], jnp.mean(error), rtol=1e-4)
        (whitened,), _ = bonus._whiten(used, led_to, jnp.float32)
        mean, deviation = (np.asarray(a)[..., 0] for a in (used[0][0].mean, used[0][0].deviation))
        expected = np.clip((frames - mean) / deviation, -5, 5)
        np.testing.assert_allclose(whitened[..., 0], expected, atol=2e-3)
