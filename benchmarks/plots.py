"""The plots of the pages: bars of subjects, and lines over an axis."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from benchmarks.tables import Row
from jaxenstein.errors import SettingError

OURS, PEERS, OTHER = "#1f6fb4", "#9a9a9a", "#d9652b"
STEPS = "steps a second"


def bars(rows: Sequence[Row], label: str, note: str = "") -> Any:
    """Horizontal bars, one a row, in the rows' order.

    Args:
        rows: with `rates`; others are left out.
        label: the key of what stands beside a bar.
        note: the key of what stands behind its figure, if anything.

    Returns:
        The figure; None if there is nothing to draw.
    """
    rows = [row for row in rows if label in row and "rates" in row]
    if not rows:
        return None
    figure, axes = _figure(0.9 + 0.27 * len(rows))
    middle = [row["rates"]["median"] for row in rows]
    colours = [OURS if "jaxenstein" in row["versions"] else PEERS for row in rows]
    axes.barh(range(len(rows)), middle, color=colours, height=0.7)
    for place, row in enumerate(rows):
        low, high = row["rates"]["lower_quartile"], row["rates"]["upper_quartile"]
        axes.plot((low, high), (place, place), color="black", lw=1, alpha=0.5)
        told = f"  ({row[note]})" if row.get(note) else ""
        axes.annotate(
            f"{row['rates']['median']:,.0f}{told}", (max(high, middle[place]), place),
            xytext=(4, 0), textcoords="offset points", va="center", fontsize=8,
        )  # fmt: skip
    axes.set_yticks(range(len(rows)), [row[label] for row in rows], fontsize=8)
    axes.invert_yaxis()
    axes.margins(x=0.2, y=0.02)
    axes.set_xlabel(STEPS)
    axes.locator_params(axis="x", nbins=4)
    _plain(axes.xaxis)
    axes.grid(axis="x", alpha=0.3)
    axes.set_axisbelow(True)
    return figure


def lines(
    rows: Sequence[Row],
    axis: str,
    label: str,
    place: Callable[[Any], float] = float,
    logarithmic: bool = False,
) -> Any:
    """Steps a second over an axis, a line for each id, with quartiles as bands.

    Args:
        rows: those without `rates` or the axis are left out.
        axis: the key that the axis shows.
        label: of that axis.
        place: where a value of it lies.
        logarithmic: whether the speeds are; the axis always is.

    Returns:
        The figure; None if there is nothing to draw.
    """
    found: dict[str, list[tuple[Any, Mapping[str, Any]]]] = {}
    for row in rows:
        if axis in row and "rates" in row:
            found.setdefault(str(row.get("id", "")), []).append((row[axis], row["rates"]))
    if not found:
        return None
    figure, axes = _figure(3.4)
    ticks: dict[float, str] = {}
    for (name, points), colour in zip(found.items(), (OURS, OTHER, PEERS) * 9, strict=False):
        points.sort(key=lambda point: place(point[0]))
        ticks |= {place(value): str(value) for value, _ in points}
        placed = [(place(value), rates) for value, rates in points]
        _line(axes, name if len(found) > 1 else "", placed, PEERS if "ViZDoom" in name else colour)
    axes.set_xscale("log", base=2)
    axes.set_xticks(list(ticks), list(ticks.values()), minor=False)
    axes.set_xticks([], minor=True)
    if logarithmic:
        axes.set_yscale("log")
    else:
        # Small differences should look small.
        axes.set_ylim(bottom=0)
    _plain(axes.yaxis, logarithmic)
    axes.set_xlabel(label)
    axes.set_ylabel(STEPS + (" (logarithmic)" if logarithmic else ""))
    axes.grid(alpha=0.3)
    return figure


def _line(
    axes: Any, name: str, points: Sequence[tuple[float, Mapping[str, Any]]], colour: str
) -> None:
    places = [place for place, _ in points]
    low, middle, high = (
        [rates[q] for _, rates in points] for q in ("lower_quartile", "median", "upper_quartile")
    )
    axes.plot(places, middle, marker="o", color=colour)
    axes.fill_between(places, low, high, color=colour, alpha=0.2, lw=0)
    axes.annotate(
        name, (places[-1], middle[-1]), xytext=(8, 0), textcoords="offset points",
        va="center", color=colour, fontsize=9,
    )  # fmt: skip


def pixels(size: str) -> float:
    """Pixels of an image of size WxH."""
    width, _, height = size.partition("x")
    return float(width) * float(height)


def _plain(axis: Any, logarithmic: bool = False) -> None:
    """Write the figures of an axis in full; of a logarithmic one 1, 2, 5, 10, ..."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    if logarithmic:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
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
