"""E3B against inverses of the whole matrix, recomputed for every step."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("flax")

from jaxenstein.baselines.bonuses.e3b import (
    STRIDE,
    TEMPERATURE,
    sample_offsets,
    temporal_loss,
)
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

BOTH = pytest.mark.parametrize("embedding", ["inverse", "temporal"])


def embeddings(bonus, state, data):
    return np.asarray(bonus._embedding.embed(state.params, data.led_to), np.float64)


@pytest.mark.parametrize("ridge", [0.1, 2.0])
def test_e3b_is_the_quadratic_form_of_the_inverse_covariance(ridge):
    bonus = bonus_of("e3b")
    state, reward = bonus.init(KEY), jax.jit(bonus.reward)
    numbers = numbers_of("e3b", e3b_lambda=ridge)
    start = ridge * np.eye(6)
    matrices, counted = [start] * BATCH, 0
    # Episodes continue from one rollout to the next.
    for seed in range(3):
        data = experience(seed)
        phi, ended = embeddings(bonus, state, data), np.asarray(data.ended)
        result, state, _ = reward(state, numbers, data)
        for t in range(STEPS):
            for n in range(BATCH):
                if ended[t, n]:
                    # The next observation begins the next episode.
                    matrices[n] = start + np.outer(phi[t, n], phi[t, n])
                    continue
                expected = phi[t, n] @ np.linalg.inv(matrices[n]) @ phi[t, n]
                np.testing.assert_allclose(result[t, n], expected, rtol=1e-4)
                matrices[n] = matrices[n] + np.outer(phi[t, n], phi[t, n])
                counted += 1
        inverses = ridge * np.linalg.inv(np.stack(matrices))
        np.testing.assert_allclose(state.inverse, inverses, atol=1e-5)
    assert 0 < counted < 3 * STEPS * BATCH


def test_embeddings_are_centred_unit_vectors():
    bonus = bonus_of("e3b")
    phi = embeddings(bonus, bonus.init(KEY), experience())
    np.testing.assert_allclose(phi.mean(-1), 0, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(phi, axis=-1), 1, rtol=1e-5)
    assert np.std(phi, axis=(0, 1)).min() > 1e-3


@BOTH
def test_training_updates_networks_but_not_matrices(embedding):
    bonus = bonus_of("e3b", e3b_embedding=embedding)
    before = bonus.init(KEY)
    after, metrics = train(bonus, before, experience(), numbers_of("e3b"), 1)
    np.testing.assert_array_equal(before.inverse, after.inverse)
    pairs = zip(leaves(before.params), leaves(after.params), strict=True)
    assert all(not np.array_equal(a, b) for a, b in pairs)
    assert 0 < float(metrics["e3b_gradient_norm"]) < np.inf
    assert ("inverse" in before.params) == (embedding == "inverse")


def test_temporal_loss_separates_neighbours_from_other_steps():
    rng, (steps, batch) = np.random.default_rng(0), (11, 3)
    phi = rng.normal(size=(steps + 1, batch, 5)).astype(np.float32)
    phi /= np.linalg.norm(phi, axis=-1, keepdims=True)
    ended = rng.random((steps, batch)) < 0.15
    offset = rng.integers(1, 5, (steps, batch)).astype(np.int32)
    pairs = []
    for t in range(0, steps, STRIDE):
        for n in range(batch):
            then = min(t + offset[t, n], steps)
            if not ended[t:then, n].any():
                pairs.append((phi[t, n].astype(np.float64), phi[then, n].astype(np.float64)))
    assert 3 < len(pairs) < 9
    losses, right = [], []
    for index, (now, _) in enumerate(pairs):
        scores = np.array([now @ near / TEMPERATURE for _, near in pairs])
        losses.append(np.log(np.exp(scores).sum()) - scores[index])
        right.append(scores[index] >= scores.max())
    loss, metrics = temporal_loss(jnp.asarray(phi), jnp.asarray(ended), jnp.asarray(offset))
    np.testing.assert_allclose(loss, np.mean(losses), rtol=1e-5)
    np.testing.assert_allclose(metrics["e3b_temporal_accuracy"], np.mean(right), rtol=1e-6)


def test_constant_embedding_has_chance_accuracy():
    phi, offset = jnp.ones((STRIDE + 1, 3, 1)), jnp.ones((STRIDE, 3), jnp.int32)
    loss, metrics = temporal_loss(phi, jnp.zeros((STRIDE, 3), bool), offset)
    np.testing.assert_allclose(loss, np.log(3), rtol=1e-6)
    np.testing.assert_allclose(metrics["e3b_temporal_accuracy"], 1 / 3, rtol=1e-6)


def test_temporal_loss_is_zero_if_every_step_ends_an_episode():
    phi, ended = jnp.ones((5, 2, 3)), jnp.ones((4, 2), bool)
    total = lambda phi: temporal_loss(phi, ended, jnp.ones((4, 2), jnp.int32))[0]  # noqa: E731
    loss, gradient = jax.value_and_grad(total)(phi)
    assert loss == 0
    np.testing.assert_array_equal(gradient, jnp.zeros_like(phi))


def test_sampled_offsets_cover_one_to_the_reach():
    assert set(np.unique(sample_offsets(KEY, (64, 8), 3))) == {1, 2, 3}


@pytest.mark.slow
def test_training_pulls_together_only_frames_near_in_time():
    # Each environment sees its own frame with a little noise. The eight hidden units of the
    # other tests may all die here, by chance of rounding: then all frames are one to them.
    rng = np.random.default_rng(1)
    bonus = bonus_of("e3b", e3b_embedding="temporal", e3b_hidden=64, e3b_latent=16)
    own = rng.integers(40, 216, (1, BATCH, 8, 8))
    frames = (own + rng.integers(-9, 9, (STEPS + 1, BATCH, 8, 8))).astype(np.uint8)
    data = experience()
    data = data.replace(
        obs=(jnp.asarray(frames), jnp.zeros_like(data.obs[1])), ended=jnp.zeros_like(data.ended)
    )
    before = bonus.init(KEY)
    after, _ = train(bonus, before, data, numbers_of("e3b"), 150)
    others = ~np.eye(BATCH, dtype=bool)
    alike = []
    for state in (before, after):
        phi = embeddings(bonus, state, data)
        alike.append((np.einsum("tnl,tml->nm", phi, phi) / STEPS)[others].mean())
    assert alike[0] > 0.6
    assert alike[1] < 0.4
    same = np.einsum("tnl,snl->ts", phi, phi) / BATCH
    assert same[~np.eye(STEPS, dtype=bool)].mean() > 0.7
