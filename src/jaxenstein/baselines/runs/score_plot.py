"""Plots aggregate scores with their intervals, and performance profiles."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from ...scores import Estimate, Profile
from .curves import in_figure, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TITLES = {
    "interquartile_mean": "interquartile mean",
    "mean": "mean",
    "median": "median",
    "optimality_gap": "optimality gap (lower is better)",
}


def plot_scores(
    aggregates: Mapping[str, Mapping[str, Estimate]], profiles: Mapping[str, Profile], tasks: str
) -> Figure:
    """The plot as a matplotlib figure.

    Args:
        aggregates: results of `jaxenstein.scores.aggregates`, by policy.
        profiles: performance profiles, by policy.
        tasks: the number of tasks, in words.
    """
    figure = new_figure(9.6, 4.2 + 0.25 * len(aggregates))
    heights = [0.6 + 0.25 * len(aggregates), 3]
    rows: list[Any] = [[*TITLES], ["profile"] * len(TITLES)]
    axes = figure.subplot_mosaic(rows, height_ratios=heights)
    colours = [f"C{number}" for number in range(len(aggregates))]
    labels = [in_figure(policy) for policy in aggregates]
    for name, title in TITLES.items():
        ends = axes[name]
        for place, (found, colour) in enumerate(zip(aggregates.values(), colours, strict=True)):
            one = found[name]
            ends.barh(place, one.high - one.low, 0.6, one.low, color=colour, alpha=0.4, lw=0)
            ends.vlines(one.value, place - 0.3, place + 0.3, color=colour, lw=2)
        # Otherwise bars have no margin at the edge.
        ends.use_sticky_edges = False
        ends.margins(x=0.08)
        ends.locator_params(axis="x", nbins=4)
        ends.set_title(title, fontsize="small")
        ends.set_yticks(range(len(aggregates)), labels if name == "interquartile_mean" else [])
        ends.set_ylim(len(aggregates) - 0.4, -0.6)
        ends.grid(axis="x", alpha=0.3)
        ends.spines[["top", "right", "left"]].set_visible(False)
        ends.tick_params(left=False)
    below = axes["profile"]
    for found, label, colour in zip(profiles.values(), labels, colours, strict=True):
        below.step(found.taus, found.fractions, where="post", color=colour, label=label)
        band = {"step": "post", "color": colour, "alpha": 0.2, "lw": 0}
        below.fill_between(found.taus, found.low, found.high, **band)
    below.set_xlabel(f"normalised score τ ({tasks})")
    below.set_ylabel("fraction of runs with score above τ")
    below.set_ylim(-0.03, 1.03)
    below.grid(alpha=0.3)
    below.spines[["top", "right"]].set_visible(False)
    below.legend(frameon=False)
    return figure
