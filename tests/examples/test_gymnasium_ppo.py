"""The PPO example on Gymnasium's interface: its rollouts and its learning."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np
import pytest

import jaxenstein
from examples.ppo import Settings, init_network

pytest.importorskip("gymnasium")
ppo = pytest.importorskip("examples.gymnasium_ppo")
vector = pytest.importorskip("jaxenstein.adapters.gymnasium_vector")

MAP = "######\n#S..G#\n######"


@pytest.fixture(scope="module")
def envs() -> Any:
    env, params = jaxenstein.from_ascii(MAP, height=8, width=16, heading=0.0, sprite_layers=1)
    params = params.replace(max_steps_in_episode=40, move_distance=0.5)
    return vector.GymnasiumVectorEnv(env, params, 8)


def test_reset_steps_are_not_counted(envs: Any) -> None:
    weights = init_network(jax.random.key(0), (8, 16, 3), 5)
    last = envs.reset(seed=1)[0], np.zeros(8, bool)
    past, (after, over), returns = ppo.collect(envs, weights, 100, last, jax.random.key(0))
    assert past.ended.sum() == len(returns) > 8
    assert past.chosen[0].all()
    np.testing.assert_array_equal(past.chosen[1:], ~past.ended[:-1])
    assert (past.reward[~past.chosen] == 0).all()
    np.testing.assert_array_equal(over, past.ended[-1])
    np.testing.assert_array_equal(past.observation[0], last[0])
    assert after.shape == past.observation[0].shape


def test_agent_learns_to_walk_down_a_corridor(envs: Any) -> None:
    told: list[str] = []
    settings = Settings(envs=8, steps=64, updates=20)
    _, history = ppo.train(envs, settings, 1, told.append)
    first, final = (np.mean(np.concatenate(part)) for part in (history[:5], history[-5:]))
    assert first < 0.6
    assert final > 0.8
    assert len(told) == 2
    assert "return" in told[0]
