"""Exploration bonuses as the training loop sees them.

A bonus is computed once for each rollout, after it: its networks do not change while the agent
plays, and one large call is faster than many small ones.
"""

from __future__ import annotations

import dataclasses
from typing import Any, Protocol

import jax
import jax.numpy as jnp

from ...pytree import PyTreeNode
from . import running_stats
from .axes import PER_ENVIRONMENT
from .hparams import HParams
from .running_stats import RunningStats

Metrics = dict[str, jax.Array]


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

        With 1, the bonus is added to the reward. With more, it is of `value_heads - 1` parts,
        each with returns of its own, which do not stop at the ends of episodes.
        """
        ...

    def init(self, key: jax.Array) -> Any:
        """Draw the state: networks, optimiser, statistics; a pytree of arrays.

        What there is once for each environment are fields of a record, declared with
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
        """Learn from the rollout, after the policy; `rate` is the learning rate of this update."""
        ...


class BonusScale(PyTreeNode):
    """The running size of discounted sums of the bonus, which it can be divided by.

    Attributes:
        total: float32[N, ...], the sum of each environment, discounted towards the past. It goes
            on over rollouts and over the ends of episodes.
        stats: of all its values.
    """

    total: jax.Array = dataclasses.field(metadata=PER_ENVIRONMENT)
    stats: RunningStats


def initial_scale(*shape: int) -> BonusScale:
    """Nothing seen yet; shape [N, ...]."""
    return BonusScale(jnp.zeros(shape, jnp.float32), running_stats.empty(shape[1:]))


def scaled(
    bonus: jax.Array, scale: BonusScale, gamma: Any, memory: Any
) -> tuple[jax.Array, BonusScale]:
    """Divide a bonus by the deviation of its discounted sum, this rollout's included.

    No mean is subtracted. As OpenAI's RND (Burda et al. 2018), along time.

    Args:
        bonus: float32[T, N, ...].
        scale: so far.
        gamma: discount of the sum.
        memory: weight of the rollouts before, of which each counted 1 when it was the last.
    """

    def add(total: jax.Array, bonus: jax.Array) -> tuple[jax.Array, jax.Array]:
        total = gamma * total + bonus
        return total, total

    total, totals = jax.lax.scan(add, scale.total, bonus)
    stats = running_stats.merge(running_stats.faded(scale.stats, memory), totals)
    deviation = jnp.maximum(stats.deviation, 1e-8)
    # As of each part of a bonus of several.
    return bonus / jnp.expand_dims(deviation, (0, 1)), BonusScale(total, stats)
