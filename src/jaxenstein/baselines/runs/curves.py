"""Learning curves with confidence bands, and their plots."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import SettingError, nearest, one_line, quoted
from ...files import atomic, check_writable, name_of
from ...intervals import ENDS, RESAMPLES
from ..divergence import METRIC
from .experiment import exact
from .folder import RunFolder, has_run
from .foreign import Over, is_foreign, read_foreign
from .metrics import EPISODE_MEANS, METRICS, Row, read_metrics, read_seconds, rows_by_run

if TYPE_CHECKING:
    from matplotlib.figure import Figure

AXES = {"success": "success rate", "length": "steps of an episode"}
SUFFIXES = (".png", ".svg")
POINTS = 50


def band(curves: np.ndarray, *, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean over runs of curves[runs, points], with a 95 % band from resampling whole runs.

    NaN marks missing values. At a point where a run has none, all three results are NaN: the mean
    of the others would differ only because other runs are left.

    Returns:
        Mean, lower and upper end of the band, float64[points] each.
    """
    rng = np.random.default_rng(seed)
    runs = len(curves)
    # Resample the number of times that each run is drawn: this takes only a matrix product.
    counts = rng.multinomial(runs, np.full(runs, 1 / runs), size=RESAMPLES).astype(np.float64)
    low, high = np.quantile(counts @ curves / runs, ENDS, axis=0)
    return curves.mean(0), low, high


@dataclasses.dataclass(frozen=True)
class Curve:
    """A line of a plot.

    Attributes:
        label: label in the legend.
        at: float64[points], positions on the horizontal axis: decisions of each run, or minutes of
            all runs together.
        values: float64[runs, points]; NaN where no episode ended.
        over: label of the horizontal axis: "decisions", "minutes", or "steps" in a file of another
            program.
        diverged: the rows of `values` that diverged; after that they have no values.
    """

    label: str
    at: np.ndarray
    values: np.ndarray
    over: str = "decisions"
    diverged: tuple[int, ...] = ()


def curves_of(
    path: str | Path,
    metric: str | Sequence[str] = "return",
    points: int = POINTS,
    over: Over = "decisions",
    steps: Sequence[str] = (),
) -> list[Curve]:
    """The curves of a run directory, one for each point of its grid, or of other metrics.

    Args:
        path: a run directory, or metrics that `jaxenstein.baselines.runs.foreign.read_foreign`
            reads.
        metric: a metric, or several names, of which the first existing one is used. `return`,
            `length` and `success` are means over the episodes that ended; other metrics, and files
            without the sums over episodes, give means over rows.
        points: the maximum number of points. Each pools equally many positions on the horizontal
            axis. There are fewer points if a run would otherwise have gaps.
        over: the horizontal axis: decisions (world steps divided by the frame skip), or minutes of
            training, including compilation.
        steps: names of the step column in metrics of other programs.

    Raises:
        SettingError: there are no metrics, or no such column.
    """
    path, names = Path(path), [metric] if isinstance(metric, str) else list(metric)
    if path.name == METRICS and has_run(path.parent):
        path = path.parent
    if not has_run(path) and is_foreign(path):
        found = read_foreign(path, names, steps, over)
        along = "steps" if over == "decisions" else over
        return [
            Curve(found.label, *_pooled_runs(found.runs, found.metric, points, found.at), along)
        ]
    return _curves_of_run(RunFolder.open(path), names, points, over)


def _curves_of_run(folder: RunFolder, names: Sequence[str], points: int, over: Over) -> list[Curve]:
    experiment, rows = folder.experiment, read_metrics(folder.path)
    each = rows_by_run(rows, len(experiment.runs))
    if not each[0]:
        raise SettingError(f"{folder.path} has no metrics yet")
    metric = next((name for name in names if name in rows[0]), None)
    if metric is None:
        unknown = f"unknown metric {' or '.join(map(quoted, names))}{nearest(names[0], rows[0])}"
        raise SettingError(f"{folder.path}: {unknown}; known: {', '.join(rows[0])}")
    grid = [name for name, _ in experiment.grid]
    by_run: dict[str, list[list[Row]]] = {}
    for run, of_run in zip(experiment.runs, each, strict=True):
        by_run.setdefault(_label(folder.path, grid, run), []).append(of_run)
    at = np.array([row["steps"] for row in each[0]], np.float64)
    if over == "minutes":
        at = read_seconds(folder.path, len(at)) / 60
    return [
        Curve(label, *_pooled_runs(runs, metric, points, [at] * len(runs)), over, _diverged(runs))
        for label, runs in by_run.items()
    ]


def _label(path: Path, grid: Sequence[str], run: Mapping[str, float | int]) -> str:
    name = name_of(path)
    return ", ".join([name, *(f"{number} {exact(run[number])}" for number in grid)])


def _diverged(runs: Sequence[Sequence[Row]]) -> tuple[int, ...]:
    return tuple(number for number, rows in enumerate(runs) if any(row.get(METRIC) for row in rows))


def _pooled_runs(
    runs: Sequence[Sequence[Row]], metric: str, points: int, at: Sequence[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """The positions of the points on the horizontal axis, and values float64[runs, points].

    Args:
        runs: the rows of each run.
        metric: a column.
        points: the maximum number of points.
        at: the positions of the rows of each run, in ascending order.
    """
    ends = _ends(at, points)
    parts = [np.searchsorted(ends, of_run) for of_run in at]
    values = np.full((len(runs), len(ends)), np.nan)
    for number, (rows, part) in enumerate(zip(runs, parts, strict=True)):
        sums = any({"episodes", EPISODE_MEANS.get(metric)} <= {*row} for row in rows)
        for point in np.unique(part):
            pooled = [row for row, own in zip(rows, part, strict=True) if own == point]
            values[number, point] = _mean_episode(pooled, metric) if sums else _mean(pooled, metric)
    return ends, values


def _ends(at: Sequence[np.ndarray], points: int) -> np.ndarray:
    """The last position of each point, float64[<= points].

    Between its first and its last row, every run has rows for every point.
    """
    places = np.unique(np.concatenate(at))
    for count in range(min(points, len(places)), 1, -1):
        ends = np.array([part[-1] for part in np.array_split(places, count)])
        if all(np.all(np.diff(np.searchsorted(ends, of_run)) <= 1) for of_run in at):
            return ends
    return places[-1:]


def _mean_episode(rows: Sequence[Row], metric: str) -> float:
    ended = [row for row in rows if row.get(EPISODE_MEANS[metric]) is not None]
    episodes = sum(row.get("episodes") or 0 for row in ended)
    total = sum(row[EPISODE_MEANS[metric]] or 0 for row in ended)
    return total / episodes if episodes else np.nan


def _mean(rows: Sequence[Row], metric: str) -> float:
    there = [value for row in rows if (value := row.get(metric)) is not None]
    return float(np.mean(there)) if there else np.nan


def check_picture(path: Path) -> None:
    """Check early whether a plot can be written.

    Raises:
        SettingError: the suffix is wrong, or matplotlib is missing.
        OutputError: the folder is missing or cannot be written to.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise SettingError(f"{path} should end in {' or '.join(SUFFIXES)}")
    _matplotlib()
    check_writable(path)


def save_plot(
    curves: Sequence[Curve], paths: Sequence[Path], metric: str = "return", title: str = ""
) -> None:
    """Plot curves with their bands into files.

    Args:
        curves: at least one curve.
        paths: files to write, .png or .svg.
        metric: the metric, for the label of the vertical axis.
        title: title of the plot.

    Raises:
        SettingError: a suffix is wrong, matplotlib is missing, or a curve has no point where all
            its runs have values.
        OutputError: a file cannot be written.
    """
    for path in paths:
        check_picture(path)
    save_figure(plot(curves, metric, title), paths)


def save_figure(figure: Figure, paths: Sequence[Path]) -> None:
    """Write a figure into files that `check_picture` has passed.

    Raises:
        OutputError: a file cannot be written.
    """
    for path in paths:
        suffix = path.suffix.lower()[1:]
        # No date and fixed ids, so that equal plots give equal files.
        metadata = {"Date": None} if suffix == "svg" else {"Software": None}
        with _matplotlib().rc_context({"svg.hashsalt": "jaxenstein"}), atomic(path) as temporary:
            figure.savefig(temporary, format=suffix, dpi=150, metadata=metadata)


def plot(curves: Sequence[Curve], metric: str = "return", title: str = "") -> Figure:
    """The plot as a matplotlib figure; raises as `save_plot`."""
    figure = new_figure(6.4, 4.0)
    axes = figure.subplots()
    for curve in curves:
        runs, lost = len(curve.values), len(curve.diverged)
        # If all runs diverged, the curve shows them until then.
        kept = curve.values if lost == runs else np.delete(curve.values, curve.diverged, 0)
        mean, low, high = band(kept)
        there = ~np.isnan(mean)
        if lost < runs and not there.any():
            raise SettingError(
                f"{curve.label}: there is no point where all {runs} runs have a value of {metric!r}"
                if runs > 1
                else f"{curve.label} has no value of {metric!r}"
            )
        many = [f"{runs} runs"] * (runs > 1)
        many += [f"{lost} diverged" if runs > 1 else "diverged"] * bool(lost)
        count = f" ({', '.join(many)})" if many else ""
        # A line through a single point would be invisible.
        marker = "o" if np.sum(there) == 1 else ""
        at = curve.at[there]
        (line,) = axes.plot(
            at, mean[there], marker=marker, label=in_figure(f"{curve.label}{count}")
        )
        if len(kept) > 1:
            colour = line.get_color()
            axes.fill_between(at, low[there], high[there], color=colour, alpha=0.2, lw=0)
    # Beside a run, steps of other programs count as decisions.
    counted = {curve.over for curve in curves}
    axes.set_xlabel(min(counted))
    axes.set_ylabel(in_figure(AXES.get(metric, metric.replace("_", " "))))
    axes.set_title(in_figure(title))
    axes.grid(alpha=0.3)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False)
    if metric == "success":
        axes.set_ylim(-0.03, 1.03)
    return figure


def in_figure(text: str) -> str:
    """A text as matplotlib draws it: formulas stand between its dollars, and "_" hides a label."""
    text = one_line(text).replace("$", r"\$")
    return f" {text}" if text.startswith("_") else text


def new_figure(width: float, height: float) -> Figure:
    """An empty figure; width and height in inches."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return _matplotlib().figure.Figure(figsize=(width, height), layout="constrained")


def _matplotlib() -> Any:
    try:
        import matplotlib
        import matplotlib.figure
    except ImportError as error:
        raise SettingError(
            f"plots need matplotlib ({error}): pip install 'jaxenstein[baselines]'"
        ) from error
    return matplotlib
