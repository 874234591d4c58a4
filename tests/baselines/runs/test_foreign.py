"""Curves of metrics from other programs: JSON Lines and TensorBoard files."""

from __future__ import annotations

import importlib
import json
import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("flax")
pytest.importorskip("matplotlib")

from jaxenstein import SettingError
from jaxenstein.baselines.runs import foreign
from jaxenstein.baselines.runs.curves import Curve, curves_of, plot
from jaxenstein.cli import main
from tests.baselines.runs.test_plot import write_run


def write_lines(path: Path, rows: list[dict[str, Any]]) -> Path:
    path.parent.mkdir(exist_ok=True)
    path.write_text("".join(json.dumps(row) + "\n" for row in rows))
    return path


def test_copied_metrics_give_the_curve_of_the_run(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run", [[0, 2], [-1, 4], [6, 8], [9, 10], [10, 10], [10, 10]])
    shutil.copy(run / "metrics.jsonl", tmp_path / "mine.jsonl")
    for points in (3, 50):
        (own,) = curves_of(run, "success", points)
        (by_file,) = curves_of(run / "metrics.jsonl", "success", points)
        (other,) = curves_of(tmp_path / "mine.jsonl", "success", points)
        assert (own.label, by_file.label, other.label) == ("run", "run", "mine")
        np.testing.assert_array_equal(other.at, own.at)
        np.testing.assert_array_equal(by_file.values, own.values)
        np.testing.assert_array_equal(other.values, own.values)


def test_the_config_of_another_program_does_not_make_a_run(tmp_path: Path) -> None:
    path = write_lines(tmp_path / "mine" / "metrics.jsonl", [{"step": 1, "return": 2.0}])
    (path.parent / "config.json").write_text('{"algo": "dqn"}')
    for place in (path, path.parent):
        assert curves_of(place)[0].over == "steps"


def test_a_folder_of_own_runs_is_not_one_run_with_tensorboard_files(tmp_path: Path) -> None:
    for name in ("one", "two"):
        events = write_run(tmp_path / name, [[0, 2]]) / "tensorboard" / "seed-0"
        events.mkdir(parents=True)
        (events / "events.out.tfevents.1").touch()
    with pytest.raises(SettingError, match=r"there are runs in .*one, .*two"):
        curves_of(tmp_path)


def test_sums_without_episodes_are_not_used(tmp_path: Path) -> None:
    rows = [{"step": step, "return": 3.0, "return_sum": 9.0} for step in (1, 2)]
    (curve,) = curves_of(write_lines(tmp_path / "a.jsonl", rows))
    np.testing.assert_array_equal(curve.values, [[3, 3]])


def test_other_columns_are_means_per_seed(tmp_path: Path) -> None:
    rows = [
        {"time/step": 10 * step, "seed": seed, "score": float(step * seed), "note": "x"}
        for seed in (1, 2)
        for step in (2, 1, 3, 4)
    ]
    # Other loggers write a line for each kind of metric, and NaN where there was no episode.
    rows += [{"time/step": 20, "loss": 1.0}, {"time/step": 90, "seed": 1, "score": float("nan")}]
    path = write_lines(tmp_path / "mine" / "metrics.jsonl", rows)
    for place in (path, path.parent):
        (curve,) = curves_of(place, "score", points=2)
        assert (curve.label, curve.over) == ("mine", "steps")
        np.testing.assert_array_equal(curve.at, [30, 90])
        np.testing.assert_array_equal(curve.values, [[2, 4], [4, 8]])
    (curve,) = curves_of(path, ["return", "loss"], points=2)
    np.testing.assert_array_equal(curve.values, [[1.0]])


def test_seeds_with_different_steps_give_curves_without_gaps(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    places = [np.sort(rng.choice(1000, size, replace=False)) for size in (40, 40, 15)]
    places[2] = places[2][places[2] < 500]
    rows = [
        {"step": int(step), "seed": seed, "return": float(step)}
        for seed, steps in enumerate(places)
        for step in steps
    ]
    (curve,) = curves_of(write_lines(tmp_path / "a.jsonl", rows), points=20)
    assert 1 < len(curve.at) <= 20
    starts = np.concatenate([[-1], curve.at[:-1]])
    for seed, steps in enumerate(places):
        for point, (low, high) in enumerate(zip(starts, curve.at, strict=True)):
            inside = steps[(steps > low) & (steps <= high)]
            # Values are missing only after the end of a run.
            assert len(inside) > 0 or low >= steps[-1] or high < steps[0]
            wanted = inside.mean() if len(inside) else np.nan
            np.testing.assert_allclose(curve.values[seed, point], wanted)


def test_minutes_come_from_the_seconds_column(tmp_path: Path) -> None:
    rows = [{"step": n, "time_elapsed": 30.0 * n, "return": n} for n in (1, 2, 4)]
    path = write_lines(tmp_path / "a.jsonl", rows)
    (curve,) = curves_of(path, over="minutes")
    np.testing.assert_array_equal(curve.at, [0.5, 1, 2])
    write_lines(path, [{"step": 1, "return": 2}])
    with pytest.raises(SettingError, match=r"a\.jsonl has no column of seconds; it has: step, ret"):
        curves_of(path, over="minutes")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "a.jsonl has no metrics yet"),
        ("\n", "a.jsonl has no metrics yet"),
        ('{"step": 1, "retrun": 2}\n', "no column 'return', did you mean 'retrun'?; it has: step"),
        ('{"step": 1, "retrun": 2}\n', "it has: step, retrun; choose one with --metric NAME"),
        ('{"at": 1, "return": 2}\n', "a.jsonl has no column of steps; it has: at, return; choose"),
        ('{"at": 1, "return": 2}\n', "it has: at, return; choose one with --step NAME"),
        ('{"step": "1", "return": "2"}\n', "no column 'return'; it has: no column of numbers"),
        ('{"step": 1}\n{"return": 2}\n', "a.jsonl has both 'return' and 'step'"),
        ('{"step": 1, "return": 2}\n[1]\n', 'a.jsonl, line 2: each line must be an object such as'),
        ("step,return\n1,2\n", '"return": 0.5}, not \'step,return\''),
        (f'{{"step": {10**400}, "return": 2}}\n', "has no column of steps; it has: return"),
        ('{"step": 1, "a/return": 1, "b/return": 2}\n', "did you mean 'b/return' or 'a/return'"),
        ("[" * 10**5 + "\n", "line 1: each line must be an object"),
        ('{"step": 1, "return": 4e38}\n', "no column 'return'; it has: step"),
    ],
)  # fmt: skip
def test_error_for_file_without_usable_columns(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "a.jsonl").write_text(text)
    with pytest.raises(SettingError) as raised:
        curves_of(tmp_path / "a.jsonl")
    assert message in str(raised.value)


def test_incomplete_last_line_is_ignored(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text('{"step": 1, "return": 2}\n{"step": 2, "re')
    (curve,) = curves_of(tmp_path / "a.jsonl")
    np.testing.assert_array_equal(curve.values, [[2]])


def test_folder_without_metrics_is_no_run(tmp_path: Path) -> None:
    with pytest.raises(SettingError, match="there is no run"):
        curves_of(tmp_path)


def test_x_axis_counts_decisions_if_a_run_is_drawn() -> None:
    points = np.array([1.0, 2.0]), np.array([[1.0, 2.0]])
    own, other = Curve("own", *points), Curve("other", *points, "steps")
    assert plot([other, own]).axes[0].get_xlabel() == "decisions"
    assert plot([other]).axes[0].get_xlabel() == "steps"


def test_command_plots_several_formats(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.chdir(tmp_path)
    write_run(tmp_path / "run", [[0, 2], [3, 4]])
    write_lines(tmp_path / "mine.jsonl", [{"at": 32, "score": 0.5}, {"at": 64, "score": 0.75}])
    both = ["plot", "run", "mine.jsonl", "--out", "a.svg"]
    assert main([*both, "--metric", "return", "--metric", "score", "--step", "at"]) == 0
    # Text in an SVG consists of paths, with the text as a comment.
    text = (tmp_path / "a.svg").read_text()
    assert [name in text for name in ("<!-- mine -->", "<!-- decisions -->")] == [True, True]
    capsys.readouterr()
    assert main([*both, "--metric", "score"]) == 2
    assert "run: unknown metric 'score'; known: update, steps" in capsys.readouterr().err
    assert main(both) == 2
    assert "mine.jsonl has no column 'return'; it has: at, score" in capsys.readouterr().err


def test_tensorboard_files_need_tensorboard(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "events.out.tfevents.1").write_bytes(b"")
    for module in ("tensorboard", "tensorboard.backend.event_processing"):
        monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(SettingError, match=r"has TensorBoard files, .*pip install tensorboard"):
        curves_of(tmp_path)


def test_tensorboard_folders_are_seeds(tmp_path: Path) -> None:
    pytest.importorskip("tensorboard")
    Writer = importlib.import_module("tensorboard.summary").Writer
    values = {"a": [(10, 0.5), (20, 1.5), (30, 2.0)], "b": [(10, 4.0), (20, float("nan"))]}
    for seed, events in values.items():
        writer = Writer(str(tmp_path / "tb" / seed))
        for step, value in events:
            writer.add_scalar("charts/return", value, step)
            writer.add_scalar("loss", 7.0, step)
        writer.close()
    (curve,) = curves_of(tmp_path / "tb", points=50)
    assert (curve.label, curve.over) == ("tb", "steps")
    np.testing.assert_array_equal(curve.at, [10, 20, 30])
    np.testing.assert_array_equal(curve.values, [[0.5, 1.5, 2.0], [4.0, np.nan, np.nan]])
    (alone,) = curves_of(tmp_path / "tb" / "a", "charts/return", over="minutes")
    assert alone.at[0] <= alone.at[-1] < 1
    with pytest.raises(
        SettingError, match="no column 'score'; it has: charts/return, loss; choose"
    ):
        curves_of(tmp_path / "tb", "score")


def test_old_tensorboard_files_are_read(tmp_path: Path) -> None:
    pytest.importorskip("tensorboard")
    tensorboardX = pytest.importorskip("tensorboardX")
    with tensorboardX.SummaryWriter(str(tmp_path)) as writer:
        writer.add_scalar("return", 0.25, 3)
    (curve,) = curves_of(tmp_path)
    np.testing.assert_array_equal(curve.values, [[0.25]])
    (tmp_path / "x.tfevents.2").write_bytes(b"\x10" * 64)
    (again,) = curves_of(tmp_path)
    np.testing.assert_array_equal(again.values, [[0.25]])


def test_endless_file_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(foreign, "LONGEST", 20)
    (tmp_path / "a.jsonl").write_text('{"step": 1, "return": 2}\n')
    with pytest.raises(SettingError, match=r"cannot read .*a\.jsonl: it has more than 20 char"):
        curves_of(tmp_path / "a.jsonl")
