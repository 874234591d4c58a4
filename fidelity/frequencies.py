"""Two samples of random things, compared by how often each shows what.

A sample is a list of observations, one for each thing: for every table, the categories that it
adds one to. A thing may add to several categories of a table (the doors of a layout) or none. So
no textbook distribution holds for the sums; what chance does is found by dealing the pooled things
into two samples anew, many times.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

Observation = dict[str, list[str]]
DEALS = 5000
"""How often the things are dealt anew: no p can be below 1 / 5001."""
_CHUNK = 250  # deals at once, to bound the memory


@dataclass(frozen=True)
class Comparison:
    """One table of two samples.

    Attributes:
        table: its name.
        frequencies: for each category, the times a thing in the first and in the second sample.
        distance: half the sum of the absolute differences; for tables with one category a thing,
            the total variation distance.
        chance: the mean of that distance when chance deals the pooled things.
        chance_95: the distance that chance exceeds in 5 % of the deals.
        chi_square: the squared differences over their variance, averaged over the categories: 1
            is expected by chance.
        p: share of the deals whose chi-square is as large.
    """

    table: str
    frequencies: dict[str, tuple[float, float]]
    distance: float
    chance: float
    chance_95: float
    chi_square: float
    p: float

    def as_dict(self) -> dict[str, Any]:
        """The same for JSON."""
        return asdict(self)


def frequencies(sample: Sequence[Observation]) -> dict[str, dict[str, float]]:
    """For each table and category, the times a thing."""
    counts: dict[str, Counter[str]] = {}
    for observation in sample:
        for table, categories in observation.items():
            counts.setdefault(table, Counter()).update(categories)
    return {
        table: {category: counter[category] / len(sample) for category in sorted(counter)}
        for table, counter in counts.items()
    }


def compare(
    first: Sequence[Observation], second: Sequence[Observation], seed: int = 0
) -> list[Comparison]:
    """Compare two samples table by table."""
    pooled = [*first, *second]
    tables = list(dict.fromkeys(table for observation in pooled for table in observation))
    names = [_names(table, pooled) for table in tables]
    counts = [_count(table, found, pooled) for table, found in zip(tables, names, strict=True)]
    differences = _differences(np.concatenate(counts, 1), len(first), seed)
    ends = np.cumsum([found.shape[1] for found in counts])[:-1]
    parts = zip(tables, names, counts, np.split(differences, ends, 1), strict=True)
    return [_compare_table(*part, len(first)) for part in parts]


def _names(table: str, pooled: Sequence[Observation]) -> list[str]:
    """The categories of a table."""
    return sorted({name for observation in pooled for name in observation.get(table, [])})


def _count(table: str, names: list[str], pooled: Sequence[Observation]) -> np.ndarray:
    """float32[things, categories], how often each thing shows what."""
    index = {name: number for number, name in enumerate(names)}
    counts = np.zeros((len(pooled), len(names)), np.float32)
    for thing, observation in enumerate(pooled):
        for name in observation.get(table, []):
            counts[thing, index[name]] += 1
    return counts


def _differences(counts: np.ndarray, first: int, seed: int) -> np.ndarray:
    """float32[1 + DEALS, categories], the differences of the means of two samples.

    The first row is that of the samples as they are, the others are those of chance.
    """
    second = len(counts) - first
    weights = np.repeat([1 / first, -1 / second], [first, second]).astype(np.float32)
    rng = np.random.default_rng(seed)
    rows = [weights[None] @ counts]
    for _ in range(DEALS // _CHUNK):
        rows.append(np.stack([rng.permutation(weights) for _ in range(_CHUNK)]) @ counts)
    return np.concatenate(rows)


def _compare_table(
    table: str, names: list[str], counts: np.ndarray, differences: np.ndarray, first: int
) -> Comparison:
    distances = np.abs(differences).sum(1) / 2
    # The variance of the difference of two means, from that of the pooled things.
    variance = counts.var(0, ddof=1) * (1 / first + 1 / (len(counts) - first))
    varies = variance > 0
    squares = differences[:, varies] ** 2 / variance[varies]
    scores = squares.mean(1) if varies.any() else np.zeros(len(differences))
    means = zip(counts[:first].mean(0).tolist(), counts[first:].mean(0).tolist(), strict=True)
    return Comparison(
        table=table,
        frequencies=dict(zip(names, means, strict=True)),
        distance=float(distances[0]),
        chance=float(distances[1:].mean()),
        chance_95=float(np.quantile(distances[1:], 0.95)),
        chi_square=float(scores[0]),
        p=float((1 + (scores[1:] >= scores[0] * (1 - 1e-5)).sum()) / len(scores)),
    )


def summary(comparisons: Sequence[Comparison]) -> Iterator[str]:
    """A Markdown table with one line for each comparison."""
    yield "| table | categories | distance | by chance | 95 % | chi-square / categories | p |"
    yield "|---|---:|---:|---:|---:|---:|---:|"
    for found in comparisons:
        numbers = (found.distance, found.chance, found.chance_95)
        shown = " | ".join(f"{number:.4f}" for number in numbers)
        yield (
            f"| {found.table} | {len(found.frequencies)} | {shown} | {found.chi_square:.2f} "
            f"| {found.p:.3f} |"
        )


def details(comparisons: Sequence[Comparison], first: str, second: str, most: int) -> Iterator[str]:
    """A Markdown table with one line for each category, of tables with at most `most` of them."""
    yield f"| table | category | {first} | {second} |"
    yield "|---|---|---:|---:|"
    for found in comparisons:
        if len(found.frequencies) <= most:
            for category, (one, other) in found.frequencies.items():
                yield f"| {found.table} | {category or 'none'} | {one:.4f} | {other:.4f} |"
