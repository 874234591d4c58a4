"""Runs that diverge: found inside the update, which then leaves the run as it was before.

A run whose loss, gradient or state has a number that is not finite can only spread it. The update
that finds one changes nothing but `TrainState.diverged`, and so do all later ones: every checkpoint
has the last finite parameters of such a run, and says what became of it.
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
"""What may not be finite; part n is bit n of `TrainState.diverged`."""

# The metric, and what the names of the metrics end in that have to be finite.
METRIC = "diverged"
LOSS, GRADIENT = "loss", "gradient_norm"


def guard(
    before: TrainState, after: TrainState, learnt: Metrics, metrics: Metrics
) -> tuple[TrainState, Metrics]:
    """Leave a run as it was, if this update or an earlier one found it to have diverged.

    Args:
        before: the state before the update, with `diverged`.
        after: the state that the update leads to.
        learnt: the metrics of all that was trained.
        metrics: those that the update returns.

    Returns:
        The state, and the metrics with `diverged`; those of a run that diverged are 0 or NaN, since
        what it played is forgotten.
    """
    assert before.diverged is not None
    code = jnp.where(before.diverged > 0, before.diverged, _found(after, learnt))
    stopped = code > 0
    state = jax.tree.map(lambda old, new: jnp.where(stopped, old, new), before, after)
    metrics = {name: jnp.where(stopped, _nothing(value), value) for name, value in metrics.items()}
    return state.replace(diverged=code), metrics | {METRIC: code}


def _found(state: TrainState, learnt: Metrics) -> jax.Array:
    """int32[], the parts that are not finite."""
    ending = lambda end: [value for name, value in learnt.items() if name.endswith(end)]  # noqa: E731
    parts = (ending(LOSS), ending(GRADIENT), (state.params, state.bonus, state.scale))
    bits = [jnp.where(_finite(part), 0, 1 << bit) for bit, part in enumerate(parts)]
    return sum(bits, jnp.int32(0)).astype(jnp.int32)


def _finite(tree: Any) -> jax.Array:
    """bool[], whether all floats of a tree are finite."""
    floats = [leaf for leaf in jax.tree.leaves(tree) if jnp.issubdtype(leaf.dtype, jnp.floating)]
    return jnp.all(jnp.stack([jnp.bool_(True), *(jnp.all(jnp.isfinite(leaf)) for leaf in floats)]))


def _nothing(value: jax.Array) -> jax.Array:
    """NaN, or 0 of a whole number."""
    floating = jnp.issubdtype(value.dtype, jnp.floating)
    return jnp.full_like(value, jnp.nan if floating else 0)


@dataclasses.dataclass(frozen=True)
class Divergence:
    """What became of a run that diverged.

    Attributes:
        update: the update that found it, from 1; the run has its state of the one before.
        code: as `TrainState.diverged`.
    """

    update: int
    code: int

    @property
    def parts(self) -> str:
        """What was not finite, such as "loss and gradient"."""
        # A file may say anything.
        found = [part for bit, part in enumerate(PARTS) if self.code >> bit & 1] or ["numbers"]
        return " and ".join(filter(None, [", ".join(found[:-1]), found[-1]]))

    def told(self, name: str) -> str:
        """The facts in words, of the run of a name."""
        one = self.code in (1, 2)
        return (
            f"{name} diverged at update {self.update}: its {self.parts} {'was' if one else 'were'} "
            f"not finite; it has its parameters of update {self.update - 1}, the last finite ones"
        )


def of_state(update: np.ndarray, diverged: np.ndarray | None) -> dict[int, Divergence]:
    """The runs that diverged, by number, of `TrainState.update` and `diverged`, int32[runs]."""
    if diverged is None:
        return {}
    pairs = enumerate(zip(update.tolist(), diverged.tolist(), strict=True))
    return {run: Divergence(done + 1, code) for run, (done, code) in pairs if code}


def updates_that_count(metrics: Mapping[str, np.ndarray]) -> int:
    """How many updates of a chunk there are until all runs have diverged, this one included.

    `metrics` are [runs, updates].
    """
    updates = next(iter(metrics.values())).shape[1]
    if METRIC not in metrics:
        return updates
    over = np.all(metrics[METRIC] > 0, axis=0)
    return int(np.argmax(over)) + 1 if over.any() else updates
