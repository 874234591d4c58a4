"""Comparing two samples: figures worked out by hand, and differences that are there or not."""

from __future__ import annotations

import numpy as np
import pytest

from fidelity.frequencies import Observation, compare, details, summary


def coins(rng: np.random.Generator, number: int, heads: float) -> list[Observation]:
    """Things that show one side of a coin, and up to three marks each."""
    return [
        {
            "side": ["heads" if rng.random() < heads else "tails"],
            "marks": ["a"] * int(rng.integers(4)),
        }
        for _ in range(number)
    ]


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
    sample: list[Observation] = [{"x": ["a", "a"], "y": []}] * 5
    one, none = compare(sample, sample)
    assert one.frequencies == {"a": (2, 2)}
    assert (one.distance, one.chi_square, one.p) == (0, 0, 1)
    assert (none.distance, none.frequencies, none.p) == (0, {}, 1)


def test_a_difference_is_found_where_there_is_one(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    comparisons = compare(coins(rng, 300, 0.3), coins(rng, 300, 0.5))
    side, marks = comparisons
    assert side.p < 0.002
    assert side.distance > side.chance_95
    assert marks.p > 0.01
    assert [line.count("|") for line in summary(comparisons)] == [7] * 4
    assert len(list(details(comparisons, "one", "other", most=1))) == 3
    monkeypatch.setattr("fidelity.frequencies.DEALS", 500)
    values = [compare(coins(rng, 60, 0.3), coins(rng, 90, 0.3), seed)[0].p for seed in range(40)]
    assert 0.3 < np.mean(values) < 0.7
