"""Trajectory files: what is written is read back, and replayed bit for bit or found to differ."""

from __future__ import annotations

import copy
import dataclasses
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import jaxenstein
from jaxenstein import SettingError
from jaxenstein.episodes.recipe import recipe_of
from jaxenstein.episodes.recorder import record
from jaxenstein.episodes.replaying import replay
from jaxenstein.episodes.session import Session
from jaxenstein.episodes.trajectory import Trajectory, digest, runs, trajectory_of
from jaxenstein.episodes.trajectory_file import load_trajectory
from jaxenstein.errors import TrajectoryError
from jaxenstein.tasks.navigation import Navigation
from jaxenstein.view.files import OutputError

MAP = "########\n#S.rR.G#\n#..a...#\n########\n"
FACES = "west\n########\n#      #\n#      #\n11111111\n"
World = tuple[Any, Any]


@pytest.fixture(scope="module")
def world() -> World:
    env, params = jaxenstein.from_ascii(
        MAP, faces=FACES, height=12, width=16, heading=(-20, 20), name="Ünder"
    )
    return env, params.replace(living_reward=-0.1, max_steps_in_episode=70)


@pytest.fixture(scope="module")
def walk(world: World) -> Trajectory:
    """Past the key and through the door."""
    episode = record(*world, "shortest_path", seed=4)
    assert episode.ending == "terminated"
    assert episode.trajectory is not None
    return episode.trajectory


@pytest.fixture
def table(walk: Trajectory, tmp_path: Path) -> dict[str, Any]:
    """The content of the walk's file."""
    walk.save(tmp_path / "walk.json")
    return json.loads((tmp_path / "walk.json").read_text())


def put(path: Path, table: Any) -> Path:
    path.write_text(json.dumps(table))
    return path


@settings(
    max_examples=10, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    actions=st.lists(st.sampled_from([2, 2, 2, 0, 1, 3, 4, -1]), max_size=20),
    seed=st.integers(0, 2**32 - 1),
)
def test_what_is_saved_is_loaded_and_replayed(
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


def test_digests_are_those_of_stepping_by_hand(world: World) -> None:
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


def test_digests_tell_every_bit_apart() -> None:
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


def test_files_are_small_and_long_episodes_stay_so(world: World, tmp_path: Path) -> None:
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


def test_a_session_in_play_gives_the_same_as_a_recording(world: World, walk: Trajectory) -> None:
    session = Session(*world, seed=4)
    for action in walk.actions:
        session.step(action)
    assert trajectory_of(session) == walk
    assert session.over


def test_runs() -> None:
    assert runs([2, 2, 0, 2]) == [[2, 2], [0, 1], [2, 1]]
    assert runs([]) == []


# What an environment is built from.


@pytest.mark.parametrize("id", jaxenstein.environment_ids())
def test_every_environment_can_be_kept(id: str) -> None:
    env, params = jaxenstein.make(id, height=9, width=np.int64(11), observation="gray")
    recipe = recipe_of(env, params.replace(max_steps_in_episode=7, turn_angle=0.25))
    assert recipe.id == env.name
    assert recipe.params == {"max_steps_in_episode": 7, "turn_angle": 0.25}
    json.dumps(dict(recipe.settings))
    built, numbers = recipe.build()
    assert built == dataclasses.replace(env, autoreset=None)
    assert int(numbers.max_steps_in_episode) == 7


def test_own_settings_are_kept() -> None:
    for made in (
        jaxenstein.make("key-corridor", layout_seed=np.uint32(3)),
        jaxenstein.make("health-gathering", hud=False),
        jaxenstein.make("dmlab-random-02", field_of_view=np.float32(70.1)),
        jaxenstein.from_ascii(MAP, floor=((1, 2, 3), (4, 5, 6)), ceiling=(7, 8, 9), heading=None),
        jaxenstein.from_ascii(MAP, name="simple", heading=90),
    ):
        env, _ = recipe_of(*made).build()
        assert env == dataclasses.replace(made[0], autoreset=None)


def test_environments_that_cannot_be_built_again_are_told(world: World) -> None:
    env, params = world
    stripped = dataclasses.replace(env, tilemap=dataclasses.replace(env.tilemap, goals=((1, 1),)))

    class Own(Navigation):
        """A task of one's own."""

    own = Own(tilemap=env.tilemap, height=12, width=16)
    for other in (stripped, own):
        with pytest.raises(TrajectoryError, match="neither make nor from_ascii"):
            recipe_of(other, other.default_params)
    episode = record(own, None, [2, 2])
    assert episode.trajectory is None
    with pytest.raises(SettingError, match="no trajectory to save"):
        episode.save("never.json")
    with pytest.raises(TrajectoryError, match="'discount' has the shape"):
        recipe_of(env, params.replace(discount=np.ones(3, np.float32)))
    with pytest.raises(TrajectoryError, match="'living_reward' is nan"):
        recipe_of(env, params.replace(living_reward=np.nan))
    with pytest.raises(SettingError, match="must be a NavigationParams"):
        recipe_of(env, {})


# Files that are not as they were.


def test_prefixes_of_a_file_are_told(walk: Trajectory, tmp_path: Path) -> None:
    path = tmp_path / "walk.json"
    walk.save(path)
    data = path.read_bytes()
    assert load_trajectory(path) == walk
    for length in (0, 1, 10, len(data) // 3, len(data) // 2, len(data) - 3):
        path.write_bytes(data[:length])
        with pytest.raises(TrajectoryError, match=r"walk.json: no trajectory, or only a part"):
            load_trajectory(path)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"\xff\xfe\x00", "no trajectory"),
        (b"[1]", "'format' is not"),
        (b"{}", "'format' is not"),
        (b'{"format": "other"}', "'format' is not"),
        (b"[" * 100_000, "no trajectory"),
        (b'{"format": ' + b"9" * 5000 + b"}", "no trajectory"),
    ],
)
def test_other_files_are_told(content: bytes, words: str, tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_bytes(content)
    with pytest.raises(TrajectoryError, match=words):
        load_trajectory(path)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(TrajectoryError, match="cannot be read: no such file"):
        load_trajectory(tmp_path / "none.json")
    with pytest.raises(TrajectoryError, match="cannot be read"):
        load_trajectory(tmp_path)


def test_a_newer_format_names_who_made_it(table: dict[str, Any], tmp_path: Path) -> None:
    table["format_version"] = 2
    table["made_by"]["jaxenstein"] = "7.1"
    table["more"] = "entries"
    with pytest.raises(TrajectoryError, match=r"version 2, made by jaxenstein 7\.1; .* up to 1"):
        load_trajectory(put(tmp_path / "a.json", table))


WRONG: list[tuple[str, Any, str]] = [
    ("format_version", 0, "'format_version' must be a whole number of at least 1, not 0"),
    ("format_version", "1", "'format_version' must be a whole number"),
    ("made_by", 3, "'made_by' must be an object"),
    ("made_by.jax", 3, "'made_by.jax' must be a text, not 3"),
    ("environment", [], "'environment' must be an object"),
    ("environment.id", 5, "'environment.id' must be a text"),
    ("environment.id", "key-dor", "unknown environment 'key-dor', did you mean 'key-door'"),
    ("environment.version", -1, "'environment.version' must be"),
    ("environment.settings", None, "'environment.settings' must be an object"),
    ("environment.settings.height", 0, "height must be a whole number"),
    ("environment.settings.height", "12", "height must be a whole number"),
    ("environment.settings.hieght", 12, "unknown setting 'hieght', did you mean 'height'"),
    ("environment.settings.observation", "smell", "observation must be one of"),
    ("environment.settings.autoreset", None, "'environment.settings.autoreset' does not belong"),
    ("environment.settings.heading", {}, "a setting cannot be an object"),
    ("environment.settings.heading", "north", "'environment'"),
    ("environment.settings.floor", 3, "'environment'"),
    ("environment.settings.text", "#", "'environment.settings.text' must be a list of lines"),
    ("environment.settings.text", ["#####", "#S~G#"], "line 2, column 3"),
    ("environment.settings.faces", [1], "'environment.settings.faces' must be a list of lines"),
    ("environment.settings.name", 3, "'environment.settings.name' must be a text"),
    ("environment.params", [1], "'environment.params' must be an object"),
    ("environment.params.gravity", 1, "unknown param 'gravity'"),
    ("environment.params.discount", "high", "'environment.params.discount' must be a finite"),
    ("environment.params.discount", True, "param 'discount' cannot be True"),
    ("environment.params.discount", 1e300, "param 'discount' cannot be"),
    ("environment.params.max_steps_in_episode", 2.5, "cannot be 2.5"),
    ("environment.params.max_steps_in_episode", 2**31, "cannot be 2147483648"),
    ("seed", -1, "'seed' must be a whole number from 0 to 4294967295, not -1"),
    ("seed", 2**32, "'seed' must be"),
    ("seed", True, "'seed' must be"),
    ("seed", 1.0, "'seed' must be"),
    ("actions", 2, "'actions' must be a list"),
    ("actions", [2], r"'actions\[0\]' must be \[value, how often\]"),
    ("actions", [[2, 3], [5, 1]], "action 3 .* is 5, and 'Ünder' has the actions 0 to 4"),
    ("actions", [[2, 3], [-2, 1]], "action 3 .* is -2"),
    ("actions", [[2.5, 3]], r"'actions\[0\]' must be a whole number, not 2.5"),
    ("actions", [[2, 0]], r"'actions\[0\]' must be a whole number from 1"),
    ("actions", [[2, 10**12]], r"'actions\[0\]' must be a whole number from 1 to 10000000"),
    ("actions", [[2, 1]], "'checks.rewards' has"),
    ("checks", "good", "'checks' must be an object"),
    ("checks.rewards", [[0, 1]], "'checks.rewards' has 1 values"),
    ("checks.rewards", [["a", 1]], r"'checks.rewards\[0\]' must be a finite number"),
    ("checks.terminated", 1, "'checks.terminated' must be true or false, not 1"),
    ("checks.truncated", None, "'checks.truncated' must be true or false"),
    ("checks.every", 0, "'checks.every' must be"),
    ("checks.every", 1000, "'checks.states' has"),
    ("checks.states", ["0" * 16], "'checks.states' has 1 values"),
    ("checks.states", ["xyz"], "'checks.states' must be a list of digests"),
    ("checks.observations", "abc", "'checks.observations' must be a list of digests"),
    ("checks.moon", 1, "unknown entry 'checks.moon'"),
    ("environment.moon", 1, "unknown entry 'environment.moon'"),
    ("moon", 1, "unknown entry 'moon'"),
]  # fmt: skip


def change(table: dict[str, Any], entry: str, edit: Callable[[dict[str, Any], str], None]) -> Any:
    """A copy of the table with an entry edited."""
    table = copy.deepcopy(table)
    *folders, name = entry.split(".")
    inner = table
    for folder in folders:
        inner = inner[folder]
    edit(inner, name)
    return table


def test_wrong_entries_are_named(table: dict[str, Any], tmp_path: Path) -> None:
    for entry, value, words in WRONG:
        wrong = change(table, entry, lambda inner, name, v=value: inner.__setitem__(name, v))
        with pytest.raises(TrajectoryError, match=words) as caught:
            load_trajectory(put(tmp_path / "a.json", wrong))
        assert str(caught.value).startswith(f"{tmp_path / 'a.json'}: "), entry


def test_missing_entries_are_named(table: dict[str, Any], tmp_path: Path) -> None:
    inner = [f"{outer}.{name}" for outer in ("environment", "checks") for name in table[outer]]
    for entry in [*table, *inner]:
        missing = change(table, entry, lambda inner, name: inner.__delitem__(name))
        words = "'format'" if entry == "format" else f"the entry '{entry}' is missing"
        with pytest.raises(TrajectoryError, match=words):
            load_trajectory(put(tmp_path / "a.json", missing))
    texts = change(table, "environment.settings.text", lambda inner, name: inner.__delitem__(name))
    with pytest.raises(TrajectoryError, match=r"needs the map 'settings\.text'"):
        load_trajectory(put(tmp_path / "a.json", texts))


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3)
    ),
    max_leaves=5,
)


@settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.data())
def test_any_damage_is_told_or_harmless(
    table: dict[str, Any], tmp_path: Path, data: st.DataObject
) -> None:
    """Whatever stands in a place of the file, nothing but a TrajectoryError comes of it."""
    damaged = copy.deepcopy(table)
    place: Any = damaged
    while True:
        keys = list(place) if isinstance(place, dict) else list(range(len(place)))
        key = data.draw(st.sampled_from(keys))
        inner = place[key]
        if not isinstance(inner, dict | list) or not inner or data.draw(st.booleans()):
            break
        place = inner
    place[key] = data.draw(VALUES)
    try:
        loaded = load_trajectory(put(tmp_path / "a.json", damaged))
    except TrajectoryError:
        pass
    else:
        loaded.save(tmp_path / "b.json")
        assert load_trajectory(tmp_path / "b.json") == loaded


# Replays that differ.


def with_checks(walk: Trajectory, **changes: Any) -> Trajectory:
    return dataclasses.replace(walk, checks=dataclasses.replace(walk.checks, **changes))


def test_differences_are_named_with_their_steps(walk: Trajectory) -> None:
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
        "terminated was False there, is True",
    )


def test_differences_in_long_episodes_name_a_range(world: World) -> None:
    trajectory = record(*world, [0] * 69, seed=1).trajectory
    assert trajectory is not None
    checks = trajectory.checks
    assert (checks.every, len(checks.states)) == (2, 35)
    for index, words in ((0, "0 to 1"), (3, "6 to 7"), (34, "68 to 69")):
        states = list(checks.states)
        states[index] = "0" * 16
        played = replay(with_checks(trajectory, states=tuple(states)))
        assert played.differences == (f"states differ from some step of {words} on",)


def test_another_behaviour_is_found_and_versions_are_told(walk: Trajectory) -> None:
    recipe = walk.environment
    slower = dataclasses.replace(recipe, version=3, params={**recipe.params, "move_distance": 0.1})
    other = dataclasses.replace(
        walk, environment=slower, made_by={**walk.made_by, "jaxenstein": "0.0.1"}
    )
    played = replay(other)
    report = played.report()
    assert "states differ from step" in report
    assert "NOT the same" in report
    assert "environment was version 3, now it is 0" in report
    assert "made by  jaxenstein 0.0.1, jax" in report
    assert f"running  jaxenstein {jaxenstein.__version__}, jax {jax.__version__}" in report
    # What was played now can be replayed in its turn.
    assert played.episode.trajectory is not None
    assert replay(played.episode.trajectory).identical


# Writing.


def test_failed_writing_leaves_what_was_there(
    walk: Trajectory, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_space(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    path = tmp_path / "a.json"
    path.write_text("old")
    for target in (f"{Path.__module__}.Path.write_text", "os.replace"):
        with monkeypatch.context() as patch:
            patch.setattr(target if target == "os.replace" else "pathlib.Path.write_text", no_space)
            with pytest.raises(OutputError, match="no space left"):
                walk.save(path)
        assert path.read_text() == "old"
        assert os.listdir(tmp_path) == ["a.json"]
    with pytest.raises(OutputError, match="there is no folder"):
        walk.save(tmp_path / "none" / "a.json")
    with pytest.raises(SettingError, match=r"should end in \.json"):
        walk.save(tmp_path / "a.txt")


# The recorder's own arguments.


def test_wrong_arguments_of_record(world: World) -> None:
    arguments: dict[str, Any]
    for arguments, words in (
        ({"policy": "exprt"}, "unknown policy 'exprt', did you mean 'expert'"),
        ({"policy": "greedy_medkits"}, "plays health-gathering"),
        ({"policy": [2, 5]}, r"action 1 \(from 0\) is 5"),
        ({"policy": [2, 0.5]}, "one whole number"),
        ({"policy": lambda session: 0.5}, "one whole number"),
        ({"seed": -1}, "a seed must be"),
        ({"steps": 0}, "steps must be"),
        ({"steps": 2.5}, "one whole number"),
    ):
        with pytest.raises(SettingError, match=words):
            record(*world, **arguments)


def test_a_function_may_act_and_remember(world: World) -> None:
    lengths = []

    def policy(session: Session) -> jax.Array:
        lengths.append(len(session.actions))
        assert session.observation.shape == (12, 16, 3)
        return jax.random.randint(session.policy_key(), (), 0, 5)

    episode = record(*world, policy, steps=12, seed=3)
    assert episode.steps == 12
    assert lengths == list(range(12))
    again = record(*world, policy, steps=12, seed=3)
    assert again.trajectory == episode.trajectory
