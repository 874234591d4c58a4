"""Grids over the numbers of the algorithms, those of the paper among them, and what they gave."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..config import algorithm, algorithms
from .curves import Interval, curves_of, mean_interval
from .experiment import Experiment, exact
from .options import resolve

# As many as the paper has at each point of its grids.
SEEDS = 5
# The share of the updates, at the end, that points of a grid are compared by.
LAST = 0.1


def swept() -> tuple[str, ...]:
    """The algorithms that have a grid: those of the paper, and any other that came with one."""
    return tuple(name for name, row in algorithms().items() if row.grid is not None)


def plan(
    given: Mapping[str, Any],
    algos: Sequence[str],
    at_once: int | None = None,
    *,
    paper: bool = True,
) -> dict[str, Experiment]:
    """The experiments of a sweep, by the names of their folders.

    Args:
        given: options as of `resolve`; a `grid` among them takes the place of the paper's.
        algos: the algorithms.
        at_once: the most runs that one program trains side by side, which memory limits; seeds
            are not taken apart.
        paper: whether the paper's grids are trained where none is given, or only a point of them;
            a number that is given is not varied by them.

    Raises:
        JAXensteinError: the options do not fit.
    """
    planned: dict[str, Experiment] = {}
    for algo in algos:
        paper_grid = (paper and algorithm(algo).grid) or {}
        varied = {name: values for name, values in paper_grid.items() if name not in given}
        grid = given.get("grid") or varied
        options = {"seeds": SEEDS, **given, "algo": algo, "grid": grid}
        for name, experiment in _split(algo, resolve(options), at_once):
            planned[name] = experiment
    return planned


def _split(name: str, experiment: Experiment, at_once: int | None) -> list[tuple[str, Experiment]]:
    """Take a grid apart, along its first number, until each part is small enough."""
    if at_once is None or len(experiment.runs) <= at_once or not experiment.grid:
        return [(name, experiment)]
    (number, values), *rest = experiment.grid
    parts: list[tuple[str, Experiment]] = []
    for value in values:
        hparams = {**experiment.hparams, number: value}
        part = dataclasses.replace(experiment, hparams=hparams, grid=tuple(rest))
        parts += _split(f"{name}-{number}-{exact(value)}", part, at_once)
    return parts


@dataclasses.dataclass(frozen=True)
class Point:
    """What one point of a grid gave at the end of the training.

    Attributes:
        label: its folder and numbers.
        runs: the number of seeds.
        earned: mean return of the last tenth of the updates, with an interval over seeds.
        success: the same of the success rate.
    """

    label: str
    runs: int
    earned: Interval
    success: Interval


def summary(folders: Sequence[Path]) -> list[Point]:
    """The points of all grids, that with the highest return first.

    Points without a finished episode in the last tenth come last, with NaN.

    Raises:
        SettingError: a folder holds no run, or no metrics yet.
    """
    points = []
    for folder in folders:
        pooled = round(1 / LAST)
        curves = zip(
            curves_of(folder, "return", pooled), curves_of(folder, "success", pooled), strict=True
        )
        for earned, success in curves:
            point = Point(
                earned.label, len(earned.values), _last(earned.values), _last(success.values)
            )
            points.append(point)
    return sorted(points, key=lambda point: -np.nan_to_num(point.earned.mean, nan=-np.inf))


def _last(values: np.ndarray) -> Interval:
    """The mean over runs of the last column; runs without a value there are left out."""
    last = values[:, -1]
    there = last[~np.isnan(last)]
    if not there.size:
        return Interval(np.nan, np.nan, np.nan)
    return mean_interval(there[:, None])
