"""Running mean and variance by merging batches (Chan et al. 1979), in float32 with a count."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from ...pytree import PyTreeNode


class RunningStats(PyTreeNode):
    """Statistics of all values merged so far.

    Attributes:
        count: float32[], number of values of each entry.
        mean: float32[...].
        squares: float32[...], sum of squared deviations from the mean.
    """

    count: jax.Array
    mean: jax.Array
    squares: jax.Array

    @property
    def variance(self) -> jax.Array:
        """float32[...], of the population; 1 where nothing was merged yet."""
        some = self.count > 0
        return jnp.where(some, self.squares / jnp.maximum(self.count, 1), jnp.ones_like(self.mean))

    @property
    def deviation(self) -> jax.Array:
        """float32[...], the square root of the variance."""
        return jnp.sqrt(self.variance)


def empty(shape: tuple[int, ...] = ()) -> RunningStats:
    """Statistics of nothing."""
    return RunningStats(
        jnp.float32(0), jnp.zeros(shape, jnp.float32), jnp.zeros(shape, jnp.float32)
    )


def merge(stats: RunningStats, values: jax.Array) -> RunningStats:
    """The statistics with more values.

    Args:
        stats: of entries of some shape.
        values: float32[..., *shape], any leading axes.
    """
    axes = tuple(range(values.ndim - stats.mean.ndim))
    number = 1
    for axis in axes:
        number *= values.shape[axis]
    mean = jnp.mean(values, axis=axes)
    squares = jnp.sum((values - jnp.expand_dims(mean, axes)) ** 2, axis=axes)
    return combine(stats, RunningStats(jnp.float32(number), mean, squares))


def faded(stats: RunningStats, share: jax.Array | float) -> RunningStats:
    """The statistics with a share of their weight beside what is merged next."""
    return stats.replace(count=stats.count * share, squares=stats.squares * share)


def combine(a: RunningStats, b: RunningStats) -> RunningStats:
    """The statistics of both, in any order."""
    count = a.count + b.count
    share = b.count / jnp.maximum(count, 1)
    difference = b.mean - a.mean
    squares = a.squares + b.squares + difference**2 * a.count * share
    return RunningStats(count, a.mean + difference * share, squares)
