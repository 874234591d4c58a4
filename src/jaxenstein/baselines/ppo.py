"""Generalised advantages (Schulman et al. 2016) and the loss of PPO (Schulman et al. 2017)."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from ..pytree import PyTreeNode
from . import optimiser
from .bonus import Metrics
from .config import Config, HParams
from .networks import ActorCritic
from .rollout import Steps, log_prob


def advantages(
    rewards: jax.Array,
    values: jax.Array,
    next_values: jax.Array,
    ended: jax.Array,
    gamma: jax.Array | float,
    gae_lambda: jax.Array | float,
) -> jax.Array:
    """Advantages along sequences in which episodes may end.

        delta_t = r_t + gamma V'_t - V_t
        A_t     = delta_t + gamma lambda (1 - ended_t) A_{t+1}

    The value targets are `advantages + values`.

    Args:
        rewards: float[T, ...].
        values: float[T, ...], V, values of the observations before each step.
        next_values: float[T, ...], V', values of the observations after each step: zero after a
            termination, the value of the last observation after a truncation.
        ended: bool[T, ...], whether the step ended an episode; all false for returns that
            continue across the ends of episodes.
        gamma: discount.
        gae_lambda: lambda of generalised advantage estimation.
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
    """Values of the observations after each step, as `advantages` needs them.

    Args:
        values: float[T, N], values of the observations before each step.
        last_value: float[N], values of the observations after the last step.
        terminated: bool[T, N], whether the task ended the episode.
        truncated: bool[T, N], whether the time limit ended the episode.
        final_values: float[T, N], values of the last observations of truncated episodes.
    """
    following = jnp.concatenate([values[1:], last_value[None]])
    following = jnp.where(truncated, final_values, following)
    return jnp.where(terminated, jnp.zeros_like(following), following)


class Batch(PyTreeNode):
    """The data for one update of PPO.

    Attributes:
        steps: the rollout, leading axes [T, N].
        memory: float32[1, N, hidden], the memory before the rollout.
        advantage: float32[T, N], not normalised.
        target: float32[T, N, V], value targets.
    """

    steps: Steps
    memory: jax.Array
    advantage: jax.Array
    target: jax.Array


def loss(
    network: ActorCritic, config: Config, params: Any, batch: Batch, hparams: HParams
) -> tuple[jax.Array, Metrics]:
    """The loss of a minibatch.

        ratio = exp(log pi - log pi_old)
        policy = -mean min(ratio A, clip(ratio, 1 - eps, 1 + eps) A), A normalised
        value = sum over heads of mean max((V - target)^2, (V_clipped - target)^2)
        loss = policy + c_v value - c_e entropy

    Returns:
        float32[], and metrics: its terms, and how far the policy moved.
    """
    steps, memory = batch.steps, batch.memory[0]
    logits, value, _ = network.unroll(params, steps.obs, steps.previous, steps.first, memory)
    policy, metrics = policy_loss(logits, steps, normalise(batch.advantage, hparams), hparams)
    own = hparams.value_clip if hparams.bonus_value_clip is None else hparams.bonus_value_clip
    clips = jnp.stack([hparams.value_clip, *[own] * (value.shape[-1] - 1)])
    error = value_loss(value, steps.value, batch.target, clips)
    if config.value_loss_half:
        error = error / 2
    log_probs = jax.nn.log_softmax(logits)
    entropy = -jnp.mean(jnp.sum(jnp.exp(log_probs) * log_probs, axis=-1))
    total = policy + hparams.value * error - hparams.entropy * entropy
    return total, metrics | {
        "loss": total,
        "policy_loss": policy,
        "value_loss": error,
        "entropy": entropy,
    }


def normalise(advantage: jax.Array, hparams: HParams) -> jax.Array:
    """Normalise advantages to mean 0 and deviation 1, up to the floor."""
    centred = advantage - jnp.mean(advantage)
    return centred / (jnp.std(advantage) + hparams.advantage_floor)


def policy_loss(
    logits: jax.Array, steps: Steps, advantage: jax.Array, hparams: HParams
) -> tuple[jax.Array, Metrics]:
    """The clipped surrogate loss, and how far the policy moved from the rollout policy."""
    moved = log_prob(logits, steps.action) - steps.log_prob
    ratio = jnp.exp(moved)
    clipped = jnp.clip(ratio, 1 - hparams.clip, 1 + hparams.clip)
    surrogate = jnp.minimum(ratio * advantage, clipped * advantage)
    return -jnp.mean(surrogate), {
        # A non-negative estimate: Schulman, "Approximating KL divergence", 2020.
        "approximate_kl": jnp.mean(ratio - 1 - moved),
        "clip_fraction": jnp.mean((jnp.abs(ratio - 1) > hparams.clip).astype(ratio.dtype)),
    }


def value_loss(value: jax.Array, old: jax.Array, target: jax.Array, clip: jax.Array) -> jax.Array:
    """The larger squared error of value and clipped value; mean over steps, sum over heads.

    `value`, `old` and `target` are float32[T, N, V]; `old` are the values from the rollout. `clip`
    is float32[V].
    """
    clip = clip[None, None]
    clipped = old + jnp.clip(value - old, -clip, clip)
    worse = jnp.maximum((value - target) ** 2, (clipped - target) ** 2)
    return jnp.sum(jnp.mean(worse, axis=(0, 1)))


def train(
    network: ActorCritic,
    config: Config,
    key: jax.Array,
    networks: tuple[Any, Any],
    batch: Batch,
    hparams: HParams,
    rate: jax.Array,
) -> tuple[Any, Any, Metrics]:
    """All epochs of an update; arguments and results as in `optimiser.train`."""

    def total(params: Any, part: Batch) -> tuple[jax.Array, Metrics]:
        return loss(network, config, params, part, hparams)

    def near(metrics: Metrics) -> jax.Array:
        return metrics["approximate_kl"] <= hparams.target_kl

    return optimiser.train(
        key, config, config.epochs, total, batch, networks, rate, hparams.gradient_norm,
        near=None if hparams.target_kl is None else near,
    )  # fmt: skip
