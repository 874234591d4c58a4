"""One episode at a time: the same seed and actions give the same episode."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from jaxenstein import SettingError
from jaxenstein.episodes.session import NO_OP, Session
from tests.episodes.world import World

MAP = "######\n#S..G#\n#....#\n######\n"


@pytest.fixture(scope="module")
def world() -> World:
    """Made with automatic resets, which a session leaves out."""
    env, params = jaxenstein.from_ascii(MAP, height=12, width=16, final_observation=True)
    return env, params.replace(max_steps_in_episode=6)


def test_session_equals_stepping_by_hand(world: World) -> None:
    env, params = jaxenstein.from_ascii(MAP, height=12, width=16, autoreset=None)
    session = Session(*world, seed=5)
    params = session.params
    key = jax.random.key(5)
    key, reset_key = jax.random.split(key)
    obs, state = env.reset(reset_key, params)
    np.testing.assert_array_equal(session.observation, obs)
    total = 0.0
    for step, action in enumerate((2, 0, 2, 1, 4, 2, 2), 1):
        key, step_key, policy_key = jax.random.split(key, 3)
        chosen = jax.random.key_data(session.policy_key())
        np.testing.assert_array_equal(chosen, jax.random.key_data(policy_key))
        obs, state, reward, terminated, truncated, info = env.step(step_key, state, action, params)
        shown = session.step(action)
        np.testing.assert_array_equal(shown, obs)
        jax.tree.map(np.testing.assert_array_equal, session.state, state)
        jax.tree.map(np.testing.assert_array_equal, session.info, dict(info))
        assert session.rewards[-1] == float(reward)
        assert (session.terminated, session.truncated) == (bool(terminated), bool(truncated))
        assert session.over == (step >= 6)
        total += float(reward)
    assert session.actions == [2, 0, 2, 1, 4, 2, 2]
    assert session.episode_return == total


def test_reset_forgets_everything(world: World) -> None:
    session = Session(*world, seed=1)
    first = np.asarray(session.observation)
    told = session.info
    session.step(2)
    session.reset(2)
    session.step(1)
    session.reset(1)
    assert session.actions == session.rewards == []
    assert not session.over
    np.testing.assert_array_equal(session.observation, first)
    jax.tree.map(np.testing.assert_array_equal, session.info, told)


def test_seeds_do_not_depend_on_the_default_generator(world: World) -> None:
    usual = Session(*world, seed=3).state
    jax.config.update("jax_default_prng_impl", "rbg")
    try:
        other = Session(*world, seed=3).state
    finally:
        jax.config.update("jax_default_prng_impl", "threefry2x32")
    jax.tree.map(np.testing.assert_array_equal, usual, other)


@pytest.mark.parametrize("action", [-7, 5, 10**20])
def test_actions_outside_the_space_do_nothing(world: World, action: int) -> None:
    one, other = Session(*world), Session(*world)
    one.step(action)
    other.step(NO_OP)
    assert one.actions == other.actions == [NO_OP]
    jax.tree.map(np.testing.assert_array_equal, one.state, other.state)


def test_actions_can_be_of_any_integer_type(world: World) -> None:
    session = Session(*world)
    action: Any
    for action in (2, np.int64(2), jnp.int32(2), np.array(2, np.uint8)):
        session.step(action)
    assert session.actions == [2] * 4
    assert all(type(action) is int for action in session.actions)
    wrong: Any
    for wrong in (2.0, "2", None, np.array([2, 2]), jnp.float32(2)):
        with pytest.raises(SettingError, match="one whole number"):
            session.step(wrong)
    assert session.actions == [2] * 4


@pytest.mark.parametrize("seed", [-1, 2**32, 1.0, "1", None, True])
def test_wrong_seeds(world: World, seed: Any) -> None:
    with pytest.raises(SettingError, match="a seed must be"):
        Session(*world, seed=seed)
