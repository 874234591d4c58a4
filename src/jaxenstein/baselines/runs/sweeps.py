"""Sweeps: the grids of the paper or others as experiments, and a summary of their results."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...intervals import Interval, mean_interval
from ..config import algorithm, algorithms
from .curves import curves_of
from .experiment import Experiment, exact
from .options import resolve

# The seeds of the paper at each point of its grids.
SEEDS = 5
# Points of a grid are compared over the last of so many parts of the updates.
PARTS = 10


def swept() -> tuple[str, ...]:
    """The algorithms that have a grid: those of the paper, and others registered with one."""
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
        given: options as in `resolve`; a `grid` among them takes the place of the paper's.
        algos: the algorithms.
        at_once: the most parallel runs of one program, which memory limits; seeds of one point
            stay together.
        paper: whether to train the paper's grids if none is given, or only one point of each; they
            do not vary a number that is given.

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
    """Split a grid along its first number until each part is small enough."""
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
    """The result of one point of a grid at the end of the training.

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
    """The points of all grids, sorted from the highest return to the lowest.

    Points without a finished episode in the last tenth come last, with NaN.

    Raises:
        SettingError: a folder holds no run, or no metrics yet.
    """
    points = []
    for folder in folders:
        curves = (curves_of(folder, metric, PARTS) for metric in ("return", "success"))
        points += [
            Point(earned.label, len(earned.values), _last(earned.values), _last(success.values))
            for earned, success in zip(*curves, strict=True)
        ]
    return sorted(points, key=lambda point: -np.nan_to_num(point.earned.mean, nan=-np.inf))


def _last(values: np.ndarray) -> Interval:
    """The mean over runs of the last column; runs without a value there are left out."""
    last = values[:, -1]
    there = last[~np.isnan(last)]
    if not there.size:
        return Interval(np.nan, np.nan, np.nan)
    return mean_interval(there[:, None])
