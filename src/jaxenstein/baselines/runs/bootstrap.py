"""Confidence intervals by the bootstrap: drawing runs anew from those there are."""

from __future__ import annotations

import dataclasses

import numpy as np

DRAWS = 2000
LEVEL = 0.95


@dataclasses.dataclass(frozen=True)
class Interval:
    """A mean, and where it may lie.

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

    Each draw takes as many runs as there are, with replacement, and as many samples, the same of
    every run: sample n is of the same episode in all of them. With one run that is the ordinary
    bootstrap over samples (Efron & Tibshirani 1993).
    """
    rng = np.random.default_rng(seed)
    runs, samples = values.shape
    means = np.empty(DRAWS)
    for draw in range(DRAWS):
        chosen = rng.integers(runs, size=(runs, 1))
        means[draw] = values[chosen, rng.integers(samples, size=(1, samples))].mean()
    low, high = np.quantile(means, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return Interval(float(values.mean()), float(low), float(high))


def band(curves: np.ndarray, *, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean over runs of curves[runs, points], with a 95 % band from drawing whole runs.

    Missing values are NaN; a point has the runs that have a value there. A point without any is
    NaN in all three.

    Returns:
        Mean, lower and upper end, float64[points] each.
    """
    rng = np.random.default_rng(seed)
    runs = len(curves)
    there = ~np.isnan(curves)
    values = np.where(there, curves, 0.0)
    # How often each run is drawn, instead of the runs themselves: two matrix products.
    draws = rng.multinomial(runs, np.full(runs, 1 / runs), size=DRAWS).astype(np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = values.sum(0) / there.sum(0)
        means = (draws @ values) / (draws @ there)
    ends = np.full((2, curves.shape[1]), np.nan)
    for point in np.flatnonzero(there.any(0)):
        found = means[:, point]
        ends[:, point] = np.quantile(found[~np.isnan(found)], [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return mean, ends[0], ends[1]
