"""Metrics: rows, other tools, and the warning if training stalls."""

from __future__ import annotations

import sys
import types
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("flax")

from jaxenstein import SettingError
from jaxenstein.baselines.runs.metrics import Row, WeightsAndBiases, rows_of
from jaxenstein.baselines.runs.training import EPISODES, StallWatch


def test_rows_are_in_order_and_have_no_infinite_numbers() -> None:
    values = {
        "episodes": np.array([[0, 2], [4, 1]]),
        "return_sum": np.array([[0, np.inf], [2, 3]], np.float32),
        "length_sum": np.array([[0, 8], [40, 5]]),
        "successes": np.array([[0, 1], [2, 1]]),
        "loss": np.array([[0.1, np.nan], [np.inf, -1]], np.float32),
    }
    rows = rows_of(values, [{"seed": 3}, {"seed": 4}], first=10, steps=32)
    assert [(row["update"], row["steps"], row["seed"]) for row in rows] == [
        (11, 352, 3), (11, 352, 4), (12, 384, 3), (12, 384, 4),
    ]  # fmt: skip
    assert [row["return"] for row in rows] == [None, 0.5, None, 3.0]
    assert [row["length"] for row in rows] == [None, 10, 4, 5]
    assert [row["success"] for row in rows] == [None, 0.5, 0.5, 1]
    assert [row["loss"] for row in rows] == [0.1, None, None, -1]
    # A grid value with the name of a metric does not replace the metric.
    row = rows_of(values, [{"loss": 0.01, "gamma": 0.9}, {}], first=0, steps=32)[0]
    assert (row["loss"], row["grid_loss"], row["gamma"]) == (0.1, 0.01, 0.9)


def test_wandb_gets_every_number(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    logged: list[tuple[dict[str, float], int]] = []
    started: dict[str, Any] = {}

    def init(**settings: Any) -> Any:
        started.update(settings)
        return types.SimpleNamespace(
            log=lambda values, step: logged.append((values, step)), finish=lambda: None
        )

    stub: Any = types.ModuleType("wandb")
    stub.init = init
    monkeypatch.setitem(sys.modules, "wandb", stub)
    (tmp_path / "run").mkdir()
    sink = WeightsAndBiases(tmp_path / "run", ["a", "b"], "mine", {"x": 1})
    sink.write(
        [
            {"update": 1, "steps": 8, "seed": 0, "loss": 1.0, "return": None},
            {"update": 1, "steps": 8, "seed": 1, "loss": 2.0, "return": 3.0},
        ]
    )
    stopped: Row = {"update": 2, "steps": 16, "seed": 1, "loss": None, "diverged": 4}
    sink.write([{"update": 2, "steps": 16, "seed": 0, "loss": 1.0, "diverged": 0}, stopped])
    sink.close()
    # Means leave out diverged runs.
    assert logged.pop() == (
        {"a/loss": 1.0, "a/diverged": 0, "b/diverged": 4, "loss": 1.0, "diverged": 0}, 16
    )  # fmt: skip
    assert (started["project"], started["name"], started["resume"]) == ("mine", "run", "allow")
    # Another folder with the same name is another run; the same folder continues its run.
    ids = []
    (tmp_path / "other" / "run").mkdir(parents=True)
    for folder in (tmp_path / "run", tmp_path / "run", tmp_path / "other" / "run"):
        WeightsAndBiases(folder, ["a"], "mine", {})
        ids.append(started["id"])
    assert ids[0] == ids[1] != ids[2]
    assert all(one.startswith("run-") for one in ids)
    assert logged == [({"a/loss": 1.0, "b/loss": 2.0, "b/return": 3.0, "loss": 1.5}, 8)]
    monkeypatch.setitem(sys.modules, "wandb", None)
    with pytest.raises(SettingError, match="pip install wandb"):
        WeightsAndBiases(tmp_path / "run", ["a"], "mine", {})


def rows(updates: int, entropy: float, episodes: int, successes: int = 0) -> list[Row]:
    """Updates of two runs; all successes belong to the second one."""
    one: Row = {"episodes": episodes, "successes": 0, "entropy": entropy}
    return [one, {**one, "successes": successes}] * updates


def test_warns_once_if_policy_settles_without_success() -> None:
    watch = StallWatch(2)
    assert watch.check(rows(1, 1.6, 10)) is None
    assert watch.check(rows(1, 0.1, EPISODES // 2)) is None
    told = watch.check(rows(1, 0.04, EPISODES // 2))
    assert told is not None
    assert f"no success in {2 * EPISODES + 20:,} episodes" in told
    assert "from 1.6 to 0.04" in told
    assert watch.check(rows(5, 0.01, EPISODES)) is None


@pytest.mark.parametrize(("entropy", "successes"), [(1.5, 0), (0.01, 1)])
def test_no_warning_if_policy_explores_or_has_succeeded(entropy: float, successes: int) -> None:
    watch = StallWatch(2)
    assert watch.check(rows(1, 1.6, 10, successes)) is None
    assert watch.check(rows(20, entropy, EPISODES)) is None


def test_no_warning_if_returns_rise() -> None:
    """A task that has no success, such as monsters to shoot."""
    first: Row = {"episodes": 100, "successes": 0, "entropy": 1.6}
    first |= {"return_sum": 200.0, "return_square_sum": 500.0}
    rising: Row = {**first, "entropy": 0.01, "return_sum": 600.0, "return_square_sum": 3700.0}
    for later, told in ((rising, False), ({**first, "entropy": 0.01}, True)):
        watch = StallWatch(2)
        looked = [watch.check([first] * 2), *(watch.check([later] * 2) for _ in range(20))]
        assert any(looked) == told


def test_no_warning_for_diverged_runs() -> None:
    def update(entropy: float) -> list[Row]:
        return [{"episodes": 0, "diverged": 1, "entropy": None}, *rows(1, entropy, EPISODES)[:1]]

    watch = StallWatch(2)
    assert watch.check(rows(1, 1.6, 10)) is None
    assert [watch.check(update(1.5)) for _ in range(5)] == [None] * 5
    told = watch.check(update(0.04))
    assert told is not None
    assert "from 1.6 to 0.04" in told
    for lost in ({"diverged": 1, "entropy": None}, {"entropy": None}):
        watch = StallWatch(1)
        assert watch.check(rows(1, 1.6, 10)[:1]) is None
        assert watch.check([{"episodes": 5 * EPISODES, **lost}]) is None


def test_earlier_rows_and_rows_without_episodes_count() -> None:
    watch = StallWatch(2)
    before = rows(1, 1.6, 0) + rows(2, 0.2, EPISODES)
    assert watch.check(before) is not None
    silent: Row = {"entropy": 0.1}
    assert StallWatch(2).check([silent] * 4) is None
