"""Advantages against a brute-force sum over every later step."""

import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("flax")

from jaxenstein.baselines.learning import gae
from tests.baselines.worlds import enable_x64


def brute_force(rewards, values, following, ended, gamma, lam):
    """A_t as the sum of (gamma lambda)^k delta_{t+k} up to the end of the episode."""
    steps, batch = rewards.shape
    result = np.zeros_like(rewards)
    for n in range(batch):
        for t in range(steps):
            weight = 1.0
            for k in range(t, steps):
                delta = rewards[k, n] + gamma * following[k, n] - values[k, n]
                result[t, n] += weight * delta
                if ended[k, n]:
                    break
                weight *= gamma * lam
    return result


def rollout(seed, steps=9, batch=6):
    rng = np.random.default_rng(seed)
    draw = lambda *shape: rng.normal(size=shape)  # noqa: E731
    kind = rng.choice(3, size=(steps, batch), p=[0.6, 0.2, 0.2])
    # An end in the first step, one in the last, several in a row, none at all.
    kind[0, 0], kind[-1, 1], kind[2:5, 2], kind[:, 3] = 1, 2, 1, 0
    return draw(steps, batch), draw(steps, batch), draw(batch), draw(steps, batch), kind


def follow(values, last, kind, finals):
    arrays = [jnp.asarray(array) for array in (values, last, kind == 1, kind == 2, finals)]
    return gae.next_values(arrays[0], arrays[1], arrays[2], arrays[3], arrays[4])


def estimate(rewards, values, following, ended, gamma, lam):
    arrays = [jnp.asarray(array) for array in (rewards, values, following, ended)]
    return gae.advantages(arrays[0], arrays[1], arrays[2], arrays[3], gamma, lam)


@pytest.mark.parametrize("lam", [0.0, 0.7, 1.0])
@pytest.mark.parametrize("gamma", [0.9, 1.0])
def test_both_kinds_of_ends(gamma, lam):
    rewards, values, last, finals, kind = rollout(0)
    following = follow(values, last, kind, finals)
    expected = np.vstack([values[1:], last])
    expected[kind == 2] = finals[kind == 2]
    expected[kind == 1] = 0
    np.testing.assert_allclose(following, expected, rtol=1e-6)
    result = estimate(rewards, values, following, kind > 0, gamma, lam)
    wanted = brute_force(rewards, values, expected, kind > 0, gamma, lam)
    np.testing.assert_allclose(result, wanted, rtol=2e-5, atol=2e-5)


def test_lambda_one_is_the_return_minus_the_value():
    rewards, values, last, _, _ = rollout(1)
    never = np.zeros(rewards.shape, bool)
    result = estimate(rewards, values, np.vstack([values[1:], last]), never, 0.95, 1.0)
    total = last
    for t in reversed(range(len(rewards))):
        total = rewards[t] + 0.95 * total
        np.testing.assert_allclose(result[t], total - values[t], rtol=2e-5, atol=2e-5)


def test_an_end_hides_what_comes_after():
    rewards, values, last, finals, kind = rollout(2)
    kind[4] = [1, 2, 1, 2, 1, 2]

    def run(rewards, values, last):
        return estimate(rewards, values, follow(values, last, kind, finals), kind > 0, 0.9, 0.9)

    changed = np.where(np.arange(9)[:, None] > 4, 100.0, 0.0)
    before, after = run(rewards, values, last), run(rewards + changed, values + changed, last + 7)
    np.testing.assert_array_equal(before[:5], after[:5])
    assert not np.allclose(before[5:], after[5:])


def test_float64():
    with enable_x64(True):
        rewards, values, last, finals, kind = rollout(3, steps=40)
        following = follow(values, last, kind, finals)
        assert following.dtype == jnp.float64
        result = estimate(rewards, values, following, kind > 0, 0.999, 0.95)
        wanted = brute_force(rewards, values, np.asarray(following), kind > 0, 0.999, 0.95)
        np.testing.assert_allclose(result, wanted, rtol=1e-12, atol=1e-12)
