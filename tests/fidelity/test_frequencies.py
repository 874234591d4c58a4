"""Comparison of two samples: a p-value computed by hand, and real and absent differences."""

from __future__ import annotations

import numpy as np
import pytest

from fidelity.frequencies import Observation, chances


def coins(rng: np.random.Generator, number: int, heads: float) -> list[Observation]:
    """Things that show one side of a coin, and up to three marks each."""
    return [
        {
            "side": ["heads" if rng.random() < heads else "tails"],
            "marks": ["a"] * int(rng.integers(4)),
        }
        for _ in range(number)
    ]


def test_p_value_of_a_small_table() -> None:
    first: list[Observation] = [{"x": ["a"]}] * 3 + [{"x": ["b"]}]
    second: list[Observation] = [{"x": ["a"]}] + [{"x": ["b"]}] * 3
    # Of the 70 ways to deal four "a" to eight places, 2 differ by 1 and 32 by a half.
    assert chances(first, second) == {"x": pytest.approx(34 / 70, abs=0.04)}
    sample: list[Observation] = [{"x": ["a", "a"], "y": []}] * 5
    assert chances(sample, sample) == {"x": 1, "y": 1}


def test_real_difference_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    found = chances(coins(rng, 300, 0.3), coins(rng, 300, 0.5))
    assert found["side"] < 0.002
    assert found["marks"] > 0.01
    monkeypatch.setattr("fidelity.frequencies.DEALS", 500)
    values = [chances(coins(rng, 60, 0.3), coins(rng, 90, 0.3), seed)["side"] for seed in range(40)]
    assert 0.3 < np.mean(values) < 0.7
