"""Telling early that a training settles on a way of acting without ever having succeeded."""

from __future__ import annotations

from collections.abc import Sequence

from .metrics import Row

# Episodes without a success that a run may have, and the share of its first entropy that its
# policy must have lost besides: before that it is still looking.
EPISODES = 1000
LOST = 0.5
ADVICE = "docs/training.md, 'Where it does not learn', says what to try"


class StallWatch:
    """Looks at the rows of a training, and warns once where no run has succeeded.

    Runs that succeeded once, or whose policy is still close to random, are not told of.
    """

    def __init__(self, runs: int) -> None:
        """Take the number of runs, whose rows alternate."""
        self._runs = runs
        self._episodes = self._successes = 0.0
        self._first: list[float] = []
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
            now = [row.get("entropy") or 0.0 for row in update]
            self._first = self._first or now
            settled = all(new < LOST * old for new, old in zip(now, self._first, strict=True))
            enough = self._episodes >= EPISODES * self._runs
            if settled and enough and not self._successes and not self._told:
                self._told = True
                first, last = (sum(values) / len(values) for values in (self._first, now))
                return (
                    f"no success in {self._episodes:,.0f} episodes, and the entropy of the policy "
                    f"fell from {first:.2g} to {last:.2g}: it settles without having found the "
                    f"goal; {ADVICE}"
                )
        return None
