"""The PPO example: its estimates beside sums written out, and that it learns."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np
import pytest

import jaxenstein

pytest.importorskip("gymnasium")
ppo = pytest.importorskip("examples.gymnasium_ppo")
vector = pytest.importorskip("jaxenstein.adapters.gymnasium_vector")

MAP = "######\n#S..G#\n######"


@pytest.fixture(scope="module")
def envs() -> Any:
    env, params = jaxenstein.from_ascii(
        MAP, height=8, width=12, heading=0.0, observation="gray", sprite_layers=1
    )
    params = params.replace(max_steps_in_episode=40, move_distance=0.5)
    return vector.GymnasiumVectorEnv(env, params, 8)


def by_definition(rollout: Any, discount: float, decay: float, t: int, n: int) -> float:
    """The sum of what is left of the episode's one-step errors, each looked up by itself."""
    total, weight = 0.0, 1.0
    for later in range(t, len(rollout.rewards)):
        ahead = 0.0 if rollout.terminated[later, n] else rollout.values[later + 1, n]
        error = rollout.rewards[later, n] + discount * ahead - rollout.values[later, n]
        total += weight * error
        if rollout.over[later, n]:
            break
        weight *= discount * decay
    return total


def test_advantages_end_with_the_episode(envs: Any) -> None:
    rng = np.random.default_rng(0)
    rollout = ppo.new_rollout(12, envs)
    rollout.values[:] = rng.normal(size=rollout.values.shape)
    rollout.rewards[:] = rng.normal(size=rollout.rewards.shape)
    rollout.terminated[:] = rng.random(rollout.rewards.shape) < 0.2
    rollout.over[:] = rollout.terminated | (rng.random(rollout.rewards.shape) < 0.2)
    found = ppo.advantages(rollout, 0.9, 0.8)
    for t, n in np.ndindex(found.shape):
        wanted = by_definition(rollout, 0.9, 0.8, t, n)
        assert found[t, n] == pytest.approx(wanted, rel=1e-4, abs=1e-5)


def test_steps_that_reset_are_not_counted(envs: Any) -> None:
    settings = ppo.Settings()
    params = ppo.init_network(np.random.default_rng(0), 8 * 12, 8, 5)
    rollout = ppo.new_rollout(100, envs)
    last = envs.reset(seed=1)[0], np.zeros(8, bool)
    (_, over), returns = ppo.collect(envs, params, rollout, last, jax.random.key(0))
    assert rollout.over.sum() == len(returns) > 8
    assert rollout.counts[0].all()
    np.testing.assert_array_equal(rollout.counts[1:], ~rollout.over[:-1])
    assert (rollout.rewards[~rollout.counts] == 0).all()
    np.testing.assert_array_equal(over, rollout.over[-1])
    # Whatever was drawn in them changes nothing.
    flat = {
        "observations": rollout.observations[:-1].reshape(-1, 8, 12),
        "actions": rollout.actions.ravel(),
        "log_probs": rollout.log_probs.ravel(),
        "targets": rollout.rewards.ravel(),
        "advantages": rollout.rewards.ravel(),
        "counts": rollout.counts.ravel(),
    }
    value = ppo.loss(params, flat, settings)
    flat["targets"] = np.where(flat["counts"], flat["targets"], np.float32(1000))
    flat["actions"] = np.where(flat["counts"], flat["actions"], 0)
    assert float(ppo.loss(params, flat, settings)) == pytest.approx(float(value))


def test_it_learns_to_walk_down_a_corridor(envs: Any) -> None:
    told: list[str] = []
    _, history = ppo.train(envs, ppo.Settings(updates=20, seed=1), told.append)
    first, final = (np.mean(np.concatenate(part)) for part in (history[:5], history[-5:]))
    assert first < 0.5
    assert final > 0.8
    assert len(told) == 2
    assert "return" in told[0]
