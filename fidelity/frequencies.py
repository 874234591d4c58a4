"""Two samples of random things, compared by how often each shows what.

A sample is a list of observations, one for each thing: for every table, the categories that it
adds one to. A thing may add to several categories of a table (the doors of a layout) or none. So
no textbook distribution holds for the sums; what chance does is found by dealing the pooled things
into two samples anew, many times.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

Observation = dict[str, list[str]]
DEALS = 5000
"""How often the things are dealt anew: no p can be below 1 / 5001."""


@dataclass(frozen=True)
class Comparison:
    """One table of two samples.

    Attributes:
        table: its name.
        frequencies: for each category, the times a thing in the first and in the second sample.
        distance: half the sum of the absolute differences; for tables with one category a thing,
            the total variation distance.
        chance_95: the distance that chance exceeds in 5 % of the deals.
        chi_square: the squared differences over their variance, averaged over the categories: 1
            is expected by chance.
        p: share of the deals whose chi-square is as large.
    """

    table: str
    frequencies: dict[str, tuple[float, float]]
    distance: float
    chance_95: float
    chi_square: float
    p: float


def compare(
    first: Sequence[Observation], second: Sequence[Observation], seed: int = 0
) -> list[Comparison]:
    """Compare two samples table by table."""
    pooled = [*first, *second]
    weights = np.repeat([1 / len(first), -1 / len(second)], [len(first), len(second)])
    rng = np.random.default_rng(seed)
    # The first row is that of the samples as they are, the others are those of chance.
    deals = np.stack([weights, *(rng.permutation(weights) for _ in range(DEALS))])
    tables = dict.fromkeys(table for observation in pooled for table in observation)
    return [_compare(table, pooled, deals.astype(np.float32), len(first)) for table in tables]


def _compare(
    table: str, pooled: Sequence[Observation], deals: np.ndarray, first: int
) -> Comparison:
    shown = [observation.get(table, []) for observation in pooled]
    names = sorted({name for some in shown for name in some})
    counts = np.array([[some.count(name) for name in names] for some in shown], np.float32)
    differences = deals @ counts
    distances = np.abs(differences).sum(1) / 2
    # The variance of the difference of two means, from that of the pooled things.
    variance = counts.var(0, ddof=1) * (1 / first + 1 / (len(counts) - first))
    varies = variance > 0
    squares = differences[:, varies] ** 2 / variance[varies]
    scores = squares.sum(1) / max(1, varies.sum())
    means = zip(counts[:first].mean(0).tolist(), counts[first:].mean(0).tolist(), strict=True)
    return Comparison(
        table=table,
        frequencies=dict(zip(names, means, strict=True)),
        distance=float(distances[0]),
        chance_95=float(np.quantile(distances[1:], 0.95)),
        chi_square=float(scores[0]),
        p=float((scores >= scores[0] * (1 - 1e-5)).mean()),
    )


def summary(comparisons: Sequence[Comparison]) -> Iterator[str]:
    """A Markdown table with one line for each comparison."""
    yield "| table | categories | distance | 95 % by chance | chi-square / categories | p |"
    yield "|---|---:|---:|---:|---:|---:|"
    for found in comparisons:
        yield (
            f"| {found.table} | {len(found.frequencies)} | {found.distance:.4f} "
            f"| {found.chance_95:.4f} | {found.chi_square:.2f} | {found.p:.3f} |"
        )


def details(comparisons: Sequence[Comparison], first: str, second: str, most: int) -> Iterator[str]:
    """A Markdown table with one line for each category, of tables with at most `most` of them."""
    yield f"| table | category | {first} | {second} |"
    yield "|---|---|---:|---:|"
    for found in comparisons:
        if len(found.frequencies) <= most:
            for category, (one, other) in found.frequencies.items():
                yield f"| {found.table} | {category or 'none'} | {one:.4f} | {other:.4f} |"
