"""The benchmark: its tasks, their environments, and valid results."""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import numpy as np
import pytest

import jaxenstein
from jaxenstein import evaluation, suite
from jaxenstein.catalogue import ENTRIES
from jaxenstein.comparison import gather
from jaxenstein.errors import SettingError
from jaxenstein.evaluation import evaluate_player
from jaxenstein.files import make_folder
from jaxenstein.tasks import splits
from tests.results_of import results_of, suite_results, write_all

WORLD = "######\n#S  G#\n######"


def compared(tmp_path, results):
    return gather([(None, path) for path in write_all(tmp_path, {"mine.json": results})])


def test_every_task_exists_in_its_version_and_has_references():
    rows = suite.reference_rows()
    assert [*rows] == [task.id for task in suite.TASKS]
    for task in suite.TASKS:
        assert ENTRIES[task.id].version == task.version == rows[task.id]["version"], task.id
        assert rows[task.id]["episodes"] == 1000
        ends = suite.references()[task.id]
        # The random player is far from the expert, compared with the errors of both.
        errors = rows[task.id]["random_error"] + rows[task.id]["expert_error"]
        assert ends.expert - ends.random > 10 * errors


def test_both_suites_have_the_same_tasks_in_different_sizes():
    for task in suite.TASKS:
        small, large = (suite.SUITES[name].options(task) for name in ("small", "large"))
        assert (large.pop("height"), large.pop("width")) == (64, 64)
        assert (small.pop("height"), small.pop("width")) == task.small
        assert small == large
    assert suite.SUITES["large"].total_steps == 10 * suite.SUITES["small"].total_steps


def test_generalisation_tasks_are_tested_on_test_levels():
    task = next(task for task in suite.TASKS if task.split)
    sides = [getattr(suite.make(task.id, test=test)[0], "split") for test in (False, True)]  # noqa: B009
    assert sides == ["train", "test"]


def test_environments_reset_themselves():
    assert {suite.make("simple", test=test)[0].autoreset for test in (False, True)} == {"same-step"}
    assert suite.make("simple", final_observation=True)[0].final_observation
    assert suite.make("simple", autoreset="next-step")[0].autoreset == "next-step"
    with pytest.raises(SettingError, match="final_observation=True needs autoreset='same-step'"):
        suite.make("simple", autoreset=None, final_observation=True)


def test_environments_have_the_names_of_their_tasks():
    for task in suite.TASKS:
        assert suite.make(task.id)[0].name == task.id


def test_wrong_names_are_refused():
    with pytest.raises(
        SettingError, match=r"no task 't-maz', did you mean 't-maze'.*; its tasks are sim"
    ):
        suite.make("t-maz")
    with pytest.raises(SettingError, match="suite must be one of 'small', 'large', not 'medium'"):
        suite.make("t-maze", "medium")


def test_results_are_sorted_in_benchmark_order(tmp_path):
    checked = suite.check_compared(compared(tmp_path, suite_results()[::-1]), "small")
    assert [*checked["mine"]] == [task.id for task in suite.TASKS]
    some = suite.check_compared(compared(tmp_path, suite_results()[2:4][::-1]), "small")
    assert [*some["mine"]] == [task.id for task in suite.TASKS[2:4]]


def test_results_with_other_settings_are_refused(tmp_path):
    results = suite_results()
    with pytest.raises(SettingError, match="'height' is 16, but must be 64 in the large suite"):
        suite.check_compared(compared(tmp_path, results), "large")
    on_train = [
        dataclasses.replace(one, environment=suite.SUITES["small"].spec(task))
        for task, one in zip(suite.TASKS, results, strict=True)
    ]
    with pytest.raises(
        SettingError, match="'split' is 'train', but must be 'test' in the small suite"
    ):
        suite.check_compared(compared(tmp_path, on_train), "small")
    more = [*results, results_of("my-way-home", [[1.0, 0.0]])]
    with pytest.raises(SettingError, match="the benchmark has no task 'my-way-home'"):
        suite.check_compared(compared(tmp_path, more), "small")


def test_the_baselines_follow_the_protocol():
    assert "PPO (baseline)" in suite.baselines()
    for folder in suite.BASELINES.glob("*"):
        size, _, version = folder.name.partition("-")
        assert int(version) == suite.VERSION
        for policy, mine in suite.baselines(size).items():
            assert [*mine] == [task.id for task in suite.TASKS], policy
            assert suite.departures(mine.values()) == [], policy


@pytest.mark.parametrize(
    ("damage", "told"),
    [
        (lambda text: text[:-100], r"ppo\.json: not a results file, or only a part of it"),
        (lambda text: text.replace('"id":"simple"', '"id":"my-way-home"'), "has no task 'my-way"),
        (lambda text: text.replace('"frame_skip":4', '"frame_skip":3'), "'frame_skip' is 3, but"),
        (lambda text: text.replace('"version":2', '"version":3'), "the version is 3, but must be"),
    ],
)
def test_damaged_baselines_are_told(damage, told, tmp_path, monkeypatch):
    monkeypatch.setattr(suite, "BASELINES", tmp_path)
    make_folder(tmp_path / "small-1")
    (path,) = write_all(tmp_path / "small-1", {"ppo.json": suite_results()})
    assert [*suite.baselines()] == ["PPO (baseline)"]
    path.write_text(damage(path.read_text("utf-8")), "utf-8")
    with pytest.raises(SettingError, match=f"the baselines of this package are damaged: .*{told}"):
        suite.baselines()


def test_baselines_of_other_versions_are_not_used(tmp_path, monkeypatch):
    monkeypatch.setattr(suite, "BASELINES", tmp_path)
    make_folder(tmp_path / "small-1")
    for size, version in ("large", 1), ("small", 2):
        monkeypatch.setattr(suite, "VERSION", version)
        told = f"version {version} of the {size} suite has no baselines; there are .* for small-1"
        with pytest.raises(SettingError, match=told):
            suite.baselines(size)


@pytest.mark.parametrize("frame_skip", [1, 2])
def test_scripted_players_are_evaluated(frame_skip):
    env, params = jaxenstein.from_ascii(WORLD, heading=0, height=8, width=8, frame_skip=frame_skip)
    params = params.replace(max_steps_in_episode=40)
    best = evaluate_player(env, params, "expert", episodes=3)
    assert best.returns.tolist() == [[1.0] * 3]
    assert best.successes.all()
    # Three tiles of 0.15 each, less the reach of the goal.
    assert (best.lengths < 3 / 0.15 / frame_skip + 1).all()
    idle = evaluate_player(env, params, "idle", episodes=2)
    assert idle.lengths.tolist() == [[40 // frame_skip] * 2]
    assert not idle.returns.any()
    assert not idle.successes.any()
    with pytest.raises(SettingError, match="no player 'expart', did you mean 'expert'"):
        evaluate_player(env, params, "expart")
    wrong: Any = (env, params)
    with pytest.raises(SettingError, match=r"make returns \(env, params\)"):
        evaluate_player(wrong, params)


def test_scripted_players_play_levels_of_the_split():
    env: Any
    env, params = jaxenstein.make("key-corridor-s3r1", split="test", height=8, width=8)
    first = evaluation._first(env, env.single_params(params), jax.random.key(0), 16)
    levels = jax.vmap(lambda state: splits.fingerprint(env.level_parts(state)))(first.state)
    assert all(splits.is_in_split("test", 0.2, level) for level in np.asarray(levels))
