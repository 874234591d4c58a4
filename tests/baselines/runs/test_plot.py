"""Learning curves: pooling, the bootstrap band, files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("flax")
pytest.importorskip("matplotlib")

from jaxenstein import SettingError
from jaxenstein.baselines.runs.curves import (
    Curve,
    band,
    curves_of,
    plot,
    save_figure,
    save_plot,
)
from jaxenstein.baselines.runs.folder import RunFolder
from jaxenstein.baselines.runs.metrics import Timing, means, read_seconds
from jaxenstein.baselines.runs.score_plot import TITLES, plot_scores
from jaxenstein.files import OutputError
from jaxenstein.intervals import mean_interval
from jaxenstein.scores import Estimate, Profile
from tests.baselines.tiny import UPDATES, tiny


def write_run(path: Path, successes: list[list[int]], **options: Any) -> Path:
    """A run directory with the numbers of successes [update][run] in ten episodes."""
    experiment = tiny(**options)
    RunFolder.create(path, experiment)
    rows = []
    for update, numbers in enumerate(successes, 1):
        for run, number in zip(experiment.runs, numbers, strict=True):
            sums = {
                "episodes": 10 if number >= 0 else 0,
                "return_sum": max(number, 0),
                "length_sum": 80 if number >= 0 else 0,
                "successes": max(number, 0),
            }
            row = {"update": update, "steps": 32 * update, **run, **means(sums), **sums}
            rows.append(row | {"loss": 1.0 / update})
    text = "".join(json.dumps(row) + "\n" for row in rows)
    (path / "metrics.jsonl").write_text(text)
    return path


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_run(tmp_path / "run", [[0, 2], [-1, 4], [6, 8], [9, 10], [10, 10], [10, 10]])


def test_values_average_over_episodes_not_updates(folder: Path) -> None:
    (curve,) = curves_of(folder, "success", points=3)
    assert curve.label == "run"
    np.testing.assert_array_equal(curve.at, [64, 128, 192])
    # The first run's second update saw no episode end.
    np.testing.assert_allclose(curve.values, [[0, 0.75, 1], [0.3, 0.9, 1]])
    (curve,) = curves_of(folder, "success", points=50)
    assert curve.values.shape == (2, UPDATES)
    assert np.isnan(curve.values[0, 1])
    (curve,) = curves_of(folder, "loss", points=2)
    np.testing.assert_allclose(
        curve.values[0], [(1 + 1 / 2 + 1 / 3) / 3, (1 / 4 + 0.2 + 1 / 6) / 3]
    )


def test_grid_gives_a_curve_per_point(tmp_path: Path) -> None:
    path = write_run(tmp_path / "g", [[1, 2, 3, 4]], grid={"clip": [0.1, 0.2]})
    one, two = curves_of(path)
    assert (one.label, two.label) == ("g, clip 0.1", "g, clip 0.2")
    np.testing.assert_allclose(one.values, [[0.1], [0.2]])
    np.testing.assert_allclose(two.values, [[0.3], [0.4]])


def test_killed_run_is_plotted_up_to_last_complete_row(folder: Path) -> None:
    file = folder / "metrics.jsonl"
    lines = file.read_text().splitlines()
    file.write_text("\n".join(lines[:7]) + '\n{"update": 4, "st')
    (curve,) = curves_of(folder, "success")
    np.testing.assert_array_equal(curve.at, [32, 64, 96])


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("steps", value) for value in (None, "2", 2.5, 2**63, float("inf"))),
        *((name, None) for name in ("update", "episodes")),
        *(("return_sum", value) for value in (10**400, 4e38, float("nan"), [1.0])),
    ],
)
def test_invalid_metrics_rows_are_refused(folder: Path, name: str, value: object) -> None:
    file = folder / "metrics.jsonl"
    first, rest = file.read_text().split("\n", 1)
    file.write_text(json.dumps(json.loads(first) | {name: value}) + "\n" + rest)
    with pytest.raises(SettingError, match=r"metrics\.jsonl is damaged: "):
        curves_of(folder)


@pytest.mark.parametrize("name", ["update", "steps", "episodes"])
def test_rows_without_a_count_are_refused(folder: Path, name: str) -> None:
    file = folder / "metrics.jsonl"
    *rest, last = map(json.loads, file.read_text().splitlines())
    del last[name]
    file.write_text("".join(json.dumps(row) + "\n" for row in [*rest, last]))
    with pytest.raises(SettingError, match=f"is damaged: '{name}' in a row is not a whole number"):
        curves_of(folder)


def test_column_missing_from_later_rows_becomes_nan(folder: Path) -> None:
    file = folder / "metrics.jsonl"
    rows = [json.loads(line) for line in file.read_text().splitlines()]
    for row in rows[8:]:
        del row["loss"], row["return_sum"]
    file.write_text("".join(json.dumps(row) + "\n" for row in rows))
    (curve,) = curves_of(folder, "loss")
    np.testing.assert_array_equal(np.isnan(curve.values[0]), [False] * 4 + [True] * 2)
    (curve,) = curves_of(folder, "return")
    np.testing.assert_array_equal(np.isnan(curve.values[1]), [False] * 4 + [True] * 2)


def test_band_matches_all_resamples() -> None:
    """Compare with all 27 resamples of three runs, whose quantiles are exact."""
    values = np.array([0.0, 1.0, 5.0])
    draws = np.array(
        [np.mean([values[i], values[j], values[k]]) for i in range(3) for j in range(3)
         for k in range(3)]
    )  # fmt: skip
    mean, low, high = band(values[:, None])
    assert mean[0] == 2.0
    assert low[0] == np.quantile(draws, 0.025, method="inverted_cdf")
    assert high[0] == np.quantile(draws, 0.975, method="inverted_cdf")


def test_band_ends_where_the_first_run_ends() -> None:
    """The mean of the runs that are left would jump, and a band of one run has no width."""
    mean, low, high = band(np.array([[1.0, np.nan, np.nan], [3.0, 4.0, np.nan]]))
    np.testing.assert_array_equal(mean, [2, np.nan, np.nan])
    np.testing.assert_array_equal(low, [1, np.nan, np.nan])
    np.testing.assert_array_equal(high, [3, np.nan, np.nan])


def test_curves_without_a_common_point_are_refused() -> None:
    values = np.array([[1.0, np.nan], [np.nan, 1.0]])
    with pytest.raises(SettingError, match="a: there is no point where all 2 runs have a value of"):
        plot([Curve("a", np.arange(2.0), values)])
    with pytest.raises(SettingError, match="b has no value of 'loss'"):
        plot([Curve("b", np.arange(2.0), values[:1] * np.nan)], "loss")


def test_interval_of_one_run_is_of_the_mean() -> None:
    rng = np.random.default_rng(1)
    values = rng.normal(3.0, 2.0, size=(1, 400))
    interval = mean_interval(values)
    half = 1.96 * values.std() / 20
    assert interval.mean == values.mean()
    assert interval.low == pytest.approx(values.mean() - half, abs=0.15 * half)
    assert interval.high == pytest.approx(values.mean() + half, abs=0.15 * half)


def test_interval_of_several_runs_resamples_runs_not_episodes() -> None:
    """One run always succeeds and one never: many episodes are still only two samples."""
    values = np.repeat([[0.0], [1.0]], 1000, axis=1)
    interval = mean_interval(values)
    assert (interval.mean, interval.low, interval.high) == (0.5, 0.0, 1.0)


def test_plots_are_written_reproducibly(folder: Path, tmp_path: Path) -> None:
    curves = curves_of(folder, "success", points=3)
    paths = [tmp_path / "a.png", tmp_path / "a.svg", tmp_path / "b.svg"]
    save_plot(curves, paths, "success", "title")
    with Image.open(paths[0]) as image:
        assert image.size == (960, 600)
    assert "<svg" in paths[1].read_text()
    assert paths[1].read_bytes() == paths[2].read_bytes()


def test_minutes_add_up_over_sessions(folder: Path) -> None:
    # Killed after its fourth update, with a checkpoint after the third; the second row is missing.
    clock = [(1, 30), (3, 60), (4, 90), (4, 15), (5, 45), (6, 75)]
    rows = [json.dumps({"update": update, "seconds": s}) for update, s in clock]
    (folder / "timing.jsonl").write_text("\n".join([*rows, '{"upda']))
    np.testing.assert_allclose(read_seconds(folder, 6), [30, 45, 60, 105, 135, 165])
    (curve,) = curves_of(folder, "success", points=3, over="minutes")
    np.testing.assert_allclose(curve.at, [0.75, 1.75, 2.75])
    # A session that begins at an older checkpoint, with other updates between its rows.
    clock = [(2, 10), (4, 20), (6, 30), (4, 0), (5, 7), (7, 14)]
    rows = [json.dumps({"update": update, "seconds": s}) for update, s in clock]
    (folder / "timing.jsonl").write_text("\n".join([*rows, ""]))
    np.testing.assert_allclose(read_seconds(folder, 7), [10, 10, 20, 30, 37, 40.5, 44])
    assert plot([curve], "success").axes[0].get_xlabel() == "minutes"


def test_unreadable_times_are_refused(folder: Path) -> None:
    with pytest.raises(SettingError, match=r"cannot read .*timing.jsonl: no such file"):
        curves_of(folder, over="minutes")
    for text, problem in (
        ("", "has no rows"),
        ("{}\n", "is damaged"),
        ("[\n", "is damaged"),
        ("[" * 10**5 + "\n", "is damaged"),
        ('{"update": Infinity, "seconds": 1}\n', "is damaged"),
        ('{"update": 1, "seconds": NaN}\n', "is damaged: .*nan seconds"),
        ('{"update": 1, "seconds": 1e999}\n', "is damaged: .*inf seconds"),
        (f'{{"update": 1, "seconds": {10**400}}}\n', "is damaged"),
    ):
        (folder / "timing.jsonl").write_text(text)
        with pytest.raises(SettingError, match=f"timing.jsonl {problem}"):
            curves_of(folder, over="minutes")


def test_incomplete_row_of_times_is_cut_off(folder: Path) -> None:
    """Otherwise the first row of the next session would be written into the same line."""
    row = '{"update": 1, "seconds": 30}\n'
    for whole, part in ((row, '{"upda'), (row, ""), ("", '{"upda')):
        (folder / "timing.jsonl").write_text(whole + part)
        Timing(folder, 32, 1).write(2)
        text = (folder / "timing.jsonl").read_text()
        assert text.startswith(whole)
        assert [json.loads(row)["update"] for row in text[len(whole) :].splitlines()] == [1, 2]


def test_times_of_sessions_add_up(folder: Path) -> None:
    """Also if the second session needs longer for its first row than the whole first one."""
    (folder / "timing.jsonl").write_text('{"update": 1, "seconds": 5}\n')
    Timing(folder, 32, 1)
    with (folder / "timing.jsonl").open("a") as file:
        file.write('{"update": 2, "seconds": 30}\n')
    assert read_seconds(folder, 2).tolist() == [5, 35]


def test_figure_shows_measured_values(folder: Path) -> None:
    lone = Curve("lone", np.array([10.0, 20.0]), np.array([[np.nan, 0.5]]))
    figure = plot([*curves_of(folder, "success", points=3), lone], "success")
    (axes,) = figure.axes
    first, second = axes.lines
    np.testing.assert_allclose(np.asarray(first.get_xydata()), [[64, 0.15], [128, 0.825], [192, 1]])
    np.testing.assert_allclose(np.asarray(second.get_xydata()), [[20, 0.5]])
    assert second.get_marker() == "o"
    legend = axes.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["run (2 runs)", "lone"]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("decisions", "success rate")


def test_labels_are_not_parsed_as_math(tmp_path: Path) -> None:
    """Matplotlib would parse text between dollar signs, and hide labels that begin with `_`."""
    labels = ["$\\frac{$", "_hidden", "a\x1b[2J\ud800"]
    curves = [Curve(label, np.array([1.0, 2.0]), np.array([[1.0, 2.0]])) for label in labels]
    save_plot(curves, [tmp_path / "a.png"], labels[0], title=labels[0])
    (axes,) = plot(curves, labels[0], labels[0]).axes
    legend = axes.get_legend()
    assert legend is not None
    shown = [text.get_text() for text in legend.get_texts()]
    assert shown == [r"\$\frac{\$", " _hidden", r"a\x1b[2J\ud800"]
    estimate = Estimate(0.0, 0.0, 0.0)
    profile = Profile(*(np.array([0.0, 1.0]) for _ in range(4)))
    scores = dict.fromkeys(TITLES, estimate)
    figure = plot_scores(dict.fromkeys(labels, scores), dict.fromkeys(labels, profile), "3 tasks")
    assert figure.axes[-1].get_xlabel() == "normalised score τ (3 tasks)"
    save_figure(figure, [tmp_path / "b.png"])


def test_impossible_plots_are_refused(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(SettingError, match="unknown metric 'sucess', did you mean 'success'"):
        curves_of(folder, "sucess")
    with pytest.raises(SettingError, match=r"should end in .png or .svg"):
        save_plot([], [tmp_path / "a.jpg"])
    with pytest.raises(OutputError, match="there is no folder"):
        save_plot([], [tmp_path / "none" / "a.png"])
    (folder / "metrics.jsonl").write_text("")
    with pytest.raises(SettingError, match="has no metrics yet"):
        curves_of(folder)
    (folder / "metrics.jsonl").unlink()
    with pytest.raises(SettingError, match=r"cannot read .*metrics.jsonl"):
        curves_of(folder)
