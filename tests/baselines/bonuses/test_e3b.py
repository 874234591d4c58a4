"""E3B against inverses of the whole matrix, computed anew for every step."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("flax")

from tests.baselines.bonuses.rollouts import (
    BATCH,
    KEY,
    STEPS,
    bonus_of,
    experience,
    leaves,
    numbers_of,
    train,
)  # fmt: skip


def embeddings(bonus, state, data):
    return np.asarray(bonus._model.embed(state.params, data.led_to), np.float64)


@pytest.mark.parametrize("ridge", [0.1, 2.0])
def test_e3b_is_the_quadratic_form_of_the_episodes_inverse(ridge):
    bonus = bonus_of("e3b")
    state, reward = bonus.init(KEY), jax.jit(bonus.reward)
    numbers = numbers_of("e3b", e3b_lambda=ridge)
    start = ridge * np.eye(6)
    matrices, counted = [start] * BATCH, 0
    # Episodes go on from one rollout to the next.
    for seed in range(3):
        data = experience(seed)
        phi, ended = embeddings(bonus, state, data), np.asarray(data.ended)
        result, state, _ = reward(state, numbers, data)
        for t in range(STEPS):
            for n in range(BATCH):
                if ended[t, n]:
                    matrices[n] = start
                    continue
                expected = phi[t, n] @ np.linalg.inv(matrices[n]) @ phi[t, n]
                np.testing.assert_allclose(result[t, n], expected, rtol=1e-4)
                matrices[n] = matrices[n] + np.outer(phi[t, n], phi[t, n])
                counted += 1
        inverses = ridge * np.linalg.inv(np.stack(matrices))
        np.testing.assert_allclose(state.inverse, inverses, atol=1e-5)
    assert 0 < counted < 3 * STEPS * BATCH


def test_embeddings_are_centred_and_of_length_one():
    bonus = bonus_of("e3b")
    phi = embeddings(bonus, bonus.init(KEY), experience())
    np.testing.assert_allclose(phi.mean(-1), 0, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(phi, axis=-1), 1, rtol=1e-5)
    assert np.std(phi, axis=(0, 1)).min() > 1e-3


def test_what_was_seen_n_times_is_worth_one_over_lambda_and_n():
    bonus, data = bonus_of("e3b"), experience()
    same = jax.tree.map(lambda leaf: jnp.broadcast_to(leaf[:1], leaf.shape), data.obs)
    still = data.replace(obs=same, ended=jnp.zeros_like(data.ended))
    result, _, _ = jax.jit(bonus.reward)(bonus.init(KEY), numbers_of("e3b"), still)
    expected = 1 / (0.1 + np.arange(STEPS))
    np.testing.assert_allclose(result, np.tile(expected[:, None], BATCH), rtol=1e-4)


def test_training_moves_the_networks_and_not_the_matrices():
    bonus = bonus_of("e3b")
    before = bonus.init(KEY)
    after, metrics = train(bonus, before, experience(), numbers_of("e3b"), 1)
    np.testing.assert_array_equal(before.inverse, after.inverse)
    pairs = zip(leaves(before.params), leaves(after.params), strict=True)
    assert all(not np.array_equal(a, b) for a, b in pairs)
    assert 0 < float(metrics["e3b_gradient_norm"]) < np.inf
