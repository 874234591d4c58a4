"""The plots of the report: steps a second against peers, batch, image, map, sprites, training."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks import report_training
from benchmarks.results import Part, Row
from jaxenstein.errors import SettingError
from jaxenstein.files import atomic

OURS, PEERS = "#1f6fb4", "#9a9a9a"
STEPS = "steps a second"
TRAINING = "training.png"


def save_plots(parts: Mapping[str, Part], folder: Path) -> dict[str, list[str]]:
    """Draw what can be drawn of the parts.

    Args:
        parts: by name.
        folder: where to write the PNG files; it must exist.

    Returns:
        For each part the names of its files.

    Raises:
        SettingError: matplotlib is missing.
        OutputError: a file cannot be written.
    """
    drawn: dict[str, list[str]] = {}
    for file, (name, draw) in PLOTS.items():
        if name not in parts or not parts[name].measured:
            continue
        figure = draw(parts[name].measured)
        if figure is None:
            continue
        with atomic(folder / file) as path:
            # Without the date and versions, equal plots are equal files.
            figure.savefig(path, format="png", dpi=150, metadata={"Software": None})
        drawn.setdefault(name, []).append(file)
    return drawn


def save_training_plot(rows: Sequence[Mapping[str, Any]], folder: Path) -> list[str]:
    """Draw the comparison of `train_compare.py`; the name of its file, none if all failed.

    Raises:
        SettingError: matplotlib is missing.
        OutputError: the file cannot be written.
    """
    figure = draw_training(rows)
    if figure is None:
        return []
    with atomic(folder / TRAINING) as path:
        figure.savefig(path, format="png", dpi=150, metadata={"Software": None})
    return [TRAINING]


def draw_training(rows: Sequence[Mapping[str, Any]]) -> Any:
    """Steps a second of both sides over the environments, failures as crosses; None if all are."""
    sides = {report_training.OURS: (OURS, "o"), report_training.THEIRS: (PEERS, "s")}
    reached = [
        side["steps_per_second"][q] for row in rows for side in row["sides"].values()
        if "steps_per_second" in side for q in ("lower_quartile", "upper_quartile")
    ]  # fmt: skip
    if not reached:
        return None
    figure, axes = _figure(3.8)
    floor = min(reached) / 2
    for level, (side, (colour, marker)) in enumerate(sides.items()):
        points = [(row["envs"], row["sides"][side]) for row in rows]
        good = [(n, each["steps_per_second"]) for n, each in points if "failed" not in each]
        numbers = [n for n, _ in good]
        low, middle, high = (
            [rates[q] for _, rates in good] for q in ("lower_quartile", "median", "upper_quartile")
        )
        title = report_training.TITLES[side]
        axes.plot(numbers, middle, marker=marker, color=colour, label=title)
        axes.fill_between(numbers, low, high, color=colour, alpha=0.2, lw=0)
        bad = [n for n, each in points if "failed" in each]
        if bad:
            # Below all rates, one line of crosses above the other.
            places = [floor / 1.4 ** (1 - level)] * len(bad)
            axes.plot(bad, places, "x", color=colour, ms=8, mew=2, label=f"{title}: no figure")
    axes.set_xscale("log", base=2)
    axes.set_yscale("log")
    axes.set_ylim(floor / 2, max(reached) * 2)
    _plain(axes.yaxis, logarithmic=True)
    ticks = [row["envs"] for row in rows]
    axes.set_xticks(ticks, [str(n) for n in ticks], minor=False)
    axes.set_xticks([], minor=True)
    axes.set_xlabel("environments (logarithmic)")
    axes.set_ylabel("training steps a second (logarithmic)")
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)
    return figure


def draw_bars(rows: Sequence[Row], logarithmic: bool = True) -> Any:
    """Horizontal bars, one a subject, in the rows' order."""
    figure, axes = _figure(0.9 + 0.27 * len(rows))
    places = range(len(rows))
    spread = [
        [row.median - row.rates["lower_quartile"] for row in rows],
        [row.rates["upper_quartile"] - row.median for row in rows],
    ]
    colours = [OURS if "jaxenstein" in row.versions else PEERS for row in rows]
    axes.barh(places, [row.median for row in rows], color=colours, xerr=spread, height=0.7)
    axes.set_yticks(places, [row.title for row in rows], fontsize=8)
    axes.invert_yaxis()
    for place, row in zip(places, rows, strict=True):
        axes.annotate(
            f"{row.median:,.0f}", (row.rates["upper_quartile"], place), xytext=(4, 0),
            textcoords="offset points", va="center", fontsize=8,
        )  # fmt: skip
    if logarithmic:
        axes.set_xscale("log")
        # Space for the last figure; a logarithmic axis has no natural zero.
        least, most = (choose(row.median for row in rows) for choose in (min, max))
        axes.set_xlim(least / 2, most * 4)
    else:
        axes.margins(x=0.15)
    _plain(axes.xaxis, logarithmic, subs=(1.0,))
    axes.set_xlabel(STEPS + (" (logarithmic)" if logarithmic else ""))
    axes.grid(axis="x", alpha=0.3)
    return figure


def draw_lines(
    rows: Sequence[Row], axis: str, label: str, value: Callable[[Any], float] = float
) -> Any:
    """Lines of steps a second over an axis, one for each id; None if no row has that axis."""
    rows = [row for row in rows if axis in row.axes]
    if not rows:
        return None
    lines: dict[str, list[Row]] = {}
    for row in rows:
        lines.setdefault(str(row.axes.get("id", "")), []).append(row)
    figure, axes = _figure(3.8)
    for name, points in lines.items():
        points = sorted(points, key=lambda row: value(row.axes[axis]))
        places = [value(row.axes[axis]) for row in points]
        style: dict[str, Any] = {"color": PEERS} if name == "ViZDoom" else {}
        (line,) = axes.plot(places, [row.median for row in points], marker="o", label=name, **style)
        low, high = ([row.rates[q] for row in points] for q in ("lower_quartile", "upper_quartile"))
        axes.fill_between(places, low, high, color=line.get_color(), alpha=0.2, lw=0)
    axes.set_xscale("log", base=2)
    axes.set_yscale("log")
    # Room above and below: small differences should look small.
    axes.set_ylim(min(row.median for row in rows) / 2, max(row.median for row in rows) * 2)
    _plain(axes.yaxis, logarithmic=True)
    ticks = {value(row.axes[axis]): str(row.axes[axis]) for row in rows}
    axes.set_xticks(list(ticks), list(ticks.values()), minor=False)
    axes.set_xticks([], minor=True)
    axes.set_xlabel(label)
    axes.set_ylabel(f"{STEPS} (logarithmic)")
    axes.grid(alpha=0.3)
    if len(lines) > 1:
        axes.legend(frameon=False)
    return figure


def pixels(size: str) -> float:
    """Pixels of an image of size WxH."""
    width, _, height = size.partition("x")
    return float(width) * float(height)


def _of_ids(rows: Sequence[Row]) -> Any:
    """Bars of the environments, named by their ids."""
    import dataclasses

    named = [dataclasses.replace(row, title=row.axes["id"]) for row in rows if "id" in row.axes]
    return draw_bars(named, logarithmic=False) if named else None


def _plain(axis: Any, logarithmic: bool, subs: Sequence[float] = (1.0, 2.0, 5.0)) -> None:
    """Write the figures of an axis in full: of a logarithmic one `subs` of each power of ten."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    if logarithmic:
        axis.set_major_locator(LogLocator(subs=subs))
        axis.set_minor_formatter(NullFormatter())
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.0f}"))


def _figure(height: float) -> tuple[Any, Any]:
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise SettingError(f"plots need matplotlib ({error}): pip install '.[bench]'") from error
    with warnings.catch_warnings():
        # Some versions of its dependencies warn where they are used for the first time.
        warnings.simplefilter("ignore")
        figure = Figure(figsize=(7.2, height), layout="constrained")
    axes = figure.subplots()
    axes.spines[["top", "right"]].set_visible(False)
    return figure, axes


Plot = tuple[str, Callable[[Sequence[Row]], Any]]
PLOTS: dict[str, Plot] = {
    "peers.png": ("peers", draw_bars),
    "cores.png": ("cores", draw_bars),
    "batches.png": ("batches", lambda rows: draw_lines(rows, "batch", "environments side by side")),
    "environments.png": ("environments", _of_ids),
    "resolutions.png": ("resolutions", lambda rows: draw_lines(rows, "size", "image", pixels)),
    "maps.png": ("maps-and-sprites", lambda rows: draw_lines(rows, "map", "tiles a side")),
    "sprites.png": ("maps-and-sprites", lambda rows: draw_lines(rows, "sprites", "sprites")),
}
