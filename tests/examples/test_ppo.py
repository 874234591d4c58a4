"""The PPO example: its advantages against their definition, and that it changes and learns."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from examples import ppo


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
def test_advantages_match_the_definition(gae_lambda):
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


def test_short_training(capsys):
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
def test_agent_learns(capsys):
    _, report = ppo.main(["--seed", "5"])
    returns = np.asarray(report.mean_return)
    assert np.nanmean(returns[:5]) < 0.3
    assert returns[-10:].mean() > 0.85
    assert capsys.readouterr().out.count("steps: return") == 60
