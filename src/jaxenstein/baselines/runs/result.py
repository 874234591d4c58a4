"""How trained agents did: means over runs and episodes, with intervals."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from .bootstrap import Interval, mean_interval


@dataclasses.dataclass(frozen=True)
class Result:
    """How one way of acting did, over all runs of a directory.

    Attributes:
        greedy: whether the most likely actions were taken.
        returns: float32[runs, episodes], undiscounted.
        lengths: int32[runs, episodes], steps.
        successes: bool[runs, episodes].
    """

    greedy: bool
    returns: np.ndarray
    lengths: np.ndarray
    successes: np.ndarray

    @property
    def best(self) -> int:
        """The run with the highest mean return; of equal ones that with the shortest episodes."""
        order = np.lexsort((self.lengths.mean(axis=1), -self.returns.mean(axis=1)))
        return int(order[0])

    def interval(self, values: np.ndarray) -> Interval:
        """Mean of values[runs, episodes] with a 95 % bootstrap interval.

        With several runs these are drawn, and episodes within them; with one, episodes alone.
        """
        return mean_interval(np.asarray(values, np.float64))

    def to_json(self, names: Sequence[str]) -> dict[str, Any]:
        """As plain JSON values, with every run's means by its name."""
        fields = {"return": self.returns, "length": self.lengths, "success": self.successes}
        overall = {name: dataclasses.asdict(self.interval(v)) for name, v in fields.items()}
        runs = {
            run: {name: float(np.mean(values[number])) for name, values in fields.items()}
            for number, run in enumerate(names)
        }
        return {"episodes": int(self.returns.shape[1]), **overall, "runs": runs}
