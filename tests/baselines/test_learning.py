"""Agents that learn, and controls that cannot.

The two maps are those that every one of eight seeds learns; a goal further away is a matter of
luck for PPO, whatever the implementation. Both can be solved blindly, so the bandit proves that
the agent looks, and the memory task that it remembers.
"""

from typing import Any

import jax
import numpy as np
import pytest

pytest.importorskip("flax")

import jaxenstein
from jaxenstein.baselines import Config, HParams, Learner
from tests.baselines.worlds import Memory, bandit

SMALL: dict[str, Any] = {
    "num_envs": 16, "rollout": 64, "convolutions": ((4, 4, 32),), "features": 64, "hidden": 64,
    "head": 64,
}  # fmt: skip
CORRIDOR = "####\n#SG#\n####"
ROOM = "####\n#S.#\n#G.#\n####"


def train(env, params, updates, total, seeds=8, numbers=None, **settings):
    """Success rates and mean lengths [seeds] of the last ten of `updates` updates."""
    config = Config(**(SMALL | {"total_steps": total * 1024} | settings))
    many = Learner(env, params, config).many
    states = many.init(jax.random.split(jax.random.key(0), seeds), numbers)
    _, metrics = many.train_chunk(states, numbers, updates)
    last = {name: np.asarray(value)[:, -10:].sum(1) for name, value in metrics.items()}
    return {
        "success": last["successes"] / last["episodes"],
        "length": last["length_sum"] / last["episodes"],
    }


def small_map(text):
    env, params = jaxenstein.from_ascii(text, heading=0.0, height=16, width=16)
    return env, params.replace(max_steps_in_episode=64)


@pytest.mark.slow
def test_all_seeds_learn_to_walk_to_the_goal_ahead():
    """A random walk finds it in 16 % of episodes; without a learning rate so does the agent."""
    numbers = HParams(learning_rate=np.array([2.5e-4] * 5 + [0.0]))
    result = train(*small_map(CORRIDOR), updates=28, total=60, seeds=6, numbers=numbers)
    assert result["success"][:5].min() >= 0.95, result
    assert result["length"][:5].max() <= 10, result
    assert 0.05 < result["success"][5] < 0.35, result


@pytest.mark.training
def test_all_seeds_learn_to_turn_to_a_goal_beside_them():
    """A random walk finds it in 4 % of episodes."""
    numbers = HParams(learning_rate=1e-3, advantage_floor=0.01)
    result = train(*small_map(ROOM), updates=60, total=100, numbers=numbers, zero_values=True)
    assert result["success"].min() >= 0.95, result


@pytest.mark.slow
def test_agent_learns_to_look():
    """Four start cells that differ only in colour: a blind agent is right in a quarter."""
    env = bandit()
    result = train(env, env.default_params, updates=30, total=40, seeds=4)
    assert result["success"].min() >= 0.95, result


def test_agent_learns_to_remember_for_two_steps():
    """The one agent that every change trains: without a learning rate it guesses."""
    env = Memory(delay=2)
    numbers = HParams(learning_rate=np.array([3e-3, 3e-3, 0.0]))
    result = train(
        env, env.default_params, updates=24, total=60, seeds=3, numbers=numbers, rollout=32,
        convolutions=((4, 4, 8),), features=16, hidden=16, head=16,
    )  # fmt: skip
    assert result["success"][:2].min() >= 0.95, result
    assert abs(result["success"][2] - 0.5) < 0.1, result


@pytest.mark.slow
@pytest.mark.parametrize("recurrent", [True, False])
def test_agent_learns_to_remember(recurrent):
    """A cue in the first frame decides the answer eight steps later."""
    env = Memory(delay=8)
    numbers = HParams(learning_rate=1e-3)
    result = train(
        env, env.default_params, updates=36, total=80, seeds=4, numbers=numbers,
        recurrent=recurrent,
    )  # fmt: skip
    if recurrent:
        assert result["success"].min() >= 0.95, result
    else:
        assert np.all(np.abs(result["success"] - 0.5) < 0.1), result
