"""Gradients of rewards and states with respect to numbers; frames have zero gradients."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein

STEPS = 4


@functools.cache
def build(observation="rgb", **settings):
    """A corridor in which the third step forward reaches the goal."""
    env, params = jaxenstein.from_ascii(
        "######\n#S..G#\n######",
        heading=0.0,
        height=8,
        width=8,
        observation=observation,
        **settings,
    )
    params = params.replace(move_distance=0.9, living_reward=-0.25)
    return env, env.check_params(params)


def played(env, params):
    """The sum of the rewards of some steps, a float of the last picture, and the last state."""
    obs, state = env.reset(jax.random.key(0), params)

    def step(carry, key):
        state = carry[1]
        obs, state, reward, *_ = env.step(key, state, 2, params)
        return (obs, state), reward

    (obs, state), rewards = jax.lax.scan(
        step, (obs, state), jax.random.split(jax.random.key(1), STEPS)
    )
    return jnp.sum(rewards), jnp.sum(obs.astype(jnp.float32)), state


@pytest.mark.parametrize(("autoreset", "frame_skip"), [("same-step", 1), ("next-step", 2)])
def test_gradients_of_rewards_by_params(autoreset, frame_skip):
    env, params = build(autoreset=autoreset, frame_skip=frame_skip)
    play = jax.jit(lambda p: played(env, p)[0])
    value, slope = jax.jit(jax.value_and_grad(play, allow_int=True))(params)
    assert np.isfinite(value)
    # The right gradients, from two rollouts: returns are sums of both numbers.
    for name in ("living_reward", "goal_reward"):
        more = params.replace(**{name: getattr(params, name) + 1})
        expected = play(more) - value
        assert expected != 0
        np.testing.assert_allclose(getattr(slope, name), expected, rtol=1e-5)
    for name in ("goal_radius", "turn_angle", "discount"):
        assert getattr(slope, name) == 0


@pytest.mark.parametrize("observation", ["depth", "rgb"])
def test_frames_and_initial_states_have_zero_gradients(observation):
    env, params = build(observation)
    _, state = env.reset(jax.random.key(0), params)

    def step(position):
        obs, after, reward, *_ = env.step(
            jax.random.key(1), state.replace(position=position), 2, params
        )
        return obs.astype(jnp.float32), after.position, reward

    for derive in (jax.jacfwd, jax.jacrev):
        picture, position, reward = jax.jit(derive(step))(state.position)
        assert not np.any(picture)
        np.testing.assert_array_equal(position, np.eye(2))
        np.testing.assert_array_equal(reward, np.zeros(2))


def test_gradients_in_a_batch():
    env, params = build()
    keys = jax.random.split(jax.random.key(0), 3)
    _, states = jax.vmap(env.reset, (0, None))(keys, params)

    def total(living):
        own = params.replace(living_reward=living)
        return jnp.sum(jax.vmap(env.step, (0, 0, None, None))(keys, states, 2, own)[2])

    assert jax.jit(jax.grad(total))(params.living_reward) == 3
