"""Exploration bonuses as the training loop sees them, and how their size is normalised.

A bonus is computed once for each rollout, after it: its networks do not change while the agent
plays, and one large call is faster than many small ones.
"""

from __future__ import annotations

import dataclasses
from typing import Any, Protocol

import jax
import jax.numpy as jnp

from ..pytree import PyTreeNode
from .config import HParams

Metrics = dict[str, jax.Array]

PER_ENVIRONMENT = {"per_environment": True}
"""Metadata of a record's field whose leaves all begin with the axis of the environments, [N]."""


class Experience(PyTreeNode):
    """What a bonus sees of a rollout.

    Attributes:
        obs: observations with leading axes [T + 1, N]. Entry t + 1 is what step t led to, unless
            the step ended an episode: then it is the first of the next one.
        action: int32[T, N].
        ended: bool[T, N], whether the step ended an episode, either way.
    """

    obs: Any
    action: jax.Array
    ended: jax.Array

    @property
    def led_to(self) -> Any:
        """Observations [T, N] that the steps led to; see `obs` for those that ended an episode."""
        return jax.tree.map(lambda leaf: leaf[1:], self.obs)


class Bonus(Protocol):
    """An exploration bonus: made by an `Algorithm`, for observations, actions and a config.

    The loop zeroes it where a step ended its episode, divides it by its running size with
    `normalise_bonus`, and multiplies it by `bonus_reward`.
    """

    @property
    def value_heads(self) -> int:
        """How many values the network has.

        With 1, the bonus is added to the reward. With more, it has `value_heads - 1` parts, each
        with its own returns, which go on through the ends of episodes.
        """
        ...

    def init(self, key: jax.Array) -> Any:
        """Initialise the state: networks, optimiser, statistics; a pytree of arrays.

        All numbers must be finite: otherwise the run counts as diverged.
        Arrays with an entry for each environment are fields of a record, declared with
        `dataclasses.field(metadata=PER_ENVIRONMENT)`.
        """
        ...

    def reward(
        self, state: Any, hparams: HParams, experience: Experience
    ) -> tuple[jax.Array, Any, Metrics]:
        """Compute the bonus of each step.

        Returns:
            float32[T, N], or [T, N, value_heads - 1]; the state; metrics.
        """
        ...

    def update(
        self,
        key: jax.Array,
        state: Any,
        hparams: HParams,
        experience: Experience,
        rate: jax.Array,
    ) -> tuple[Any, Metrics]:
        """Learn from the rollout, after the policy; `rate` is the learning rate of this update.

        Metrics whose names end in `loss` or `gradient_norm` must be finite: otherwise the run
        counts as diverged.
        """
        ...


class RunningStats(PyTreeNode):
    """Mean and variance of all values merged so far (Chan et al. 1979).

    Attributes:
        count: float32[], number of values of each entry.
        mean: float32[...].
        squares: float32[...], sum of squared deviations from the mean.
    """

    count: jax.Array
    mean: jax.Array
    squares: jax.Array

    @classmethod
    def empty(cls, shape: tuple[int, ...] = ()) -> RunningStats:
        """Statistics of no values yet."""
        return cls(jnp.float32(0), jnp.zeros(shape, jnp.float32), jnp.zeros(shape, jnp.float32))

    @property
    def variance(self) -> jax.Array:
        """float32[...], of the population; 1 where nothing was merged yet."""
        some = self.count > 0
        return jnp.where(some, self.squares / jnp.maximum(self.count, 1), jnp.ones_like(self.mean))

    @property
    def deviation(self) -> jax.Array:
        """float32[...], the square root of the variance."""
        return jnp.sqrt(self.variance)

    def faded(self, share: jax.Array | float) -> RunningStats:
        """The statistics with only a share of their weight."""
        return self.replace(count=self.count * share, squares=self.squares * share)

    def merge(self, values: jax.Array) -> RunningStats:
        """The statistics with more values: float32[..., *shape], any leading axes."""
        axes = tuple(range(values.ndim - self.mean.ndim))
        mean = jnp.mean(values, axis=axes)
        squares = jnp.sum((values - jnp.expand_dims(mean, axes)) ** 2, axis=axes)
        number = jnp.float32(values.size // mean.size)
        count = self.count + number
        share = number / jnp.maximum(count, 1)
        difference = mean - self.mean
        squares = self.squares + squares + difference**2 * self.count * share
        return RunningStats(count, self.mean + difference * share, squares)


class BonusScale(PyTreeNode):
    """The running size of discounted sums of the bonus, by which it can be divided.

    Attributes:
        total: float32[N, ...], the sum of each environment, discounted towards the past. It goes
            on over rollouts and over the ends of episodes.
        stats: of all its values.
    """

    total: jax.Array = dataclasses.field(metadata=PER_ENVIRONMENT)
    stats: RunningStats

    @classmethod
    def empty(cls, *shape: int) -> BonusScale:
        """The scale before the first rollout; shape [N, ...]."""
        return cls(jnp.zeros(shape, jnp.float32), RunningStats.empty(shape[1:]))

    def divide(self, bonus: jax.Array, gamma: Any, memory: Any) -> tuple[jax.Array, BonusScale]:
        """Divide a bonus by the deviation of its discounted sum, with this rollout included.

        No mean is subtracted. As OpenAI's RND (Burda et al. 2018), along time.

        Args:
            bonus: float32[T, N, ...].
            gamma: discount of the sum.
            memory: share of their weight that earlier rollouts keep.
        """

        def add(total: jax.Array, bonus: jax.Array) -> tuple[jax.Array, jax.Array]:
            total = gamma * total + bonus
            return total, total

        total, totals = jax.lax.scan(add, self.total, bonus)
        stats = self.stats.faded(memory).merge(totals)
        # One deviation for each part of a bonus of several.
        deviation = jnp.expand_dims(jnp.maximum(stats.deviation, 1e-8), (0, 1))
        return bonus / deviation, BonusScale(total, stats)
