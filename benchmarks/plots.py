"""The plots of the pages: bars of subjects."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

from benchmarks.tables import Row
from jaxenstein.errors import SettingError

OURS, PEERS = "#1f6fb4", "#9a9a9a"
STEPS = "steps per second"


def bars(rows: Sequence[Row], label: str, note: str = "") -> Any:
    """Horizontal bars, one per row.

    Args:
        rows: the rows; those without `rates` are left out.
        label: the key of the label of a bar.
        note: the key of a note behind the number of a bar.
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


def _figure(height: float) -> tuple[Any, Any]:
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise SettingError(f"plots need matplotlib ({error}): pip install '.[bench]'") from error
    with warnings.catch_warnings():
        # Some versions of its dependencies warn on first use.
        warnings.simplefilter("ignore")
        figure = Figure(figsize=(7.2, height), layout="constrained")
    axes = figure.subplots()
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.3)
    axes.set_axisbelow(True)
    return figure, axes
