"""Rollouts against a Python loop over `Environment.step`."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("flax")

from jaxenstein.baselines import Config
from jaxenstein.baselines.networks import ActorCritic
from jaxenstein.baselines.observations import observation_spec
from jaxenstein.baselines.rollout import final_values, log_prob, rollout, start
from jaxenstein.baselines.simulator import make_simulator, most_truncations
from tests.baselines.worlds import Countdown

STEPS, BATCH = 23, 4


@pytest.fixture(scope="module")
def played():
    env = Countdown()
    params = env.default_params
    config = Config(features=8, hidden=4, head=8)
    network = ActorCritic(observation_spec(env, params), 2, 2, config)
    weights = jax.tree.map(lambda leaf: leaf * 2, network.init(jax.random.key(1)))
    simulator = make_simulator(env, params)
    slots = most_truncations(params, STEPS)
    assert slots == 5
    actors = start(simulator, network, jax.random.key(2), BATCH)
    key = jax.random.key(3)

    @jax.jit
    def play(actors):
        result = rollout(simulator, network, weights, key, actors, STEPS, slots)
        return *result, final_values(simulator, network, weights, result[2], STEPS)

    return env, network, weights, key, actors, play(actors)


def test_every_step_matches_a_plain_loop(played):
    env, network, weights, key, actors, (after, steps, _, sums, values) = played
    same = Countdown(autoreset="same-step", final_observation=True)
    step = jax.jit(jax.vmap(same.step, in_axes=(0, 0, 0, None)))
    forward = jax.jit(network.step)
    obs, state = actors.obs, actors.env_state
    memory = np.zeros((BATCH, 4), np.float32)
    previous, first = np.full(BATCH, -1, np.int32), np.ones(BATCH, bool)
    returns, lengths, finished = np.zeros(BATCH), np.zeros(BATCH, int), []
    kinds = set()
    for t, step_key in enumerate(jax.random.split(key, STEPS)):
        action_key, env_key = jax.random.split(step_key)
        # The loop clears memory and previous action itself, where an episode begins.
        memory[first], previous[first] = 0, -1
        logits, value, memory = forward(
            weights, obs, jnp.asarray(previous), jnp.zeros(BATCH, bool), jnp.asarray(memory)
        )
        action = jax.random.categorical(action_key, logits).astype(jnp.int32)
        np.testing.assert_array_equal(steps.action[t], action)
        np.testing.assert_array_equal(steps.first[t], first)
        np.testing.assert_array_equal(jax.tree.leaves(steps.obs)[0][t], obs)
        np.testing.assert_allclose(steps.value[t], value, rtol=1e-5, atol=1e-6)
        np.testing.assert_allclose(steps.log_prob[t], log_prob(logits, action), rtol=1e-5)
        keys = jax.random.split(env_key, BATCH)
        obs, state, reward, terminated, truncated, info = step(
            keys, state, action, env.default_params
        )
        truncated &= ~terminated
        np.testing.assert_array_equal(steps.reward[t], reward)
        np.testing.assert_array_equal(steps.terminated[t], terminated)
        np.testing.assert_array_equal(steps.truncated[t], truncated)
        kinds |= set((np.asarray(terminated) + 2 * np.asarray(truncated)).tolist())
        _, final, _ = forward(
            weights, info["final_observation"], action, jnp.zeros(BATCH, bool), memory
        )
        expected = np.where(np.asarray(truncated)[:, None], final, 0)
        np.testing.assert_allclose(values[t], expected, rtol=1e-5, atol=1e-6)
        returns, lengths = returns + np.asarray(reward), lengths + 1
        first, previous = np.array(terminated | truncated), np.array(action)
        memory = np.array(memory)
        for n in np.flatnonzero(first):
            finished.append((float(returns[n]), int(lengths[n])))
            returns[n], lengths[n] = 0, 0
    assert kinds == {0, 1, 2}
    np.testing.assert_array_equal(after.obs, obs)
    np.testing.assert_array_equal(after.first, first)
    np.testing.assert_array_equal(after.previous, previous)
    np.testing.assert_allclose(after.memory, memory, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(after.episode_return, returns, rtol=1e-6)
    assert int(sums["episodes"]) == len(finished)
    total = np.array(finished)
    np.testing.assert_allclose(sums["return_sum"], total[:, 0].sum(), rtol=1e-6)
    np.testing.assert_allclose(sums["return_square_sum"], (total[:, 0] ** 2).sum(), rtol=1e-6)
    assert int(sums["length_sum"]) == total[:, 1].sum()
    # In this world, the ends that no limit made.
    assert 0 < int(sums["successes"]) == int(np.sum(steps.terminated)) < len(finished)


def test_most_truncations():
    limit = Countdown().default_params
    assert [most_truncations(limit, n) for n in (1, 5, 6, 11)] == [1, 1, 2, 3]
    assert most_truncations(object(), 7) == 7
    # With two world steps per step, an episode of 5 has 3.
    assert [most_truncations(limit, n, 2) for n in (1, 3, 4, 7)] == [1, 1, 2, 3]


def test_replay_reproduces_the_rollout(played):
    _, network, weights, _, actors, (_, steps, *_) = played
    logits, value, _ = jax.jit(network.unroll)(
        weights, steps.obs, steps.previous, steps.first, actors.memory
    )
    np.testing.assert_allclose(value, steps.value, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(log_prob(logits, steps.action), steps.log_prob, rtol=1e-5)
