"""Means with their bootstrap intervals."""

from __future__ import annotations

import dataclasses

import numpy as np

# Resamples of a bootstrap, and the share of them inside an interval.
RESAMPLES, LEVEL = 2000, 0.95


@dataclasses.dataclass(frozen=True)
class Interval:
    """A mean with its bootstrap interval.

    Attributes:
        mean: of all values.
        low: lower end of the 95 % interval; the mean itself where there is a single value.
        high: its upper end.
    """

    mean: float
    low: float
    high: float


def mean_interval(values: np.ndarray, *, seed: int = 0) -> Interval:
    """The mean of values[runs, samples], with the percentile interval of its bootstrap.

    Each resample takes as many runs as there are, with replacement, and as many samples, the same
    of every run: sample n is of the same episode in all of them. With one run that is the ordinary
    bootstrap over samples (Efron & Tibshirani 1993).
    """
    values = np.asarray(values, np.float64)
    rng = np.random.default_rng(seed)
    runs, samples = values.shape
    means = np.empty(RESAMPLES)
    for number in range(RESAMPLES):
        chosen = rng.integers(runs, size=(runs, 1))
        means[number] = values[chosen, rng.integers(samples, size=(1, samples))].mean()
    low, high = np.quantile(means, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return Interval(float(values.mean()), float(low), float(high))
