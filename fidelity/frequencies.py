"""Two samples of random things, compared by how often each shows what.

A sample is a list of observations, one for each thing: for every table, the categories that it
adds one to. A thing may add to several categories of a table (the doors of a layout) or none. So
no textbook distribution holds for the sums; what chance does is found by dealing the pooled things
into two samples anew, many times.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

Observation = dict[str, list[str]]
DEALS = 5000
"""How often the things are dealt anew: no chance can be below 1 / 5001."""


def chances(
    first: Sequence[Observation], second: Sequence[Observation], seed: int = 0
) -> dict[str, float]:
    """For each table, how likely samples of the same things differ as much as these do.

    What counts is the sum over the categories of the squared differences of the means over their
    variance, which is that of the pooled things.
    """
    pooled = [*first, *second]
    weights = np.repeat([1 / len(first), -1 / len(second)], [len(first), len(second)])
    rng = np.random.default_rng(seed)
    # The first row is that of the samples as they are, the others are those of chance.
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
