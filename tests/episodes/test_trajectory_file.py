"""Changed trajectory files, and files that cannot be written."""

from __future__ import annotations

import contextlib
import copy
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from jaxenstein import SettingError
from jaxenstein.episodes.trajectory_file import load_trajectory
from jaxenstein.errors import TrajectoryError
from jaxenstein.files import OutputError
from jaxenstein.trajectory import Trajectory


def put(path: Path, table: Any) -> Path:
    path.write_text(json.dumps(table))
    return path


def test_truncated_files_are_refused(walk: Trajectory, tmp_path: Path) -> None:
    path = tmp_path / "walk.json"
    walk.save(path)
    data = path.read_bytes()
    assert load_trajectory(path) == walk
    for length in (0, 1, 10, len(data) // 3, len(data) // 2, len(data) - 3):
        path.write_bytes(data[:length])
        with pytest.raises(TrajectoryError, match=r"walk.json: not a trajectory, or only a part"):
            load_trajectory(path)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"\xff\xfe\x00", "not a trajectory"),
        (b"[1]", "'format' is not"),
        (b'{"format": 1, "format": 2}', "two entries have the name 'format'"),
        (b'{"format": NaN}', "it has a number that is NaN"),
        (b"{}", "'format' is not"),
        (b'{"format": "other"}', "'format' is not"),
        (b"[" * 100_000, "not a trajectory"),
        (b'{"format": ' + b"9" * 5000 + b"}", "not a trajectory"),
    ],
)
def test_other_files_are_refused(content: bytes, words: str, tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_bytes(content)
    with pytest.raises(TrajectoryError, match=words):
        load_trajectory(path)


def test_unreadable_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(TrajectoryError, match="cannot be read: no such file"):
        load_trajectory(tmp_path / "none.json")
    with pytest.raises(TrajectoryError, match="cannot be read"):
        load_trajectory(tmp_path)


def test_error_for_newer_format_names_its_version(table: dict[str, Any], tmp_path: Path) -> None:
    table["format_version"] = 2
    table["made_by"]["jaxenstein"] = "7.1"
    table["more"] = "entries"
    with pytest.raises(TrajectoryError, match=r"version 2, from jaxenstein 7\.1, .* up to 1"):
        load_trajectory(put(tmp_path / "a.json", table))


WRONG: list[tuple[str, Any, str]] = [
    ("format_version", 0, "'format_version' must be a whole number >= 1, not 0"),
    ("format_version", "1", "'format_version' must be a whole number"),
    ("made_by", 3, "'made_by' must be an object"),
    ("made_by.jax", 3, "'made_by.jax' must be one line of text, not 3"),
    ("environment", [], "'environment' must be an object"),
    ("environment.id", 5, "'environment.id' must be one line of text"),
    ("environment.id", "key-dor", "unknown environment 'key-dor', did you mean 'key-door'"),
    ("environment.version", -1, "'environment.version' must be"),
    ("environment.settings", None, "'environment.settings' must be an object"),
    ("environment.settings.height", 0, "height must be a whole number"),
    ("environment.settings.height", "12", "height must be a whole number"),
    ("environment.settings.hieght", 12, "unknown setting 'hieght', did you mean 'height'"),
    ("environment.settings.id", "simple", "unknown setting 'id'"),
    ("environment.settings.observation", "smell", "observation must be one of"),
    ("environment.settings.autoreset", None, "'environment.settings.autoreset' does not belong"),
    ("environment.settings.heading", {}, "a setting cannot be an object"),
    ("environment.settings.heading", "north", "'environment'"),
    ("environment.settings.floor", 3, "'environment'"),
    ("environment.settings.text", "#", "'environment.settings.text' must be a list of lines"),
    ("environment.settings.text", ["#####", "#S~G#"], "line 2, column 3"),
    ("environment.settings.faces", [1], "'environment.settings.faces' must be a list of lines"),
    ("environment.settings.name", 3, "'environment.settings.name' must be one line of text"),
    ("environment.settings.name", "\x1b[2J", "'environment.settings.name' must be one line of t"),
    ("environment.params", [1], "'environment.params' must be an object"),
    ("environment.params.gravity", 1, "has no 'gravity'"),
    ("environment.params.discount", "high", "'environment.params.discount' must be a finite"),
    ("environment.params.discount", True, "discount must be a finite number from 0 to 1, not True"),
    ("environment.params.discount", 1e300, "1e\\+300, which is inf in float32"),
    ("environment.params.max_steps_in_episode", 2.5, "a whole number from 1 .*, not 2.5"),
    ("environment.params.max_steps_in_episode", 2**31, "from 1 to 2147483647, not 2147483648"),
    ("seed", -1, "'seed' must be a whole number from 0 to 4294967295, not -1"),
    ("seed", 2**32, "'seed' must be"),
    ("seed", True, "'seed' must be"),
    ("seed", 1.0, "'seed' must be"),
    ("actions", 2, "'actions' must be a list"),
    ("actions", [2], r"'actions\[0\]' must be \[value, count\]"),
    ("actions", [[2, 3], [5, 1]], "action 3 .* is 5, but 'Ünder' has the actions 0 to 4"),
    ("actions", [[2, 3], [-2, 1]], "action 3 .* is -2"),
    ("actions", [[2.5, 3]], r"'actions\[0\]' must be a whole number, not 2.5"),
    ("actions", [[2, 0]], r"'actions\[0\]' must be a whole number from 1"),
    ("actions", [[2, 10**12]], r"'actions\[0\]' must be a whole number from 1 to 10000000"),
    ("actions", [[2, 1]], "'checks.rewards' has"),
    ("checks", "good", "'checks' must be an object"),
    ("checks.rewards", [[0, 1]], "'checks.rewards' has 1 values"),
    ("checks.rewards", [["a", 1]], r"'checks.rewards\[0\]' must be a finite number"),
    ("checks.rewards", [[10**400, 1]], r"'checks.rewards\[0\]' must be a finite number"),
    ("made_by.jax", "1\x1b[2J", "'made_by.jax' must be one line of text"),
    ("checks.terminated", 1, "'checks.terminated' must be True or False, not 1"),
    ("checks.truncated", None, "'checks.truncated' must be True or False"),
    ("checks.every", 0, "'checks.every' must be"),
    ("checks.every", 1000, "'checks.every' must be 1 for 55 actions, not 1000"),
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


def test_error_names_wrong_entry(table: dict[str, Any], tmp_path: Path) -> None:
    for entry, value, words in WRONG:
        wrong = change(table, entry, lambda inner, name, v=value: inner.__setitem__(name, v))
        with pytest.raises(TrajectoryError, match=words) as caught:
            load_trajectory(put(tmp_path / "a.json", wrong))
        assert str(caught.value).startswith(f"{tmp_path / 'a.json'}: "), entry


def test_error_names_missing_entry(table: dict[str, Any], tmp_path: Path) -> None:
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
def test_damage_is_reported_or_harmless(
    table: dict[str, Any], tmp_path: Path, data: st.DataObject
) -> None:
    """Any value in the file gives a TrajectoryError or nothing."""
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


def test_failed_write_keeps_the_old_file(
    walk: Trajectory, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_space(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    path = tmp_path / "a.json"
    path.write_text("old")
    for target in ("pathlib.Path.write_text", "os.replace"):
        with monkeypatch.context() as patch:
            patch.setattr(target, no_space)
            with pytest.raises(OutputError, match="no space left"):
                walk.save(path)
        assert path.read_text() == "old"
        assert os.listdir(tmp_path) == ["a.json"]
    with pytest.raises(OutputError, match="there is no folder"):
        walk.save(tmp_path / "none" / "a.json")
    with pytest.raises(SettingError, match=r"should end in \.json"):
        walk.save(tmp_path / "a.txt")


def test_messages_are_short_for_any_file(table: dict[str, Any], tmp_path: Path) -> None:
    long = "x" * 100_000
    path = tmp_path / "walk.json"
    told = []
    for within in (table, table["environment"], table["environment"]["settings"], table["checks"]):
        for name, before in list(within.items()):
            for value in (long, [long] * 3, {long: long}):
                within[name] = value
                with contextlib.suppress(TrajectoryError):
                    load_trajectory(put(path, table))
                    continue
                with pytest.raises(TrajectoryError) as caught:
                    load_trajectory(path)
                told.append(str(caught.value).replace(str(path), ""))
            within[name] = before
        within[long] = 1
        with pytest.raises(TrajectoryError) as caught:
            load_trajectory(put(path, table))
        told.append(str(caught.value).replace(str(path), ""))
        del within[long]
    assert load_trajectory(put(path, table))
    assert len(told) > 60
    assert max(map(len, told)) < 1000
