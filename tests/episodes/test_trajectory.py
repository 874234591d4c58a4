"""Trajectories: recorded, replayed bit for bit or found to differ."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import jaxenstein
from jaxenstein import SettingError
from jaxenstein.episodes.digests import digest, trajectory_of
from jaxenstein.episodes.recorder import record, replay
from jaxenstein.episodes.session import Session
from jaxenstein.episodes.trajectory_file import load_trajectory
from jaxenstein.errors import TrajectoryError
from jaxenstein.spec import spec_of
from jaxenstein.tasks.goals import NavigationParams
from jaxenstein.tasks.navigation import Navigation
from jaxenstein.trajectory import Trajectory, runs
from tests.episodes.world import MAP, World


@settings(
    max_examples=10, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    actions=st.lists(st.sampled_from([2, 2, 2, 0, 1, 3, 4, -1]), max_size=20),
    seed=st.integers(0, 2**32 - 1),
)
def test_saved_trajectory_loads_and_replays(
    world: World, tmp_path: Path, actions: list[int], seed: int
) -> None:
    if not actions:
        actions = [4]
    episode = record(*world, actions, seed=seed)
    trajectory = episode.trajectory
    assert trajectory is not None
    trajectory.save(tmp_path / "a.json")
    loaded = load_trajectory(tmp_path / "a.json")
    assert loaded == trajectory
    assert loaded.actions == tuple(actions)
    played = replay(loaded)
    assert played.identical
    np.testing.assert_array_equal(played.episode.frames, episode.frames)
    np.testing.assert_array_equal(played.episode.rewards, episode.rewards)
    assert played.episode.trajectory == trajectory
    assert "the same bit for bit" in played.report()


def test_digests_match_stepping_by_hand(world: World) -> None:
    """Against the environment's own functions, without a session."""
    env, params = world
    env, params = dataclasses.replace(env, autoreset=None), Session(env, params).params
    actions = [2, 2, 1, 4, 2]
    trajectory = record(env, params, actions, seed=9).trajectory
    assert trajectory is not None
    key, reset_key = jax.random.split(jax.random.key(9))
    obs, state = env.reset(reset_key, params)
    seen, states, rewards = [obs], [state], []
    for action in actions:
        key, step_key, _ = jax.random.split(key, 3)
        obs, state, reward, *_ = env.step(step_key, state, action, params)
        seen.append(obs)
        states.append(state)
        rewards.append(float(reward))
    assert trajectory.checks.rewards == tuple(rewards)
    assert trajectory.checks.every == 1
    assert len({digest(item) for item in seen}) > 2
    assert len(set(trajectory.checks.states)) == len({digest(item) for item in states}) == 6
    assert len(set(trajectory.checks.observations)) == len({digest(item) for item in seen})


def test_digests_depend_on_every_bit() -> None:
    zero = np.zeros(3, np.float32)
    other = {
        digest(zero),
        digest(-zero),
        digest(zero.astype(np.int32)),
        digest(zero[:, None]),
        digest((zero, zero)),
        digest(np.nextafter(zero, np.float32(1))),
    }
    assert len(other) == 6
    assert digest(zero.astype(">f4").astype("<f4")) == digest(zero)


def test_digests_of_random_keys_and_rewards_that_are_not_finite(
    walk: Trajectory, tmp_path: Path
) -> None:
    one, other = (digest({"key": jax.random.key(seed), "n": 1}) for seed in (0, 1))
    assert one == digest({"key": jax.random.key(0), "n": 1}) != other
    with pytest.raises(TrajectoryError, match="holds only finite numbers"):
        with_checks(walk, rewards=(float("inf"),)).save(tmp_path / "a.json")
    assert not [*tmp_path.iterdir()]


def test_files_are_small_even_for_long_episodes(world: World, tmp_path: Path) -> None:
    actions = [0, 1] * 100
    session = Session(*world)
    for action in actions:
        session.step(action)
    trajectory = trajectory_of(session)
    assert len(trajectory.checks.states) <= 64
    assert trajectory.checks.every == 4
    trajectory.save(tmp_path / "a.json")
    assert (tmp_path / "a.json").stat().st_size < 8000
    # Steps after the end of the episode are part of it.
    assert len(trajectory.actions) == 200
    assert replay(load_trajectory(tmp_path / "a.json")).identical


def test_played_session_equals_a_recording(world: World, walk: Trajectory) -> None:
    session = Session(*world, seed=4)
    for action in walk.actions:
        session.step(action)
    assert trajectory_of(session) == walk
    assert session.over


def test_run_length_encoding() -> None:
    assert runs([2, 2, 0, 2]) == [[2, 2], [0, 1], [2, 1]]
    assert runs([]) == []


# Specs of environments.


@pytest.mark.parametrize("id", jaxenstein.environment_ids())
def test_every_environment_can_be_saved(id: str) -> None:
    env, params = jaxenstein.make(id, height=9, width=np.int64(11), observation="gray")
    spec = spec_of(env, params.replace(max_steps_in_episode=7, discount=0.25))
    assert spec.id == env.name
    assert spec.params == {"max_steps_in_episode": 7, "discount": 0.25}
    json.dumps(dict(spec.settings))
    built, numbers = spec.build()
    assert built == dataclasses.replace(env, autoreset=None)
    assert int(numbers.max_steps_in_episode) == 7


def test_changed_settings_are_saved() -> None:
    for made in (
        jaxenstein.make("key-corridor", layout_seed=np.uint32(3)),
        jaxenstein.make("health-gathering", hud=False, frame_skip=np.int32(4)),
        jaxenstein.make("dmlab-random-02", field_of_view=np.float32(70.1)),
        jaxenstein.from_ascii(MAP, floor=((1, 2, 3), (4, 5, 6)), ceiling=(7, 8, 9), heading=None),
        jaxenstein.from_ascii(MAP, name="simple", heading=90),
    ):
        env, _ = spec_of(*made).build()
        assert env == dataclasses.replace(made[0], autoreset=None)


def test_environments_that_cannot_be_rebuilt_are_refused(world: World) -> None:
    env, params = world
    stripped = dataclasses.replace(env, tilemap=dataclasses.replace(env.tilemap, goals=((1, 1),)))

    class Own(Navigation):
        """A task of one's own."""

    own = Own(tilemap=env.tilemap, height=12, width=16)
    for other in (stripped, own):
        with pytest.raises(TrajectoryError, match="neither make nor from_ascii"):
            spec_of(other, other.default_params)
    episode = record(own, None, [2, 2])
    assert episode.trajectory is None
    with pytest.raises(SettingError, match="no trajectory to save"):
        episode.save("never.json")
    with pytest.raises(TrajectoryError, match="'discount' must be a single value"):
        spec_of(env, params.replace(discount=np.ones(3, np.float32)))
    with pytest.raises(SettingError, match="living_reward must be a finite number, not nan"):
        spec_of(env, NavigationParams(living_reward=np.nan))
    with pytest.raises(SettingError, match="must be a NavigationParams"):
        spec_of(env, {})


# Replays that differ.


def with_checks(walk: Trajectory, **changes: Any) -> Trajectory:
    return dataclasses.replace(walk, checks=dataclasses.replace(walk.checks, **changes))


def test_report_names_differences_with_their_steps(walk: Trajectory) -> None:
    checks = walk.checks
    states = (*checks.states[:7], "0" * 16, *checks.states[8:])
    played = replay(with_checks(walk, states=states))
    assert played.differences == ("states differ from step 7 on",)
    assert "rewards and observations are the same bit for bit" in played.report()
    assert not played.identical
    rewards = (*checks.rewards[:3], 5.0, *checks.rewards[4:])
    observations = ("0" * 16, *checks.observations[1:])
    other = with_checks(walk, rewards=rewards, observations=observations, terminated=False)
    assert replay(other).differences == (
        f"rewards differ from step 4 on: 5.0 there, {checks.rewards[3]!r} here",
        "observations differ from the reset on",
        "terminated: False there, True here",
    )


def test_report_names_a_range_for_long_episodes(world: World) -> None:
    trajectory = record(*world, [0] * 69, seed=1).trajectory
    assert trajectory is not None
    checks = trajectory.checks
    assert (checks.every, len(checks.states)) == (2, 35)
    for index, words in ((0, "0 to 1"), (3, "6 to 7"), (34, "68 to 69")):
        states = list(checks.states)
        states[index] = "0" * 16
        played = replay(with_checks(trajectory, states=tuple(states)))
        assert played.differences == (f"states differ from one of steps {words} on",)


def test_report_names_changed_behaviour_and_versions(walk: Trajectory) -> None:
    spec = walk.environment
    slower = dataclasses.replace(spec, version=3, params={**spec.params, "move_distance": 0.1})
    other = dataclasses.replace(
        walk, environment=slower, made_by={**walk.made_by, "jaxenstein": "0.0.1"}
    )
    played = replay(other)
    report = played.report()
    assert "states differ from step" in report
    assert "NOT the same" in report
    assert "environment had version 3, now 0" in report
    assert "made by  jaxenstein 0.0.1, jax" in report
    assert f"running  jaxenstein {jaxenstein.__version__}, jax {jax.__version__}" in report
    # The replayed episode can be replayed again.
    assert played.episode.trajectory is not None
    assert replay(played.episode.trajectory).identical
