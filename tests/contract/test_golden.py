"""The file of golden episodes, and the messages if an environment differs."""

from __future__ import annotations

import dataclasses
import re
from typing import Any

import numpy as np
import pytest

import jaxenstein
from jaxenstein.catalogue import ENTRIES, MAIN_IDS
from reliability import golden
from tests.contract.played import EPISODES

# A small environment, for tests that do not need all.
EXAMPLE_ID = "key-door"


def test_every_id_has_a_golden_episode() -> None:
    assert list(EPISODES) == list(MAIN_IDS), golden.COMMAND


@pytest.mark.parametrize("name", MAIN_IDS)
def test_version_and_params_match_the_episode(name: str) -> None:
    env, params = jaxenstein.make(name)
    assert env.version == EPISODES[name]["version"], golden.COMMAND
    assert golden.numbers_of(params) == EPISODES[name]["params"], golden.message(name, "params")


@pytest.mark.parametrize("name", [name for name in ENTRIES if ENTRIES[name].version > 0])
def test_raised_version_is_in_the_changelog(name: str) -> None:
    text = (golden.ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    entries = [" ".join(entry.split()) for entry in re.split(r"^- ", text, flags=re.MULTILINE)]
    wanted = f"version {ENTRIES[name].version}"
    assert any(f"`{name}`" in entry and wanted in entry for entry in entries), (
        f"CHANGELOG.md needs an entry with `{name}` and '{wanted}'"
    )


@pytest.fixture(scope="module")
def found() -> golden.Trace:
    """The trace of `EXAMPLE_ID`, played outside a batch."""
    return golden.trace(
        EXAMPLE_ID, EPISODES[EXAMPLE_ID]["seed"], golden.actions_of(EPISODES[EXAMPLE_ID])
    )


def test_episode_outside_a_batch(found: golden.Trace) -> None:
    """The contract tests compare all episodes, in batches."""
    assert golden.problem(EXAMPLE_ID, EPISODES[EXAMPLE_ID], found) == ""


def changed(found: golden.Trace, **parts: Any) -> str:
    """The problem reported for the episode of `EXAMPLE_ID` if parts of its trace change."""
    changes = {name: change(getattr(found, name)) for name, change in parts.items()}
    return golden.problem(EXAMPLE_ID, EPISODES[EXAMPLE_ID], dataclasses.replace(found, **changes))


def with_row(rows: tuple[np.ndarray, ...], row: int, by: float) -> tuple[np.ndarray, ...]:
    """The rows, with the first number of one row changed."""
    other = rows[row].copy()
    other[0] += by
    return (*rows[:row], other, *rows[row + 1 :])


def test_changed_event_is_reported_with_its_steps(found: golden.Trace) -> None:
    problem = changed(found, whole=lambda rows: with_row(rows, 19, 1))
    assert problem.endswith("differ from one of steps 16 to 23 on")
    text = golden.message(EXAMPLE_ID, problem)
    assert "behaviour of key-door changed" in text
    assert "raise its version in the catalogue and add a line to CHANGELOG.md" in text
    assert text.endswith(f"regenerate with {golden.COMMAND}")


@pytest.mark.parametrize(("by", "same"), [(2e-6, True), (2e-2, False)])
def test_positions_can_differ_only_by_rounding(found: golden.Trace, by: float, same: bool) -> None:
    problem = changed(
        found, real=lambda rows: with_row(rows, 30, by), poses=lambda poses: poses + 10 * by
    )
    assert (problem == "") == same


@pytest.mark.parametrize(("pixels", "same"), [(3, True), (6, False)])
def test_few_pixels_of_a_frame_can_differ(found: golden.Trace, pixels: int, same: bool) -> None:
    def spoil(frames: np.ndarray) -> np.ndarray:
        spoiled = frames.copy()
        spoiled[12, 5, :pixels] ^= 255
        return spoiled

    problem = changed(found, frames=spoil)
    assert (problem == "") == same
    assert same or "the frame after step 12 differs" in problem


def test_changed_param_is_reported_by_name() -> None:
    episode = EPISODES[EXAMPLE_ID]
    wanted = episode | {"params": episode["params"] | {"goal_radius": 0.4}}
    assert golden.problem(EXAMPLE_ID, wanted) == "default params are now {'goal_radius': 0.35}"


def test_raised_version_requires_new_episode() -> None:
    problem = golden.problem(EXAMPLE_ID, EPISODES[EXAMPLE_ID] | {"version": 7})
    assert golden.message(EXAMPLE_ID, problem).endswith(f"regenerate with {golden.COMMAND}")


def test_program_keeps_episodes_of_unchanged_versions(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    """An episode is only rewritten once the version has been raised."""
    file = tmp_path / "golden.json"
    other = EPISODES | {EXAMPLE_ID: EPISODES[EXAMPLE_ID] | {"layout": "0" * 12}}
    file.write_text(golden.to_text(other), encoding="utf-8")
    monkeypatch.setattr(golden, "FILE", file)
    assert golden.main([EXAMPLE_ID]) == 1
    assert "behaviour of key-door changed" in capsys.readouterr().out
    assert golden.load() == other
