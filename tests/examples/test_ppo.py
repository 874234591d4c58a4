"""The PPO example: its advantages against their definition, and that it changes and learns."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from examples import ppo


@pytest.fixture(autouse=True)
def promotion_as_users_have_it():
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        yield


def by_definition(values, reward, terminated, ended, discount, gae_lambda):
    """float64[T, N]: weighted sums of the n-step advantages, each written out.

    From t, the n-step estimate sums n rewards and the value of what comes then, which is nothing
    where the task ended. Estimates that would look beyond the end of an episode, or of the data,
    do not exist; the longest one that does takes the weight of all of them.
    """
    steps, count = reward.shape
    result = np.zeros((steps, count))
    for i in range(count):
        for t in range(steps):
            last = next((s for s in range(t, steps) if ended[s, i]), steps - 1)
            estimates = []
            for stop in range(t, last + 1):
                total = sum(discount ** (s - t) * reward[s, i] for s in range(t, stop + 1))
                rest = 0.0 if terminated[stop, i] else values[stop + 1, i]
                estimates.append(total + discount ** (stop + 1 - t) * rest - values[t, i])
            weights = [(1 - gae_lambda) * gae_lambda**n for n in range(len(estimates))]
            weights[-1] = gae_lambda ** (len(estimates) - 1)
            result[t, i] = np.dot(weights, estimates)
    return result


@pytest.mark.parametrize("gae_lambda", [0.0, 0.9, 1.0])
def test_advantages_are_those_of_the_definition(gae_lambda):
    rng = np.random.default_rng(0)
    steps, count = 24, 40
    values = rng.normal(size=(steps + 1, count)).astype(np.float32)
    reward = rng.normal(size=(steps, count)).astype(np.float32)
    terminated, truncated = rng.random((2, steps, count)) < 0.12
    ended = terminated | truncated
    assert (terminated & truncated).any()
    assert (truncated & ~terminated).sum() > 50
    expected = by_definition(values.astype(np.float64), reward, terminated, ended, 0.97, gae_lambda)
    values, reward, terminated, ended = map(jnp.asarray, (values, reward, terminated, ended))
    found = ppo.advantages(values, reward, terminated, ended, 0.97, gae_lambda)
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-5)


def test_the_time_limit_is_not_the_end_of_the_task():
    """One step, reward 0, value 1 before and after: only a true end is a loss."""
    numbers = jnp.ones((2, 3)), jnp.zeros((1, 3))
    flags = jnp.array([[False, False, True]]), jnp.array([[False, True, True]])
    found = ppo.advantages(*numbers, *flags, 1.0, 0.95)
    np.testing.assert_array_equal(found, [[0, 0, -1]])


def test_windows():
    images = np.arange(2 * 5 * 7 * 3, dtype=np.float32).reshape(2, 5, 7, 3)
    found = np.asarray(ppo.windows(jnp.asarray(images), 4))
    padded = np.pad(images, ((0, 0), (0, 3), (0, 1), (0, 0)))
    assert found.shape == (2, 2, 2, 48)
    for row in range(2):
        for column in range(2):
            cut = padded[:, 4 * row : 4 * row + 4, 4 * column : 4 * column + 4]
            np.testing.assert_array_equal(found[:, row, column], cut.reshape(2, -1))


def test_adam_against_its_definition():
    rng = np.random.default_rng(1)
    settings = ppo.Settings(learning_rate=0.1, largest_gradient=1e9)
    weights = {"a": rng.normal(size=3).astype(np.float32)}
    zeros = jax.tree.map(np.zeros_like, weights)
    adam = ppo.Adam(zeros, zeros, jnp.int32(0))
    expected, mean, square = weights["a"].astype(np.float64), np.zeros(3), np.zeros(3)
    for t in range(1, 6):
        gradient = rng.normal(size=3).astype(np.float32)
        weights, adam = ppo.descend(weights, adam, {"a": gradient}, settings)
        mean = 0.9 * mean + 0.1 * gradient
        square = 0.999 * square + 0.001 * gradient.astype(np.float64) ** 2
        correct = mean / (1 - 0.9**t), square / (1 - 0.999**t)
        expected = expected - 0.1 * correct[0] / (np.sqrt(correct[1]) + 1e-5)
    np.testing.assert_allclose(weights["a"], expected, rtol=1e-3, atol=1e-3)


def test_a_short_training(capsys):
    arguments = ["--size", "16", "--envs", "4", "--steps", "12", "--updates", "2", "--limit", "5"]
    weights, report = ppo.main(arguments)
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(weights))
    fresh = ppo.init_network(jax.random.split(jax.random.key(0), 3)[1], (16, 16, 3), 5)
    assert jax.tree.structure(fresh) == jax.tree.structure(weights)
    changed = jax.tree.map(
        lambda a, b: bool((np.asarray(a) != np.asarray(b)).any()), fresh, weights
    )
    assert all(jax.tree.leaves(changed))
    # Five steps and one that resets: two episodes of each environment in twelve steps.
    np.testing.assert_array_equal(report.episodes, [8, 8])
    np.testing.assert_array_equal(report.mean_length, [5, 5])
    assert capsys.readouterr().out.count("return 0.000, length 5, 8 episodes") == 2


@pytest.mark.slow
def test_it_learns(capsys):
    _, report = ppo.main(["--seed", "5"])
    returns = np.asarray(report.mean_return)
    assert np.nanmean(returns[:5]) < 0.3
    assert returns[-10:].mean() > 0.85
    assert capsys.readouterr().out.count("steps: return") == 60
