"""Means with their bootstrap intervals."""

from __future__ import annotations

import dataclasses

import numpy as np

# Resamples of a bootstrap, and the quantiles at the ends of a 95 % interval.
RESAMPLES, ENDS = 2000, (0.025, 0.975)


@dataclasses.dataclass(frozen=True)
class Interval:
    """A mean with its bootstrap interval.

    Attributes:
        mean: the mean of all values.
        low: the lower end of the 95 % interval; the mean itself if there is only one value.
        high: the upper end.
    """

    mean: float
    low: float
    high: float


def mean_interval(values: np.ndarray, *, seed: int = 0) -> Interval:
    """The mean of values[runs, samples], with its percentile bootstrap interval.

    Each resample draws runs and samples with replacement. All runs share the drawn samples, since
    sample n comes from the same episode in every run. With one run this is the ordinary bootstrap
    over samples (Efron & Tibshirani 1993).
    """
    values = np.asarray(values, np.float64)
    rng = np.random.default_rng(seed)
    runs, samples = values.shape
    means = np.empty(RESAMPLES)
    for number in range(RESAMPLES):
        chosen = rng.integers(runs, size=(runs, 1))
        means[number] = values[chosen, rng.integers(samples, size=(1, samples))].mean()
    low, high = np.quantile(means, ENDS)
    return Interval(float(values.mean()), float(low), float(high))
