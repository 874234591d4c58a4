import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("flax")

from jaxenstein.baselines.learning import bonus, running_stats


@pytest.mark.parametrize("cuts", [[], [1], [3, 4, 90]])
def test_any_chunking_gives_the_statistics_of_all(cuts):
    values = np.random.default_rng(0).normal(50, 3, (100, 2, 5)).astype(np.float32)
    stats = running_stats.empty((5,))
    for part in np.split(values, cuts):
        stats = running_stats.merge(stats, jnp.asarray(part))
    np.testing.assert_allclose(stats.mean, values.mean((0, 1), np.float64), rtol=1e-6)
    np.testing.assert_allclose(stats.variance, values.var((0, 1), np.float64), rtol=1e-4)
    assert float(stats.count) == 200


def test_nothing_seen_is_harmless():
    stats = running_stats.empty((3,))
    np.testing.assert_array_equal(stats.deviation, np.ones(3))
    stats = running_stats.merge(stats, jnp.ones((4, 3)))
    np.testing.assert_array_equal(stats.variance, np.zeros(3))


def test_the_bonus_scale_is_that_of_its_discounted_sum():
    rng = np.random.default_rng(1)
    scale, totals, total = bonus.initial_scale(3), [], np.zeros(3)
    for _ in range(4):
        values = rng.exponential(2.0, (5, 3)).astype(np.float32)
        result, scale = bonus.scaled(jnp.asarray(values), scale, 0.9, 1.0)
        for row in values:
            total = 0.9 * total + row
            totals.append(total)
        np.testing.assert_allclose(result, values / np.std(totals), rtol=1e-4)
    np.testing.assert_allclose(scale.total, total, rtol=1e-5)


def test_a_bonus_scale_that_forgets_weighs_rollouts_by_their_age():
    rng = np.random.default_rng(2)
    scale, rollouts = bonus.initial_scale(3), []
    for size in (100.0, 1.0, 1.0, 1.0):
        values = rng.exponential(size, (5, 3)).astype(np.float32)
        result, scale = bonus.scaled(jnp.asarray(values), scale, 0.0, 0.5)
        rollouts.append(values)
        weights = np.repeat(0.5 ** np.arange(len(rollouts))[::-1], values.size)
        every = np.concatenate([rollout.ravel() for rollout in rollouts])
        mean = np.average(every, weights=weights)
        deviation = np.sqrt(np.average((every - mean) ** 2, weights=weights))
        np.testing.assert_allclose(result, values / deviation, rtol=1e-4)
