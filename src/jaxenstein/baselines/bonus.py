"""The interface of exploration bonuses, and the normalisation of their size.

The bonus of a rollout is computed at its end. Its networks do not change while the agent plays, and
one large call is faster than many small ones.
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
"""Metadata of a dataclass field: the first axis of all its leaves is the environments, [N]."""


class Experience(PyTreeNode):
    """The part of a rollout that a bonus sees.

    Attributes:
        obs: observations with leading axes [T + 1, N]. Entry t + 1 follows step t. If the step
            ended an episode, it is the first observation of the next episode.
        action: int32[T, N].
        ended: bool[T, N], whether the step ended an episode, by termination or truncation.
    """

    obs: Any
    action: jax.Array
    ended: jax.Array

    @property
    def led_to(self) -> Any:
        """The observations after each step, leading axes [T, N]; see `obs` for ends of episodes."""
        return jax.tree.map(lambda leaf: leaf[1:], self.obs)


class Bonus(Protocol):
    """An exploration bonus. An `Algorithm` makes it for given observations, actions and a config.

    The training loop sets the bonus to zero where a step ends an episode, divides it by its running
    deviation if `normalise_bonus` is set, and multiplies it by `bonus_reward`.
    """

    @property
    def value_heads(self) -> int:
        """The number of value heads of the network.

        With 1, the bonus is added to the reward. With more, the bonus has `value_heads - 1` parts.
        Each part has its own returns, which continue across the ends of episodes.
        """
        ...

    def init(self, key: jax.Array) -> Any:
        """Initialise the state, a pytree of arrays: networks, optimiser, statistics.

        All numbers must be finite; otherwise the run counts as diverged. Declare fields with an
        entry for each environment with `dataclasses.field(metadata=PER_ENVIRONMENT)`.
        """
        ...

    def reward(
        self, state: Any, hparams: HParams, experience: Experience
    ) -> tuple[jax.Array, Any, Metrics]:
        """Compute the bonus of each step.

        Returns:
            float32[T, N] or [T, N, value_heads - 1]; the new state; metrics.
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
        """Learn from the rollout, after the policy has; `rate` is the learning rate of this update.

        Metrics whose names end in `loss` or `gradient_norm` must be finite; otherwise the run
        counts as diverged. No name may be one that `Loop.update` or metrics.jsonl already has.
        """
        ...


class RunningStats(PyTreeNode):
    """Mean and variance of all values merged so far (Chan et al. 1979).

    Attributes:
        count: float32[], number of values merged into each entry.
        mean: float32[...].
        squares: float32[...], sum of squared deviations from the mean.
    """

    count: jax.Array
    mean: jax.Array
    squares: jax.Array

    @classmethod
    def empty(cls, shape: tuple[int, ...] = ()) -> RunningStats:
        """The statistics before the first value."""
        return cls(jnp.float32(0), jnp.zeros(shape, jnp.float32), jnp.zeros(shape, jnp.float32))

    @property
    def variance(self) -> jax.Array:
        """float32[...], the population variance; 1 before the first value."""
        some = self.count > 0
        return jnp.where(some, self.squares / jnp.maximum(self.count, 1), jnp.ones_like(self.mean))

    @property
    def deviation(self) -> jax.Array:
        """float32[...], the square root of the variance."""
        return jnp.sqrt(self.variance)

    def faded(self, share: jax.Array | float) -> RunningStats:
        """The statistics with their weight multiplied by `share`."""
        return self.replace(count=self.count * share, squares=self.squares * share)

    def merge(self, values: jax.Array) -> RunningStats:
        """The statistics including more values, float32[..., *shape] with any leading axes."""
        axes = tuple(range(values.ndim - self.mean.ndim))
        mean = jnp.mean(values, axis=axes)
        squares = jnp.sum((values - jnp.expand_dims(mean, axes)) ** 2, axis=axes)
        number = jnp.float32(values.size // mean.size)
        count = self.count + number
        share = number / jnp.maximum(count, 1)
        difference = mean - self.mean
        squares = self.squares + squares + difference**2 * self.count * share
        return RunningStats(count, self.mean + difference * share, squares)


class RunningScale(PyTreeNode):
    """The running deviation of discounted sums of rewards, which normalises them.

    Attributes:
        total: float32[N, ...], the sum in each environment, discounted towards the past. It
            continues across rollouts.
        stats: statistics of all values of `total`.
    """

    total: jax.Array = dataclasses.field(metadata=PER_ENVIRONMENT)
    stats: RunningStats

    @classmethod
    def empty(cls, *shape: int) -> RunningScale:
        """The scale before the first rollout; shape [N, ...]."""
        return cls(jnp.zeros(shape, jnp.float32), RunningStats.empty(shape[1:]))

    def divide(
        self,
        rewards: jax.Array,
        gamma: Any,
        *,
        ended: jax.Array | None = None,
        memory: Any = 1.0,
        least: float = 1e-8,
    ) -> tuple[jax.Array, RunningScale]:
        """Divide rewards by the deviation of their discounted sum, including this rollout.

        The mean is not subtracted, as in OpenAI's RND (Burda et al. 2018).

        Args:
            rewards: float32[T, N, ...].
            gamma: discount of the sum.
            ended: bool[T, N, ...], where the sum starts again after a step; None: nowhere.
            memory: the share of its weight that the past keeps.
            least: the least deviation.
        """

        def add(total: jax.Array, step: Any) -> tuple[jax.Array, jax.Array]:
            reward, ended = step
            total = gamma * total + reward
            return total if ended is None else jnp.where(ended, 0, total), total

        total, totals = jax.lax.scan(add, self.total, (rewards, ended))
        stats = self.stats.faded(memory).merge(totals)
        # One deviation for each part.
        deviation = jnp.expand_dims(jnp.maximum(stats.deviation, least), (0, 1))
        return rewards / deviation, RunningScale(total, stats)
