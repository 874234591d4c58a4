"""Divergence of runs: an update that diverges is undone.

A run diverges if its loss, gradient or state has a number that is not finite. That update only sets
`TrainState.diverged`, and later updates change nothing. So every checkpoint holds the last finite
parameters of the run and the cause of its divergence.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .bonus import Metrics
from .state import TrainState

PARTS = ("loss", "gradient", "parameters")
"""The parts that must be finite; part n is bit n of `TrainState.diverged`."""

# The name of the metric. Metrics whose names end in LOSS or GRADIENT must be finite.
METRIC = "diverged"
LOSS, GRADIENT = "loss", "gradient_norm"


def guard(
    before: TrainState, after: TrainState, learnt: Metrics, metrics: Metrics
) -> tuple[TrainState, Metrics]:
    """Undo an update if the run diverged in it or earlier.

    Args:
        before: the state before the update, with `diverged`.
        after: the state after the update.
        learnt: training metrics of policy and bonus.
        metrics: all metrics of the update.

    Returns:
        The state, and the metrics with `diverged`. The other metrics of a diverged run are 0 or
        NaN, since its rollout is undone as well.
    """
    assert before.diverged is not None
    code = jnp.where(before.diverged > 0, before.diverged, _found(after, learnt))
    stopped = code > 0
    state = jax.tree.map(lambda old, new: jnp.where(stopped, old, new), before, after)
    metrics = {name: jnp.where(stopped, _nothing(value), value) for name, value in metrics.items()}
    return state.replace(diverged=code), metrics | {METRIC: code}


def _found(state: TrainState, learnt: Metrics) -> jax.Array:
    """int32[]: the parts that are not finite, as bits."""
    ending = lambda end: [value for name, value in learnt.items() if name.endswith(end)]  # noqa: E731
    own = (state.params, state.bonus, state.scale, state.reward_scale)
    parts = (ending(LOSS), ending(GRADIENT), own)
    bits = [jnp.where(_finite(part), 0, 1 << bit) for bit, part in enumerate(parts)]
    return sum(bits, jnp.int32(0)).astype(jnp.int32)


def _finite(tree: Any) -> jax.Array:
    """bool[], whether all floats of a tree are finite."""
    floats = [leaf for leaf in jax.tree.leaves(tree) if jnp.issubdtype(leaf.dtype, jnp.floating)]
    return jnp.all(jnp.stack([jnp.bool_(True), *(jnp.all(jnp.isfinite(leaf)) for leaf in floats)]))


def _nothing(value: jax.Array) -> jax.Array:
    """NaN for floats, 0 for whole numbers."""
    floating = jnp.issubdtype(value.dtype, jnp.floating)
    return jnp.full_like(value, jnp.nan if floating else 0)


@dataclasses.dataclass(frozen=True)
class Divergence:
    """When and how a run diverged.

    Attributes:
        update: the update in which the run diverged, from 1; the run keeps the state before it.
        code: the bits of `TrainState.diverged`.
    """

    update: int
    code: int

    @property
    def parts(self) -> str:
        """The parts that were not finite, such as "loss and gradient"."""
        # A code from a file may have no valid bit.
        found = [part for bit, part in enumerate(PARTS) if self.code >> bit & 1] or ["numbers"]
        return " and ".join(filter(None, [", ".join(found[:-1]), found[-1]]))

    def message(self, name: str) -> str:
        """A message about the run with this name."""
        one = self.code in (1, 2)
        return (
            f"{name} diverged at update {self.update}: its {self.parts} {'was' if one else 'were'} "
            f"not finite. It keeps the parameters of update {self.update - 1}, the last finite ones"
        )


def of_state(update: np.ndarray, diverged: np.ndarray | None) -> dict[int, Divergence]:
    """The diverged runs by number, from the int32[runs] of `TrainState.update` and `diverged`."""
    if diverged is None:
        return {}
    pairs = enumerate(zip(update.tolist(), diverged.tolist(), strict=True))
    return {run: Divergence(done + 1, code) for run, (done, code) in pairs if code}


def updates_that_count(metrics: Mapping[str, np.ndarray]) -> int:
    """The number of updates in a chunk until all runs have diverged, or of all its updates.

    `metrics` have shape [runs, updates].
    """
    updates = next(iter(metrics.values())).shape[1]
    if METRIC not in metrics:
        return updates
    over = np.all(metrics[METRIC] > 0, axis=0)
    return int(np.argmax(over)) + 1 if over.any() else updates
