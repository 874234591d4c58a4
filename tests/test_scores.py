"""Aggregates of scores and their intervals, against slow definitions, scipy and known chances."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

from jaxenstein import SettingError, scores
from tests.reference import statistics

NAMES = ("interquartile_mean", "mean", "median", "optimality_gap")
# Three runs of one task, in order; every resample of them can be listed.
THREE = [0.0, 0.25, 2.0]


def drawn(seed: int, runs: list[int]) -> list[np.ndarray]:
    """Scores of each task: some above 1, some below 0, and many ties."""
    rng = np.random.default_rng(seed)
    return [np.round(rng.normal(0.6, 0.5, number) * 8) / 8 for number in runs]


def as_lists(tasks: list[np.ndarray]) -> list[list[float]]:
    return [task.tolist() for task in tasks]


@pytest.mark.parametrize("runs", [[1], [7], [1] * 6, [5] * 4, [3, 3, 3], [1, 2, 4], [6, 10, 15, 4]])
@pytest.mark.parametrize("seed", range(3))
def test_statistics_match_their_definitions(runs: list[int], seed: int) -> None:
    tasks = drawn(seed, runs)
    estimates = scores.aggregates(tasks, resamples=2)
    assert tuple(estimates) == NAMES
    for name in NAMES:
        right = getattr(statistics, name)(as_lists(tasks))
        assert getattr(scores, name)(tasks) == pytest.approx(right, abs=1e-12)
        assert estimates[name].value == pytest.approx(right, abs=1e-12)
    taus = [-0.5, 0.0, 0.125, 0.6, 1.0, 9.0]
    right = [statistics.fraction_above(as_lists(tasks), tau) for tau in taus]
    np.testing.assert_allclose(scores.profile(tasks, taus).fractions, right, atol=1e-12)
    others = drawn(seed + 10, runs[::-1])
    right = statistics.probability_of_improvement(as_lists(tasks), as_lists(others))
    found = scores.probability_of_improvement(tasks, others, resamples=2)
    assert found.value == pytest.approx(right, abs=1e-12)


def test_aggregates_match_hand_computation() -> None:
    # Eight scores: the two lowest and the two highest are left out.
    table = np.array([[0.0, 0.5], [0.25, 0.75], [1.0, 1.0], [3.0, 0.5]])
    assert scores.interquartile_mean(table) == (0.5 + 0.5 + 0.75 + 1) / 4
    assert scores.mean(table) == (4.25 + 2.75) / 8
    assert scores.median(table) == (4.25 / 4 + 2.75 / 4) / 2
    assert scores.optimality_gap(table) == (1 + 0.75 + 0 + 0 + 0.5 + 0.25 + 0 + 0.5) / 8
    assert scores.profile(table, [0.5, 1.0]).fractions.tolist() == [4 / 8, 1 / 8]
    # A win, a tie and two losses; then a win of both runs.
    x, y = [np.array([1.0, 2.0]), np.array([5.0])], [np.array([2.0, 1.5]), np.array([4.0, 3.0])]
    assert scores.probability_of_improvement(x, y).value == ((1 + 0.5) / 4 + 1) / 2


def test_normalised_scores_match_hand_computation() -> None:
    returns = np.array([[-1.0, 0.0], [1.0, 4.0]])
    expected = [[0.0, 0.5], [1.0, 2.5]]
    np.testing.assert_array_equal(scores.normalised(returns, -1, 1), expected)
    for random, expert in (1.0, 1.0), (2.0, 1.0):
        with pytest.raises(SettingError, match="expert's return must be above"):
            scores.normalised(returns, random, expert)
    with pytest.raises(SettingError, match="must be finite, but one is nan"):
        scores.normalised([1.0, np.nan], 0, 1)
    with pytest.raises(SettingError, match="the expert's return must be a finite number, not inf"):
        scores.normalised([1.0], 0, np.inf)


def test_scipy_agrees() -> None:
    stats = pytest.importorskip("scipy.stats")
    table = np.stack(drawn(3, [11] * 7), axis=1)
    right = stats.trim_mean(table, 0.25, axis=None)
    assert scores.interquartile_mean(table) == pytest.approx(right, abs=1e-14)
    x, y = drawn(4, [8, 9, 3]), drawn(5, [6, 9, 12])
    chances = [
        stats.mannwhitneyu(one, other).statistic / (len(one) * len(other))
        for one, other in zip(x, y, strict=True)
    ]
    found = scores.probability_of_improvement(x, y, resamples=2).value
    assert found == pytest.approx(np.mean(chances), abs=1e-14)


def test_array_equals_the_list_of_its_columns() -> None:
    table = np.random.default_rng(0).normal(size=(4, 3))
    columns = list(table.T)
    assert scores.aggregates(table) == scores.aggregates(columns)
    assert scores.probability_of_improvement(table, table[:2]) == (
        scores.probability_of_improvement(columns, list(table[:2].T))
    )


def test_huge_common_multiple_of_run_counts() -> None:
    tasks = [np.linspace(0, 1, runs) for runs in range(1, 50)]
    assert scores.mean(tasks) == pytest.approx(np.mean([task.mean() for task in tasks]))
    assert 0.4 < scores.interquartile_mean(tasks) < 0.6


def equally_likely(tasks: list[list[float]]) -> list[list[tuple[float, ...]]]:
    """Every stratified resample."""
    draws = [itertools.product(runs, repeat=len(runs)) for runs in tasks]
    return [list(resample) for resample in itertools.product(*draws)]


@pytest.mark.parametrize("tasks", [[THREE], [THREE, [0.5, 1.0]], [[0.0, 1.0], [0.1, 0.7], [3.0]]])
def test_intervals_match_all_resamples(tasks: list[list[float]]) -> None:
    """Resamples are a few values with known chances, and an end lies where 2.5 % are passed."""
    resamples = equally_likely(tasks)
    found = scores.aggregates([np.array(task) for task in tasks], resamples=20_000)
    for name in NAMES:
        values = np.sort([getattr(statistics, name)(resample) for resample in resamples])
        # The share of 20,000 draws below an end is uncertain by 0.0011: 4 of these on each side.
        for end, level in (found[name].low, 0.025), (found[name].high, 0.975):
            near = [level - 0.0045, level + 0.0045]
            least, most = np.quantile(values, near, method="inverted_cdf")
            assert least - 1e-9 <= end <= most + 1e-9


def test_each_task_is_resampled_separately() -> None:
    """Two runs of two tasks: if whole runs were drawn, the mean would always be 1/2."""
    crossed = scores.aggregates(np.array([[0.0, 1.0], [1.0, 0.0]]))["mean"]
    assert (crossed.low, crossed.high) == (0.0, 1.0)
    equal = scores.aggregates(np.array([[0.25, 0.75], [0.25, 0.75]]))["mean"]
    assert (equal.low, equal.high) == (0.5, 0.5)


def test_profile_band_is_binomial() -> None:
    """Of ten runs six score above the threshold, and a resample has Binomial(10, 0.6) of them."""
    runs = np.array([0.0] * 4 + [1.0] * 6)[:, None]
    found = scores.profile(runs, [-1.0, 0.0, 0.5, 1.0], resamples=20_000)
    assert found.fractions.tolist() == pytest.approx([1, 0.6, 0.6, 0])
    # P(at most 2) = 0.0123 < 2.5 % < P(at most 3) = 0.0548; P(at most 8) = 0.954 < 97.5 % < 0.994.
    np.testing.assert_allclose(found.low, [1, 0.3, 0.3, 0], atol=1e-12)
    np.testing.assert_allclose(found.high, [1, 0.9, 0.9, 0], atol=1e-12)


def test_both_algorithms_are_resampled() -> None:
    """X takes its 2 twice and Y its 1 twice in a sixteenth of the resamples, and X wins all."""
    found = scores.probability_of_improvement([np.array([0.0, 2.0])], [np.array([1.0, 3.0])])
    # If one of them stayed as it is, X would win half of the pairs at most.
    assert (found.value, found.low, found.high) == (0.25, 0.0, 1.0)


def test_ties_count_as_half() -> None:
    same = np.full((4, 3), 0.5)
    assert scores.probability_of_improvement(same, same) == scores.Estimate(0.5, 0.5, 0.5)
    x = drawn(0, [6, 5])
    assert scores.probability_of_improvement(x, x).value == 0.5


def test_single_run_gives_points() -> None:
    table = np.array([[0.1, 0.9, 1.4, -0.3]])
    for estimate in scores.aggregates(table).values():
        assert estimate.low == pytest.approx(estimate.value, abs=1e-12)
        assert estimate.high == pytest.approx(estimate.value, abs=1e-12)
    assert scores.probability_of_improvement(table, table - 1) == scores.Estimate(1.0, 1.0, 1.0)
    found = scores.profile(table, [0.5])
    assert found.fractions == found.low == found.high == 0.5


def test_seeds() -> None:
    x, y = np.stack(drawn(0, [5] * 4), axis=1), np.stack(drawn(1, [5] * 4), axis=1)
    assert scores.aggregates(x, seed=3) == scores.aggregates(x, seed=3)
    assert scores.aggregates(x, seed=3) != scores.aggregates(x, seed=4)
    one, other = (scores.probability_of_improvement(x, y, seed=seed) for seed in (3, 3))
    assert one == other
    few = scores.aggregates(x, resamples=100)["mean"]
    assert few != scores.aggregates(x)["mean"]


def test_blocks_cover_all_resamples(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scores, "BLOCK", 7)
    table = np.stack(drawn(0, [5] * 4), axis=1)
    blocks = list(scores._Pool(list(table.T)).resampled(13, 0))
    assert sum(len(block) for block in blocks) == 13
    assert all((block.sum(axis=1) == 20).all() for block in blocks)


def test_intervals_have_about_their_nominal_coverage() -> None:
    """Means of 3 tasks of 20 normal runs: percentile intervals hold it in 93 to 95 % of cases."""
    rng = np.random.default_rng(0)
    held = {"mean": 0, "interquartile_mean": 0, "chance": 0}
    trials = 300
    for _ in range(trials):
        x, y = rng.normal(0.5, 1.0, (2, 20, 3))
        found: dict[str, Any] = scores.aggregates(x, resamples=400)
        found["chance"] = scores.probability_of_improvement(x, y, resamples=400)
        for name in held:
            held[name] += found[name].low <= 0.5 <= found[name].high
    # Of 300 trials at 93.5 % the share is uncertain by 1.4 %; 4 of these on each side.
    for name, count in held.items():
        assert 0.88 <= count / trials <= 0.99, name


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (np.zeros(3), r"must be an array \[runs, tasks\], or a list of one array \[runs\]"),
        ([[0.0, 1.0], [1.0, 2.0]], r"must be an array \[runs, tasks\], or a list"),
        ([np.zeros((2, 2))], r"must be an array \[runs, tasks\], or a list"),
        (0.5, r"must be an array \[runs, tasks\], or a list"),
        ([], "the scores have no tasks"),
        (np.zeros((3, 0)), "the scores have no tasks"),
        (np.zeros((0, 3)), "task 0 .* has no runs"),
        ([np.zeros(2), np.zeros(0)], "task 1 .* has no runs"),
        (np.array([[0.0, np.nan]]), r"task 1 \(from 0\) must be finite, but one is nan"),
        ([np.array([np.inf])], r"task 0 \(from 0\) must be finite, but one is inf"),
        (np.array([["a"]]), "must be real numbers"),
        (np.array([[1j]]), "must be real numbers"),
    ],
)
def test_wrong_scores_are_refused(wrong: Any, words: str) -> None:
    for function in (
        scores.mean,
        scores.aggregates,
        lambda given: scores.profile(given, [0.5]),
        lambda given: scores.probability_of_improvement(given, given),
    ):
        with pytest.raises(SettingError, match=words):
            function(wrong)


def test_other_wrong_arguments_are_refused() -> None:
    table = np.zeros((2, 3))
    with pytest.raises(SettingError, match="x has 3 tasks, but y has 2"):
        scores.probability_of_improvement(table, table[:, :2])
    with pytest.raises(SettingError, match="resamples must be a whole number >= 1"):
        scores.aggregates(table, resamples=0)
    with pytest.raises(SettingError, match="seed must be a whole number from 0"):
        scores.aggregates(table, seed=-1)
    with pytest.raises(SettingError, match="taus must have one axis"):
        scores.profile(table, 0.5)
    with pytest.raises(SettingError, match="taus must be finite"):
        scores.profile(table, [0.5, np.nan])
