"""Plans sweeps over the paper's grids or others, and summarises their results."""

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

# The number of seeds at each point, as in the paper.
SEEDS = 5
# Points are compared over the last of PARTS parts of the updates.
PARTS = 10


def swept() -> tuple[str, ...]:
    """The algorithms with a grid: those of the paper, and others registered with a grid."""
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
        given: options as in `resolve`; `grid` replaces the paper's grids.
        algos: the algorithms.
        at_once: the maximum number of parallel runs in one program, to save memory; the seeds of a
            point stay together.
        paper: without a grid in `given`, True trains the paper's grids, without hyperparameters
            that are given, and False a single point.

    Raises:
        JAXensteinError: the options are wrong.
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
        label: name of the folder and values of the point.
        runs: number of seeds.
        diverged: number of seeds that diverged; the next fields leave them out.
        earned: mean return over the last tenth of the updates, with an interval over seeds.
        success: the same for the success rate.
    """

    label: str
    runs: int
    diverged: int
    earned: Interval
    success: Interval


def summary(folders: Sequence[Path]) -> list[Point]:
    """The points of all grids, sorted by return, the highest first.

    Points without a finished episode in the last tenth of the updates have NaN and come last.

    Raises:
        SettingError: a folder holds no run, or no metrics yet.
    """
    points = []
    for folder in folders:
        curves = (curves_of(folder, metric, PARTS) for metric in ("return", "success"))
        points += [
            Point(
                earned.label,
                len(earned.values),
                len(earned.diverged),
                *(_last(np.delete(one.values, one.diverged, 0)) for one in (earned, success)),
            )
            for earned, success in zip(*curves, strict=True)
        ]
    return sorted(points, key=lambda point: -np.nan_to_num(point.earned.mean, nan=-np.inf))


def _last(values: np.ndarray) -> Interval:
    """The mean of the last column over runs; runs without a value are left out."""
    last = values[:, -1]
    there = last[~np.isnan(last)]
    if not there.size:
        return Interval(np.nan, np.nan, np.nan)
    return mean_interval(there[:, None])
