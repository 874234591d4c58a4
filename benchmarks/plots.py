"""The plots of the pages: bars of subjects, and lines over an axis."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
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
    """
    rows = [row for row in rows if "rates" in row]
    figure, axes = _figure(0.9 + 0.27 * len(rows))
    middle = [row["rates"]["median"] for row in rows]
    colours = [OURS if "jaxenstein" in row["versions"] else PEERS for row in rows]
    drawn = axes.barh([row[label] for row in rows], middle, color=colours, height=0.7)
    notes = [f"  ({row[note]})" if row.get(note) else "" for row in rows]
    figures = [f"{rate:,.0f}{told}" for rate, told in zip(middle, notes, strict=True)]
    axes.bar_label(drawn, figures, padding=4, fontsize=8)
    axes.tick_params(axis="y", labelsize=8)
    axes.invert_yaxis()
    axes.margins(x=0.2, y=0.02)
    axes.set_xlabel(STEPS)
    axes.xaxis.set_major_formatter("{x:,.0f}")
    axes.locator_params(axis="x", nbins=4)
    return figure


def lines(rows: Sequence[Row], axis: str, label: str) -> Any:
    """Steps a second over an axis, a line for each id.

    Args:
        rows: those without `rates` or the axis are left out.
        axis: the key that the axis shows: numbers, or image sizes such as 84x84.
        label: of that axis.
    """
    found: dict[str, dict[Any, Mapping[str, Any]]] = {}
    for row in rows:
        if axis in row and "rates" in row:
            found.setdefault(str(row.get("id", "")), {})[row[axis]] = row["rates"]
    figure, axes = _figure(3.4)
    ticks = {_place(value): str(value) for points in found.values() for value in points}
    for (name, points), colour in zip(found.items(), (OURS, OTHER, PEERS) * 9, strict=False):
        colour = PEERS if "ViZDoom" in name else colour
        values = sorted(points, key=_place)
        rates = [points[value]["median"] for value in values]
        axes.plot([_place(value) for value in values], rates, "o-", color=colour, label=name)
    if len(found) > 1:
        axes.legend(frameon=False)
    axes.set_xscale("log", base=2)
    axes.set_xticks(list(ticks), list(ticks.values()), minor=False)
    # Small differences should look small; sizes differ by more.
    axes.set_yscale("log" if axis == "size" else "linear")
    if axis != "size":
        axes.set_ylim(bottom=0)
    axes.yaxis.set_major_formatter("{x:,.0f}")
    axes.set_xlabel(label)
    axes.set_ylabel(STEPS)
    return figure


def _place(value: Any) -> float:
    """Where a value lies on the axis: an image by its pixels."""
    width, _, height = str(value).partition("x")
    return float(width) * float(height or 1)


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
    axes.grid(alpha=0.3)
    axes.set_axisbelow(True)
    return figure, axes
