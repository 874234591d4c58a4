"""Frame skip, against a plain loop."""

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from jaxenstein.players import player_of

pytestmark = pytest.mark.usefixtures("plain_frames")
SIZE = {"height": 8, "width": 8}
STEPS = 60
# The entries of `info` that describe a state; the others are events.
STATE = (
    *("position", "heading", "cell", "episode_return", "episode_length"),
    *("distance_to_goal", "health"),
)


def build(name, autoreset, skip, **changes):
    env, params = jaxenstein.make(name, autoreset=autoreset, frame_skip=skip, **SIZE)
    return env, env.check_params(params.replace(**changes))


def slow_loop(single, key, state, action, params, skip):
    """Up to `skip` steps of the world, one call each: the expected result of a step."""
    total, ended, told = np.float32(0), False, {}
    for one in jax.random.split(key, skip):
        state, reward, ended, info = jax.device_get(single.advance(one, state, action, params))
        total += reward
        told = {
            name: told[name] + value if name in told and name not in STATE else value
            for name, value in info.items()
        }
        if state.done:
            break
    return state, total, ended, told


def same(one, other) -> None:
    """Compare up to the last bits of numbers, since two programs can round differently."""
    assert jax.tree.structure(one) == jax.tree.structure(other)
    for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        a, b = np.asarray(a), np.asarray(b)
        assert a.dtype == b.dtype
        if a.dtype.kind == "f":
            np.testing.assert_allclose(a, b, rtol=1e-5, atol=1e-5)
        else:
            np.testing.assert_array_equal(a, b)


CASES = [
    # id, resets, skip, steps of an episode, changes of params: with all events and both ends.
    ("key-door", "same-step", 3, 100, {"interact_distance": 0.95}),
    ("health-gathering", "next-step", 5, 23, {"damage": 40, "damage_period": 4, "medkits": 32}),
    ("dmlab-random-goal-01-respawn", "same-step", 4, 50, {"goal_radius": 3.0}),
    ("simple", None, 6, 100, {"goal_radius": 4.0}),
    # Random movements happen in each of them.
    ("minigrid-dynamic-obstacles-6x6", "same-step", 3, 20, {}),
]


@pytest.mark.parametrize(
    ("name", "autoreset", "skip", "limit", "changes"), CASES, ids=[c[0] for c in CASES]
)
def test_skipped_step_equals_single_steps(name, autoreset, skip, limit, changes):
    env, params = build(name, autoreset, skip, max_steps_in_episode=limit, **changes)
    single = dataclasses.replace(env, frame_skip=1)
    choose = jax.jit(player_of(env)(env, params))
    draw, describe, begin = map(jax.jit, (env.observe, env.describe, env.init_state))
    _, state = env.reset(jax.random.key(3), params)
    ends = 0
    for t in range(STEPS):
        key = jax.random.key(100 + t)
        # Now and then nothing, so that time runs out as well.
        action = choose(key, state) if t % 3 else jnp.int32(t % 5)
        step_key, reset_key = jax.random.split(key)
        obs, got, reward, terminated, truncated, info = env.step(key, state, action, params)
        expected = slow_loop(single, step_key, state, action, params, skip)
        after, total, ended, told = expected
        up = after.time >= limit
        was_over = autoreset == "next-step" and state.done
        if was_over:
            after = begin(reset_key, params)
            zero = {n: np.zeros_like(v) for n, v in told.items()}
            told = zero | jax.device_get(describe(after, params))
            total, ended, up = np.float32(0), np.bool_(False), np.bool_(False)
        elif autoreset == "same-step" and after.done:
            after = begin(reset_key, params)
        same((got, reward, terminated, truncated), (after, total, ended, up))
        same(dict(info), dict(told))
        np.testing.assert_array_equal(obs, draw(got, params))
        taken = int(info["episode_length"]) - int(state.time)
        assert was_over or taken == skip or terminated or truncated
        ends += bool(terminated | truncated)
        state = got
        if autoreset is None and state.done:
            _, state = env.reset(key, params)
    assert ends


def test_rewards_add_up_and_events_of_all_steps_show():
    """The agent passes two keys in one step, and there is none where the step ends."""
    env, params = jaxenstein.from_ascii(
        "########\n#Srn.G.#\n########", heading=0, frame_skip=4, **SIZE
    )
    params = params.replace(move_distance=0.8, living_reward=-0.25, pickup_radius=0.45)
    _, state = env.reset(jax.random.key(0), params)
    _, state, reward, terminated, _, info = env.step(jax.random.key(1), state, 2, params)
    np.testing.assert_allclose(state.position, [4.7, 1.5], rtol=1e-6)
    assert state.taken.all()
    assert (float(reward), bool(terminated), bool(info["picked_key"])) == (-1.0, False, True)
    # The first of the next four reaches the goal, with which the episode and the step end.
    _, _, reward, terminated, _, info = env.step(jax.random.key(1), state, 2, params)
    assert (float(reward), bool(terminated), int(info["episode_length"])) == (0.75, True, 5)


@pytest.mark.parametrize("limit", [1, 4, 5, 6])
def test_time_limit_ends_a_step_early(limit):
    env, params = build("simple", None, 4, max_steps_in_episode=limit, living_reward=-1.0)
    _, state = env.reset(jax.random.key(0), params)
    assert int(env.most_steps(params)) == -(-limit // 4)
    lengths, rewards, truncated = [], [], False
    while not truncated:
        _, state, reward, _, truncated, info = env.step(jax.random.key(1), state, 0, params)
        lengths.append(int(info["episode_length"]))
        rewards.append(float(reward))
    assert lengths == [*range(4, limit, 4), limit]
    assert sum(rewards) == -limit


def test_steps_after_the_end_are_single_without_reset():
    env, params = build("simple", None, 4, max_steps_in_episode=3)
    _, state = env.reset(jax.random.key(0), params)
    for time in (3, 4, 5):
        state = env.step(jax.random.key(1), state, 0, params)[1]
        assert state.time == time


def test_skipped_turns_reach_right_angles_if_divisible():
    """With turns of 15 degrees, 1, 2, 3 and 6 turns divide a right angle, and 4 do not."""
    for skip in (1, 2, 3, 4, 6):
        env, params = build("simple", None, skip)
        _, state = env.reset(jax.random.key(0), params)
        start = float(state.heading)
        seen = set()
        for _ in range(24):
            state = env.advance(jax.random.key(1), state, 1, params)[0]
            turned = (float(state.heading) - start) % (2 * math.pi)
            seen.add(round(math.degrees(turned)) % 360)
        assert (90 in seen) == (skip != 4)
