"""Every environment still does what it did when its version was last raised."""

from __future__ import annotations

import dataclasses
import re
from typing import Any

import numpy as np
import pytest

import jaxenstein
from jaxenstein.catalogue import ENTRIES, MAIN_IDS
from reliability import golden
from tests.contract.ids import GOLDEN_IDS

EPISODES = golden.load()
# A small one, for what does not need all.
ONE = "key-door"


def test_every_id_has_a_golden_episode() -> None:
    assert list(EPISODES) == list(MAIN_IDS), golden.COMMAND


@pytest.mark.parametrize("name", GOLDEN_IDS)
def test_behaviour_is_that_of_the_version(name: str) -> None:
    problem = golden.problem(name, EPISODES[name])
    assert not problem, golden.message(name, problem)


@pytest.mark.parametrize("name", MAIN_IDS)
def test_version_and_params_are_those_of_the_episode(name: str) -> None:
    env, params = jaxenstein.make(name)
    assert env.version == EPISODES[name]["version"], golden.COMMAND
    assert golden.numbers_of(params) == EPISODES[name]["params"], golden.message(name, "params")


@pytest.mark.parametrize("name", [name for name in ENTRIES if ENTRIES[name].version > 0])
def test_a_raised_version_stands_in_the_changelog(name: str) -> None:
    text = (golden.ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    entries = [" ".join(entry.split()) for entry in re.split(r"^- ", text, flags=re.MULTILINE)]
    wanted = f"version {ENTRIES[name].version}"
    assert any(f"`{name}`" in entry and wanted in entry for entry in entries), (
        f"CHANGELOG.md needs an entry with `{name}` and '{wanted}'"
    )


@pytest.mark.parametrize("name", [ONE, "health-gathering", "key-corridor-s3r1"])
def test_the_episodes_are_worth_keeping(name: str) -> None:
    """Somebody walks in them, things happen, and one ends."""
    episode = EPISODES[name]
    actions = [value for value, count in episode["actions"] for _ in range(count)]
    assert len(actions) == golden.STEPS
    assert len(set(actions)) > 3
    found = golden.trace(name, episode["seed"], actions)
    assert len(np.unique(found.poses[:, :2], axis=0)) > 10
    assert len(np.unique(found.frames, axis=0)) > 10


def changed(monkeypatch: pytest.MonkeyPatch, **parts: Any) -> str:
    """What is said of the episode of `ONE` if its trace has other parts."""
    episode = EPISODES[ONE]
    actions = [value for value, count in episode["actions"] for _ in range(count)]
    found = golden.trace(ONE, episode["seed"], actions)
    changes = {name: change(getattr(found, name)) for name, change in parts.items()}
    monkeypatch.setattr(golden, "trace", lambda *_: dataclasses.replace(found, **changes))
    return golden.problem(ONE, episode)


def with_row(rows: tuple[np.ndarray, ...], row: int, by: float) -> tuple[np.ndarray, ...]:
    """The rows with the first number of one of them changed."""
    other = rows[row].copy()
    other[0] += by
    return (*rows[:row], other, *rows[row + 1 :])


def test_one_changed_event_is_told_with_its_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = changed(monkeypatch, whole=lambda rows: with_row(rows, 19, 1))
    assert problem.endswith("differ from some step of 16 to 23 on")
    text = golden.message(ONE, problem)
    assert "behaviour of key-door changed" in text
    assert "raise its version in the registry and add a line to CHANGELOG.md" in text
    assert text.endswith(f"regenerate with {golden.COMMAND}")


@pytest.mark.parametrize(("by", "same"), [(2e-6, True), (2e-2, False)])
def test_positions_may_differ_by_rounding_alone(
    monkeypatch: pytest.MonkeyPatch, by: float, same: bool
) -> None:
    problem = changed(
        monkeypatch, real=lambda rows: with_row(rows, 30, by), poses=lambda poses: poses + 10 * by
    )
    assert (problem == "") == same


@pytest.mark.parametrize(("pixels", "same"), [(3, True), (6, False)])
def test_few_pixels_of_a_frame_may_differ(
    monkeypatch: pytest.MonkeyPatch, pixels: int, same: bool
) -> None:
    def spoil(frames: np.ndarray) -> np.ndarray:
        spoiled = frames.copy()
        spoiled[12, 5, :pixels] ^= 255
        return spoiled

    problem = changed(monkeypatch, frames=spoil)
    assert (problem == "") == same
    assert same or "the frame after step 12 differs" in problem


def test_another_param_is_told_by_name() -> None:
    episode = EPISODES[ONE]
    wanted = episode | {"params": episode["params"] | {"goal_radius": 0.4}}
    assert golden.problem(ONE, wanted) == "default params are now {'goal_radius': 0.35}"


def test_a_raised_version_asks_for_a_new_episode() -> None:
    problem = golden.problem(ONE, EPISODES[ONE] | {"version": 7})
    assert golden.message(ONE, problem).endswith(f"regenerate with {golden.COMMAND}")


def test_the_program_keeps_what_has_not_been_raised(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    """An episode is not written anew before its version has been raised."""
    file = tmp_path / "golden.json"
    other = EPISODES | {ONE: EPISODES[ONE] | {"layout": "0" * 12}}
    file.write_text(golden.to_text(other), encoding="utf-8")
    monkeypatch.setattr(golden, "FILE", file)
    assert golden.main([ONE]) == 1
    assert "behaviour of key-door changed" in capsys.readouterr().out
    assert golden.load() == other
