"""Generalised advantage estimation (Schulman et al. 2016)."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp


def advantages(
    rewards: jax.Array,
    values: jax.Array,
    next_values: jax.Array,
    ended: jax.Array,
    gamma: jax.Array | float,
    gae_lambda: jax.Array | float,
) -> jax.Array:
    """Advantages of steps that may cross the ends of episodes.

        delta_t = r_t + gamma V'_t - V_t
        A_t     = delta_t + gamma lambda (1 - ended_t) A_{t+1}

    Targets of the values are `advantages + values`.

    Args:
        rewards: float[T, ...].
        values: float[T, ...], of the observations acted on.
        next_values: float[T, ...], V': of the observations that the actions led to: zero where
            the task ended, the value of the last observation where the time limit did.
        ended: bool[T, ...], whether the step ended an episode of either kind; all false for
            returns that go on through the ends.
        gamma: discount.
        gae_lambda: weight of longer returns.

    Returns:
        float[T, ...].
    """
    delta = rewards + gamma * next_values - values
    keep = gamma * gae_lambda * (1 - ended.astype(values.dtype))

    def back(following: jax.Array, step: tuple[Any, Any]) -> tuple[jax.Array, jax.Array]:
        delta, keep = step
        advantage = delta + keep * following
        return advantage, advantage

    _, result = jax.lax.scan(back, jnp.zeros_like(delta[0]), (delta, keep), reverse=True)
    return result


def next_values(
    values: jax.Array,
    last_value: jax.Array,
    terminated: jax.Array,
    truncated: jax.Array,
    final_values: jax.Array,
) -> jax.Array:
    """The value of what each step led to.

    Args:
        values: float[T, N], of the observations acted on.
        last_value: float[N], of the observation after the last step.
        terminated: bool[T, N], the task's own end: nothing follows.
        truncated: bool[T, N], the time limit: the episode would go on.
        final_values: float[T, N], values of the observations that truncated episodes ended in;
            read only there.

    Returns:
        float[T, N], as `advantages` takes it.
    """
    following = jnp.concatenate([values[1:], last_value[None]])
    following = jnp.where(truncated, final_values, following)
    return jnp.where(terminated, jnp.zeros_like(following), following)
