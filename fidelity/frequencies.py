"""A permutation test that compares the frequencies of categories in two samples.

A sample is a list of observations. An observation lists, for each table, the categories that it
counts for; these may be several (the doors of a layout) or none. So no standard distribution
applies to the sums. Instead, the pooled observations are split at random into two samples many
times.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

Observation = dict[str, list[str]]
DEALS = 5000
"""The number of permutations: no p-value can be below 1 / 5001."""


def chances(
    first: Sequence[Observation], second: Sequence[Observation], seed: int = 0
) -> dict[str, float]:
    """The p-value of the difference of the samples, for each table.

    The statistic is the sum over categories of the squared difference of means, divided by the
    variance of the pooled observations.
    """
    pooled = [*first, *second]
    weights = np.repeat([1 / len(first), -1 / len(second)], [len(first), len(second)])
    rng = np.random.default_rng(seed)
    # The first row is the actual split, the other rows are random splits.
    deals = np.stack([weights, *(rng.permutation(weights) for _ in range(DEALS))])
    found = {}
    for table in dict.fromkeys(table for observation in pooled for table in observation):
        shown = [observation.get(table, []) for observation in pooled]
        names = sorted({name for some in shown for name in some})
        counts = np.array([[some.count(name) for name in names] for some in shown], np.float32)
        differences, variance = deals.astype(np.float32) @ counts, counts.var(0)
        varies = variance > 0
        scores = (differences[:, varies] ** 2 / variance[varies]).sum(1)
        found[table] = float((scores >= scores[0] * (1 - 1e-5)).mean())
    return found
