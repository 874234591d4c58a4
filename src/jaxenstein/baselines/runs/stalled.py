"""Telling early that a training settles on a way of acting without ever having succeeded."""

from __future__ import annotations

import math
from collections.abc import Sequence

from .metrics import Row

# Episodes without a success that a run may have, and the share of its first entropy that its
# policy must have lost besides: before that it is still looking.
EPISODES = 1000
LOST = 0.5
# Standard errors by which the returns of late must lie above the first ones to have risen.
RISEN = 4.0
ADVICE = "docs/training.md, 'Where it does not learn', says what to try"


class StallWatch:
    """Looks at the rows of a training, and warns once where no run has succeeded.

    Runs that succeeded once, whose returns have risen, or whose policy is still close to random
    are not told of.
    """

    def __init__(self, runs: int) -> None:
        """Take the number of runs, whose rows alternate."""
        self._runs = runs
        self._episodes = self._successes = 0.0
        self._first: list[float] = []
        self._early, self._late = _Returns(), _Returns()
        self._told = False

    def look(self, rows: Sequence[Row]) -> str | None:
        """The warning if these rows, which follow those of before, are reason for one.

        Args:
            rows: whole updates.
        """
        for start in range(0, len(rows), self._runs):
            update = rows[start : start + self._runs]
            self._episodes += sum(row.get("episodes") or 0 for row in update)
            self._successes += sum(row.get("successes") or 0 for row in update)
            self._returns(update)
            now = [row.get("entropy") or 0.0 for row in update]
            self._first = self._first or now
            settled = all(new < LOST * old for new, old in zip(now, self._first, strict=True))
            enough = self._episodes >= EPISODES * self._runs
            rising = self._late.above(self._early)
            if settled and enough and not rising and not self._successes and not self._told:
                self._told = True
                first, last = (sum(values) / len(values) for values in (self._first, now))
                return (
                    f"no success in {self._episodes:,.0f} episodes, and the entropy of the policy "
                    f"fell from {first:.2g} to {last:.2g}: it settles without having found the "
                    f"goal; {ADVICE}"
                )
        return None

    def _returns(self, rows: Sequence[Row]) -> None:
        """Of the first episodes, a tenth of those that make a warning, and of as many of late."""
        wanted = EPISODES * self._runs / 10
        returns = self._early if self._early.episodes < wanted else self._late
        if self._late.episodes >= wanted:
            returns = self._late = _Returns()
        returns.add(rows)


class _Returns:
    """Mean and spread of the returns of some episodes."""

    def __init__(self) -> None:
        self.episodes = self._sum = self._squares = 0.0

    def add(self, rows: Sequence[Row]) -> None:
        """Take the episodes of some rows as well."""
        self.episodes += sum(row.get("episodes") or 0 for row in rows)
        self._sum += sum(row.get("return_sum") or 0 for row in rows)
        self._squares += sum(row.get("return_square_sum") or 0 for row in rows)

    def above(self, other: _Returns) -> bool:
        """Whether the mean is higher than chance explains."""
        if not self.episodes or not other.episodes:
            return False
        (mean, error), (first, first_error) = self._estimate(), other._estimate()
        return mean - first > RISEN * math.hypot(error, first_error) + 1e-6 * abs(first)

    def _estimate(self) -> tuple[float, float]:
        """The mean, and its standard error."""
        mean = self._sum / self.episodes
        return mean, math.sqrt(max(self._squares / self.episodes - mean**2, 0) / self.episodes)
