"""RND: its rewards, its training, and what it does not change."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("flax")

from tests.baselines.bonuses.rollouts import (
    KEY,
    bonus_of,
    experience,
    leaves,
    numbers_of,
    train,
)

NUMBERS = numbers_of("rnd")


@pytest.fixture(scope="module")
def trained():
    bonus = bonus_of("rnd")
    before = jax.jit(bonus.init)(KEY)
    return bonus, before, train(bonus, before, experience(), NUMBERS, 150)[0]


def test_rnd_rewards_the_next_observation(trained):
    bonus, state, _ = trained
    data = experience()
    reward, _, _ = jax.jit(bonus.reward)(state, NUMBERS, data)
    error = jax.jit(bonus.error)(state, data.obs)
    np.testing.assert_allclose(reward, error[1:], rtol=1e-5)
    assert np.all(np.asarray(error) > 0)


def test_rnd_trains_only_the_predictor(trained):
    _, before, after = trained
    for a, b in zip(leaves(before.target), leaves(after.target), strict=True):
        np.testing.assert_array_equal(a, b)
    pairs = zip(leaves(before.predictor), leaves(after.predictor), strict=True)
    assert all(not np.array_equal(a, b) for a, b in pairs)


def test_rnd_error_falls_on_seen_observations(trained):
    bonus, before, after = trained
    seen, unseen = experience(), experience(seed=1)
    wanted = ~np.asarray(seen.ended)

    def mean(state, data):
        return np.mean(np.asarray(jax.jit(bonus.error)(state, data.obs))[1:][wanted])

    fall, other = (mean(after, data) / mean(before, data) for data in (seen, unseen))
    assert fall < 0.1
    assert fall < 0.8 * other


def test_rnd_ignores_observations_after_episode_ends(trained):
    bonus, before, _ = trained
    data = experience()
    after_end = jnp.concatenate([jnp.zeros((1, 4), bool), data.ended])
    frames = jnp.where(after_end[..., None, None], jnp.uint8(7), data.obs[0])
    changed = data.replace(obs=(frames, data.obs[1]))
    one, other = (train(bonus, before, d, NUMBERS, 2)[0] for d in (data, changed))
    for a, b in zip(leaves(one.predictor), leaves(other.predictor), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-6)


def test_rnd_learns_nothing_if_every_step_ends_an_episode(trained):
    bonus, before, _ = trained
    data = experience()
    data = data.replace(ended=jnp.ones_like(data.ended))
    state, metrics = train(bonus, before, data, NUMBERS, 1)
    assert float(metrics["rnd_loss"]) == 0
    for a, b in zip(leaves(before.predictor), leaves(state.predictor), strict=True):
        np.testing.assert_array_equal(a, b)
