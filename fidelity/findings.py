"""Measured facts, each with its sample size, as a table; their statistics."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from typing import Any

from scipy import stats


class Findings:
    """A table of measured facts, each printed as it is found."""

    def __init__(self, title: str) -> None:
        """Begin a table."""
        print(f"\n{title}\n\n| what | measured | n | note |\n|---|---|---:|---|", flush=True)

    def add(self, what: str, value: Any, n: int, note: str = "") -> None:
        """Add a fact.

        Args:
            what: what was measured.
            value: a number, text, tuple of numbers or a dictionary of counts.
            n: of how many episodes, steps or things.
            note: what else there is to say.
        """
        print(f"| {what} | {shown(value)} | {n} | {note} |", flush=True)


def shown(value: Any) -> str:
    """A value as a cell of a table."""
    if isinstance(value, dict):
        return ", ".join(f"{key}: {count}" for key, count in value.items())
    if isinstance(value, tuple | list):
        return " ".join(f"{entry:g}" for entry in value)
    return f"{value:g}" if isinstance(value, float) else str(value)


def mean_and_error(values: Sequence[float]) -> tuple[float, float]:
    """Mean and its standard error (nan for fewer than two values)."""
    if len(values) < 2:
        return statistics.fmean(values), math.nan
    return statistics.fmean(values), statistics.stdev(values) / math.sqrt(len(values))


def chi_square(counts: Sequence[float]) -> tuple[float, float]:
    """Pearson's statistic of counts that should be equal, and the chance of a greater one."""
    found = stats.chisquare(counts)
    return float(found.statistic), float(found.pvalue)
