"""Exploration bonuses as parts: what the training loop asks of them, and the one that gives none.

A bonus is computed once for each rollout, after it: its networks do not change while the agent
plays, and one large call is faster than many small ones.
"""

from __future__ import annotations

from typing import Any, Protocol

import jax
import jax.numpy as jnp

from ...pytree import PyTreeNode
from . import running_stats
from .config import HParams
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


class Bonus(Protocol):
    """An exploration bonus."""

    @property
    def value_heads(self) -> int:
        """How many values the network has.

        With 1, the bonus is added to the reward. With 2, it has returns of its own with the
        second value, which do not stop at the ends of episodes.
        """
        ...

    def init(self, key: jax.Array) -> Any:
        """Draw the state: networks, optimiser, statistics; a pytree of arrays."""
        ...

    def reward(
        self, state: Any, hparams: HParams, experience: Experience
    ) -> tuple[jax.Array, Any, Metrics]:
        """Compute the bonus of each step: float32[T, N], the state, metrics."""
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


class NoBonus:
    """No bonus: zero."""

    value_heads: int = 1

    def init(self, key: jax.Array) -> tuple[()]:
        """Nothing."""
        del key
        return ()

    def reward(
        self, state: Any, hparams: HParams, experience: Experience
    ) -> tuple[jax.Array, Any, Metrics]:
        """Zeros."""
        del hparams
        return jnp.zeros(experience.ended.shape, jnp.float32), state, {}

    def update(
        self, key: jax.Array, state: Any, hparams: HParams, experience: Experience, rate: jax.Array
    ) -> tuple[Any, Metrics]:
        """Nothing to learn."""
        del key, hparams, experience, rate
        return state, {}


class BonusScale(PyTreeNode):
    """The running size of discounted sums of the bonus, which it can be divided by.

    Attributes:
        total: float32[N], the sum of each environment, discounted towards the past. It goes on
            over rollouts and over the ends of episodes.
        stats: of all its values.
    """

    total: jax.Array
    stats: RunningStats


def initial_scale(batch: int) -> BonusScale:
    """Nothing seen yet."""
    return BonusScale(jnp.zeros(batch, jnp.float32), running_stats.empty())


def scaled(bonus: jax.Array, scale: BonusScale, gamma: Any) -> tuple[jax.Array, BonusScale]:
    """Divide a bonus by the deviation of its discounted sum, this rollout's included.

    No mean is subtracted. As OpenAI's RND (Burda et al. 2018), along time.

    Args:
        bonus: float32[T, N].
        scale: so far.
        gamma: discount of the sum.
    """

    def add(total: jax.Array, bonus: jax.Array) -> tuple[jax.Array, jax.Array]:
        total = gamma * total + bonus
        return total, total

    total, totals = jax.lax.scan(add, scale.total, bonus)
    stats = running_stats.merge(scale.stats, totals)
    return bonus / jnp.maximum(stats.deviation, 1e-8), BonusScale(total, stats)
