"""Comparing two samples: figures worked out by hand, and what chance does to the p values."""

from __future__ import annotations

import numpy as np
import pytest

from fidelity.frequencies import Observation, compare, details, frequencies, summary


def coins(rng: np.random.Generator, number: int, heads: float) -> list[Observation]:
    """Things that show one side of a coin, and up to three marks each."""
    return [
        {
            "side": ["heads" if rng.random() < heads else "tails"],
            "marks": ["a"] * int(rng.integers(4)),
        }
        for _ in range(number)
    ]


def test_frequencies() -> None:
    sample: list[Observation] = [{"x": ["a", "a", "b"]}, {"x": []}, {"x": ["b"]}, {"x": ["c"]}]
    assert frequencies(sample) == {"x": {"a": 0.5, "b": 0.5, "c": 0.25}}


def test_the_figures_of_a_small_table() -> None:
    first: list[Observation] = [{"x": ["a"]}] * 3 + [{"x": ["b"]}]
    second: list[Observation] = [{"x": ["a"]}] + [{"x": ["b"]}] * 3
    (found,) = compare(first, second)
    assert found.frequencies == {"a": (0.75, 0.25), "b": (0.25, 0.75)}
    assert found.distance == pytest.approx(0.5)
    # Four of eight show "a": a variance of 2/7 a thing, 1/7 for the difference of the means.
    assert found.chi_square == pytest.approx(0.25 / (1 / 7), rel=1e-5)
    # Of the 70 ways to deal four "a" to eight places, 2 differ by 1 and 32 by a half.
    assert found.p == pytest.approx(34 / 70, abs=0.04)
    assert found.chance == pytest.approx((2 * 1 + 32 * 0.5) / 70, abs=0.02)


def test_equal_tables_differ_by_nothing() -> None:
    sample: list[Observation] = [{"x": ["a"], "y": []}] * 5
    one, none = compare(sample, sample)
    assert (one.distance, one.chi_square, one.p) == (0, 0, 1)
    assert (none.distance, none.frequencies, none.p) == (0, {}, 1)


def test_p_is_uniform_where_nothing_differs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fidelity.frequencies.DEALS", 500)
    rng = np.random.default_rng(0)
    found = [compare(coins(rng, 60, 0.3), coins(rng, 90, 0.3), seed) for seed in range(40)]
    for table in zip(*found, strict=True):
        values = np.array([comparison.p for comparison in table])
        assert 0.3 < values.mean() < 0.7
        assert (values < 0.05).sum() <= 6
        assert 0.5 < np.mean([comparison.chi_square for comparison in table]) < 1.6


def test_a_difference_is_found() -> None:
    rng = np.random.default_rng(0)
    side, marks = compare(coins(rng, 300, 0.3), coins(rng, 300, 0.5))
    assert side.p < 0.002
    assert side.distance > side.chance_95
    assert marks.p > 0.01


def test_tables_for_people() -> None:
    found = compare(coins(np.random.default_rng(0), 9, 0.5), coins(np.random.default_rng(1), 9, 1))
    assert [line.count("|") for line in summary(found)] == [8] * 4
    assert len(list(details(found, "one", "other", most=1))) == 3
