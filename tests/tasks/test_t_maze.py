"""The rules of the T-maze, each tested from its own state."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np
import pytest

import jaxenstein
from jaxenstein.errors import SettingError

FORWARD = 2
# The goals of the map.
ENDS = ((1.5, 1.5), (9.5, 1.5))


@pytest.fixture(scope="module")
def world() -> Any:
    env, params = jaxenstein.make(
        "t-maze", height=24, width=24, observation="labels", autoreset=None
    )
    return env, params, env.step


@pytest.mark.parametrize("arm", [0, 1])
@pytest.mark.parametrize("end", [0, 1])
def test_right_end_pays_and_both_ends_end_the_episode(world: Any, arm: int, end: int) -> None:
    env, params, step = world
    _, state = env.reset(jax.random.key(0), params)
    # A step of 0.15 tiles from just outside the radius of 0.35, to the west or to the east.
    away = 0.45 if end == 0 else -0.45
    heading = np.float32(np.pi if end == 0 else 0)
    place = np.array(ENDS[end], np.float32) + np.array([away, 0], np.float32)
    state = state.replace(position=place, heading=heading, goal=np.int32(arm))
    _, after, reward, terminated, _, info = step(jax.random.key(1), state, FORWARD, params)
    np.testing.assert_allclose(
        after.position, place + np.array([-0.15 if end == 0 else 0.15, 0]), atol=1e-5
    )
    assert bool(terminated)
    assert float(reward) == (1.0 if arm == end else -1.0)
    assert bool(info["success"]) == bool(info["reached_goal"]) == (arm == end)
    assert bool(info["reached_wrong_end"]) == (arm != end)


def test_cue_is_visible_only_in_the_first_steps(world: Any) -> None:
    env, params, step = world
    seen = {}
    for arm in (0, 1):
        observation, state = env.reset(jax.random.key(0), params)
        state = state.replace(goal=np.int32(arm))
        frames = [np.asarray(env.observe(state, params))]
        for _ in range(12):
            observation, state, *_ = step(jax.random.key(1), state, -1, params)
            frames.append(np.asarray(observation))
        key = jaxenstein.maps.things.KEY.labels[0 if arm == 0 else 2]
        shown = [bool((frame == key).any()) for frame in frames]
        assert shown == [True] * 10 + [False] * 3
        seen[arm] = frames
    for west, east in zip(seen[0][10:], seen[1][10:], strict=True):
        np.testing.assert_array_equal(west, east)


def test_arms_are_drawn_uniformly_and_the_expert_remembers(world: Any) -> None:
    env, params, _ = world
    keys = jax.random.split(jax.random.key(3), 512)
    arms = np.asarray(jax.vmap(lambda key: env.init_state(key, params))(keys).goal)
    # Within four standard deviations of half.
    assert abs(arms.mean() - 0.5) < 4 * 0.5 / np.sqrt(512)
    for seed in (0, 1, 2):
        episode = jaxenstein.record(env, params, "expert", seed=seed)
        assert (episode.ending, float(episode.returns[-1])) == ("terminated", 1.0)


def test_params_have_ranges() -> None:
    _, params = jaxenstein.make("t-maze")
    with pytest.raises(SettingError, match="cue_steps must be"):
        params.replace(cue_steps=-1)
