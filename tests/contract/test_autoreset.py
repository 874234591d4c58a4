"""The ends of episodes, in all three modes, on a corridor whose goal is one tile away."""

import jax
import numpy as np
import pytest

import jaxenstein

pytestmark = pytest.mark.usefixtures("plain_frames")
MAP = "#####\n#S.G#\n#####"
FORWARD, STAY = 2, -1


def build(autoreset, limit=100, **settings):
    env, params = jaxenstein.from_ascii(
        MAP, heading=0.0, height=8, width=8, autoreset=autoreset, **settings
    )
    return env, params.replace(max_steps_in_episode=limit, move_distance=0.9)


def play(env, params, actions):
    obs, state = env.reset(jax.random.key(0), params)
    trace = []
    for t, action in enumerate(actions):
        out = env.step(jax.random.key(t + 1), state, action, params)
        obs, state = out[0], out[1]
        trace.append(out)
    del obs
    return trace


def flags(trace):
    return [(bool(out[3]), bool(out[4])) for out in trace]


# Two steps forward reach the goal: x goes 1.5, 2.4, 3.3.
@pytest.mark.parametrize(
    ("limit", "expected"),
    [
        (100, [(False, False), (True, False)]),
        (2, [(False, False), (True, True)]),
        (1, [(False, True)]),
    ],
)
@pytest.mark.parametrize("autoreset", ["same-step", "next-step", None])
def test_truth_table_of_episode_ends(autoreset, limit, expected):
    trace = play(*build(autoreset, limit), [FORWARD] * len(expected))
    assert flags(trace) == expected
    assert float(trace[-1][2]) == float(expected[-1][0])
    assert int(trace[-1][5]["episode_length"]) == len(expected)


def test_same_step_returns_the_next_episode():
    env, params = build("same-step")
    obs, state, reward, terminated, _, info = play(env, params, [FORWARD, FORWARD])[-1]
    assert terminated
    assert reward == 1
    assert info["reached_goal"]
    np.testing.assert_allclose(info["position"], [3.3, 1.5], rtol=1e-6)
    np.testing.assert_allclose(state.position, [1.5, 1.5])
    assert state.time == 0
    assert state.episode_return == 0
    assert info["episode_return"] == 1
    np.testing.assert_array_equal(obs, env.reset(jax.random.key(9), params)[0])


def test_final_observation_is_from_before_the_reset():
    env, params = build("same-step", final_observation=True)
    _, state = env.reset(jax.random.key(0), params)
    for t in range(2):
        key = jax.random.key(t)
        after = env.advance(jax.random.split(key)[0], state, FORWARD, params)[0]
        expected = env.observe(after, params)
        obs, state, _, terminated, truncated, info = env.step(key, state, FORWARD, params)
        np.testing.assert_array_equal(info["final_observation"], expected)
        assert (np.asarray(obs) == np.asarray(expected)).all() != (terminated | truncated)


def test_next_step_shows_the_last_frame_then_resets():
    env, params = build("next-step")
    last, reset, after = play(env, params, [FORWARD, FORWARD, FORWARD, FORWARD])[1:]
    assert last[3]
    assert last[1].done
    np.testing.assert_allclose(last[1].position, [3.3, 1.5], rtol=1e-6)
    obs, state, reward, terminated, truncated, info = reset
    assert (float(reward), bool(terminated), bool(truncated)) == (0.0, False, False)
    assert last[5]["success"]
    assert not info["reached_goal"]
    assert not info["success"]
    assert info["episode_length"] == state.time == 0
    assert not state.done
    np.testing.assert_allclose(state.position, [1.5, 1.5])
    np.testing.assert_array_equal(obs, env.reset(jax.random.key(9), params)[0])
    np.testing.assert_allclose(after[1].position, [2.4, 1.5], rtol=1e-6)
    assert after[1].time == 1


def test_next_step_reports_time_limit_once():
    assert flags(play(*build("next-step", limit=2), [STAY] * 4)) == [
        (False, False), (False, True), (False, False), (False, False)
    ]  # fmt: skip


def test_episode_continues_without_autoreset():
    env, params = build(None)
    last, beyond = play(env, params, [FORWARD, FORWARD, STAY])[1:]
    assert last[1].done
    assert beyond[1].time == 3
    np.testing.assert_array_equal(beyond[1].position, last[1].position)


def test_advance_never_resets():
    env, params = build("same-step", limit=1)
    _, state = env.reset(jax.random.key(0), params)
    state, _, terminated, info = env.advance(jax.random.key(0), state, FORWARD, params)
    assert not terminated
    assert state.time == 1
    assert state.done
    assert info["episode_length"] == 1


def test_final_observation_needs_same_step():
    with pytest.raises(jaxenstein.SettingError, match="final_observation"):
        build("next-step", final_observation=True)
