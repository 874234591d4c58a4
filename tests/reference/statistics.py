"""Aggregates of scores by their definitions, in plain Python with exact fractions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

Tasks = Sequence[Sequence[float]]


def repeated(tasks: Tasks) -> list[list[Fraction]]:
    """The scores of each task, repeated until all tasks have equally many."""
    most = math.lcm(*(len(runs) for runs in tasks))
    return [[Fraction(run) for run in runs for _ in range(most // len(runs))] for runs in tasks]


def interquartile_mean(tasks: Tasks) -> float:
    scores = sorted(score for runs in repeated(tasks) for score in runs)
    left_out = len(scores) // 4
    kept = scores[left_out : len(scores) - left_out]
    return float(sum(kept) / len(kept))


def task_means(tasks: Tasks) -> list[Fraction]:
    return [sum(map(Fraction, runs), Fraction(0)) / len(runs) for runs in tasks]


def mean(tasks: Tasks) -> float:
    return float(sum(task_means(tasks)) / len(tasks))


def median(tasks: Tasks) -> float:
    means = sorted(task_means(tasks))
    middle = len(means) // 2
    return float((means[middle] + means[-middle - 1]) / 2)


def optimality_gap(tasks: Tasks) -> float:
    missed = [[1 - min(Fraction(run), Fraction(1)) for run in runs] for runs in tasks]
    return float(sum(sum(runs) / len(runs) for runs in missed) / len(tasks))


def fraction_above(tasks: Tasks, tau: float) -> float:
    shares = [Fraction(sum(run > tau for run in runs), len(runs)) for runs in tasks]
    return float(sum(shares) / len(shares))


def probability_of_improvement(x: Tasks, y: Tasks) -> float:
    total = Fraction(0)
    for mine, its in zip(x, y, strict=True):
        pairs = [(one, other) for one in mine for other in its]
        won = sum(one > other for one, other in pairs)
        tied = sum(one == other for one, other in pairs)
        total += Fraction(2 * won + tied, 2 * len(pairs))
    return float(total / len(x))
