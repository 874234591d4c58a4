"""Aggregate scores of algorithms over tasks, with bootstrap intervals, as in rliable.

The aggregates, the profile and the probability of improvement follow Agarwal, Schwarzer, Castro,
Courville and Bellemare, "Deep Reinforcement Learning at the Edge of the Statistical Precipice",
NeurIPS 2021 (arXiv 2108.13264). The bootstrap is stratified: each resample draws, for each task
separately, as many runs as the task has, with replacement. An interval ends at the 2.5 % and
97.5 % quantiles of the resamples. With one run per task an interval is a point.

Scores are an array float64[runs, tasks], or a list of arrays float64[runs], one for each task.
Tasks may have different numbers of runs and still have equal weight, as if the scores of each task
were repeated until all tasks have equally many. The score of a run is usually its mean return over
episodes, `normalised`.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from .errors import SettingError
from .fields import Domain, check_seed, check_value, check_whole
from .intervals import ENDS

# With this many, the ends of an interval vary with the seed by about a hundredth of its length.
RESAMPLES = 10_000
# The most numbers in an array of resamples.
BLOCK = 2**20

Scores = np.ndarray | Sequence[np.ndarray]


@dataclasses.dataclass(frozen=True)
class Estimate:
    """A statistic of all scores with its stratified bootstrap interval.

    Attributes:
        value: the statistic of the scores.
        low: the lower end of the 95 % interval.
        high: the upper end.
    """

    value: float
    low: float
    high: float


@dataclasses.dataclass(frozen=True)
class Profile:
    """A performance profile: the fraction of runs that score above each threshold.

    Attributes:
        taus: float64[points], the thresholds.
        fractions: float64[points], from 0 to 1.
        low: float64[points], the lower end of the pointwise 95 % interval.
        high: float64[points], the upper end.
    """

    taus: np.ndarray
    fractions: np.ndarray
    low: np.ndarray
    high: np.ndarray


def normalised(returns: Any, random: float, expert: float) -> np.ndarray:
    """Rescale returns so that a random player scores 0 and an expert 1.

    (return - random) / (expert - random)

    Args:
        returns: real numbers of any shape, from one task.
        random: the return of a player that samples actions uniformly.
        expert: the return of a good player.

    Returns:
        float64, of the same shape.

    Raises:
        SettingError: a number is not finite, or the expert's return is not the larger one.
    """
    random = float(check_value("the random player's return", Domain("number"), random))
    expert = float(check_value("the expert's return", Domain("number"), expert))
    if expert <= random:
        raise SettingError(
            f"the expert's return must be above the random player's, but is {expert:g} against "
            f"{random:g}"
        )
    return (_finite(returns, "returns") - random) / (expert - random)


def interquartile_mean(scores: Scores) -> float:
    """The mean of the middle half of all n = runs x tasks scores.

    Leaves out the lowest and the highest floor(n / 4) scores, as `scipy.stats.trim_mean` does with
    0.25. Outliers affect it less than the mean, and it has less variance than the median.

    Raises:
        SettingError: as in `aggregates`.
    """
    return _of(scores, _interquartile_mean)


def mean(scores: Scores) -> float:
    """The mean over tasks of the mean over runs.

    Raises:
        SettingError: as in `aggregates`.
    """
    return _of(scores, _mean)


def median(scores: Scores) -> float:
    """The median over tasks of the mean over runs.

    Raises:
        SettingError: as in `aggregates`.
    """
    return _of(scores, _median)


def optimality_gap(scores: Scores) -> float:
    """How far the runs fall short of a score of 1: 1 - mean of min(score, 1); lower is better.

    Raises:
        SettingError: as in `aggregates`.
    """
    return _of(scores, _optimality_gap)


def aggregates(scores: Scores, *, resamples: int = RESAMPLES, seed: int = 0) -> dict[str, Estimate]:
    """The four aggregates with their intervals, all from the same resamples.

    Args:
        scores: float64[runs, tasks], or a list of float64[runs], one for each task.
        resamples: the number of bootstrap resamples.
        seed: the seed of the resamples.

    Returns:
        The estimates by name: `interquartile_mean`, `mean`, `median` and `optimality_gap`; see
        the functions of these names.

    Raises:
        SettingError: the scores have the wrong form, a task has no run, or a score is not finite.
    """
    pool = _Pool(_tasks(scores))
    drawn = [
        [statistic(pool, weights) for statistic in AGGREGATES.values()]
        for weights in pool.resampled(resamples, seed)
    ]
    parts = zip(*drawn, strict=True)
    return {
        name: _estimate(statistic(pool, pool.weights), np.concatenate(part))
        for (name, statistic), part in zip(AGGREGATES.items(), parts, strict=True)
    }


def profile(scores: Scores, taus: Any, *, resamples: int = RESAMPLES, seed: int = 0) -> Profile:
    """The run-score distribution: the fraction of runs that score above each threshold.

    This is the mean over tasks and runs of [score > tau]. The band is pointwise: it holds at each
    threshold separately, not at all of them at once.

    Args:
        scores: as in `aggregates`.
        taus: real numbers [points].
        resamples: as in `aggregates`.
        seed: as in `aggregates`.

    Raises:
        SettingError: as in `aggregates`, or the thresholds are not a list of finite numbers.
    """
    taus = _finite(taus, "taus")
    if taus.ndim != 1:
        raise SettingError(f"taus must have one axis, not the shape {taus.shape}")
    pool = _Pool(_tasks(scores))
    above = (pool.values[:, None] > taus) / pool.total
    drawn = np.concatenate([weights @ above for weights in pool.resampled(resamples, seed)])
    low, high = np.quantile(drawn, ENDS, axis=0)
    return Profile(taus, pool.weights @ above, low, high)


def probability_of_improvement(
    x: Scores, y: Scores, *, resamples: int = RESAMPLES, seed: int = 0
) -> Estimate:
    """The probability that a run of X scores higher than a run of Y on a randomly drawn task.

    This is the mean over tasks of U / (N K), with N runs of X and K runs of Y. The Mann-Whitney
    statistic U counts the pairs in which X scores higher, and half of the ties. Runs of X and Y
    are resampled independently. Scores need not be `normalised`, because only their order within a
    task matters.

    Args:
        x: scores of an algorithm, as in `aggregates`.
        y: scores of another algorithm on the same tasks in the same order.
        resamples: as in `aggregates`.
        seed: as in `aggregates`.

    Raises:
        SettingError: as in `aggregates`, or the numbers of tasks differ.
    """
    pairs = _tasks(x), _tasks(y)
    if len(pairs[0]) != len(pairs[1]):
        raise SettingError(
            f"both algorithms need scores of the same tasks; x has {len(pairs[0])} tasks, but y "
            f"has {len(pairs[1])}"
        )
    rng = _generator(resamples, seed)
    value, drawn = 0.0, np.zeros(resamples)
    for mine, its in zip(*pairs, strict=True):
        wins = (mine[:, None] > its) + 0.5 * (mine[:, None] == its)
        one, other = (_counts(rng, len(runs), resamples) / len(runs) for runs in (mine, its))
        value += wins.mean()
        drawn += ((one @ wins) * other).sum(axis=1)
    return _estimate(value / len(pairs[0]), drawn / len(pairs[0]))


class _Pool:
    """All scores, each with a whole number as its weight.

    A resample is a set of weights too: how often it drew each score, times the score's weight.

    Attributes:
        values: float64[n], ascending.
        weights: float64[n]; the weights of each task have the same sum.
        total: the sum of all weights.
        tasks: bool[n, tasks], the task of each score.
    """

    def __init__(self, tasks: list[np.ndarray]) -> None:
        runs = [len(scores) for scores in tasks]
        common = math.lcm(*runs)
        pooled = np.concatenate(tasks)
        order = np.argsort(pooled, kind="stable")
        whose = np.repeat(np.arange(len(tasks)), runs)[order]
        self.values = pooled[order]
        self.weights = np.array([common // number for number in runs], np.float64)[whose]
        self.total = common * len(tasks)
        self.tasks = whose[:, None] == np.arange(len(tasks))

    def resampled(self, resamples: int, seed: int) -> Iterator[np.ndarray]:
        """Weights [block, n] of resamples, in blocks that fit into memory."""
        rng = _generator(resamples, seed)
        size = max(1, BLOCK // len(self.values))
        for start in range(0, resamples, size):
            counts = np.empty((min(size, resamples - start), len(self.values)))
            for mine in self.tasks.T:
                counts[:, mine] = _counts(rng, int(mine.sum()), len(counts))
            yield counts * self.weights

    def task_means(self, weights: np.ndarray) -> np.ndarray:
        """The mean score of each task [..., tasks]."""
        return (weights * self.values) @ self.tasks / (self.total / self.tasks.shape[1])


def _interquartile_mean(pool: _Pool, weights: np.ndarray) -> np.ndarray:
    left_out = float(pool.total // 4)
    within = np.clip(np.cumsum(weights, axis=-1), left_out, pool.total - left_out)
    kept = np.diff(within, axis=-1, prepend=left_out)
    return kept @ pool.values / (pool.total - 2 * left_out)


def _mean(pool: _Pool, weights: np.ndarray) -> np.ndarray:
    return weights @ pool.values / pool.total


def _median(pool: _Pool, weights: np.ndarray) -> np.ndarray:
    return np.median(pool.task_means(weights), axis=-1)


def _optimality_gap(pool: _Pool, weights: np.ndarray) -> np.ndarray:
    return 1 - weights @ np.minimum(pool.values, 1) / pool.total


AGGREGATES: dict[str, Callable[[_Pool, np.ndarray], np.ndarray]] = {
    "interquartile_mean": _interquartile_mean,
    "mean": _mean,
    "median": _median,
    "optimality_gap": _optimality_gap,
}


def _of(scores: Scores, statistic: Callable[[_Pool, np.ndarray], np.ndarray]) -> float:
    pool = _Pool(_tasks(scores))
    return float(statistic(pool, pool.weights))


def _tasks(scores: Scores) -> list[np.ndarray]:
    """The scores of each task, float64[runs]."""
    if isinstance(scores, np.ndarray) and scores.ndim == 2:
        parts = list(scores.T)
    elif isinstance(scores, list | tuple) and all(
        isinstance(part, np.ndarray) and part.ndim == 1 for part in scores
    ):
        parts = list(scores)
    else:
        raise SettingError(
            "scores must be an array [runs, tasks], or a list of one array [runs] for each task"
        )
    if not parts:
        raise SettingError("the scores have no tasks")
    for number, part in enumerate(parts):
        if not len(part):
            raise SettingError(f"task {number} (from 0) has no runs in the scores")
    return [_finite(part, f"scores of task {n} (from 0)") for n, part in enumerate(parts)]


def _finite(values: Any, what: str) -> np.ndarray:
    """Numbers as float64."""
    array = np.asarray(values)
    if array.dtype.kind not in "biuf":
        raise SettingError(f"{what} must be real numbers, not {array.dtype}")
    array = array.astype(np.float64)
    if not np.all(np.isfinite(array)):
        wrong = array[~np.isfinite(array)][0]
        raise SettingError(f"{what} must be finite, but one is {wrong}")
    return array


def _generator(resamples: int, seed: int) -> np.random.Generator:
    check_whole("resamples", resamples)
    check_seed(seed)
    return np.random.default_rng(seed)


def _counts(rng: np.random.Generator, runs: int, resamples: int) -> np.ndarray:
    """How often each resample draws each run: float64[resamples, runs]."""
    return rng.multinomial(runs, np.full(runs, 1 / runs), size=resamples).astype(np.float64)


def _estimate(value: Any, drawn: np.ndarray) -> Estimate:
    low, high = np.quantile(drawn, ENDS)
    return Estimate(float(value), float(low), float(high))
