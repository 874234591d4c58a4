"""Proximal policy optimisation (Schulman et al. 2017) over whole recurrent sequences."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from ...pytree import PyTreeNode
from . import optimiser
from .bonus import Metrics
from .config import Config
from .hparams import HParams
from .minibatches import passes, take
from .networks import ActorCritic
from .rollout import Steps, log_prob


class Batch(PyTreeNode):
    """What PPO learns from.

    Attributes:
        steps: the rollout, leading axes [T, N].
        memory: float32[N, hidden], before the rollout.
        advantage: float32[T, N], not normalised.
        target: float32[T, N, V], for the values.
    """

    steps: Steps
    memory: jax.Array
    advantage: jax.Array
    target: jax.Array

    def take(self, environments: jax.Array) -> Batch:
        """The environments of one minibatch."""
        return Batch(
            steps=take(self.steps, environments, 1),
            memory=take(self.memory, environments, 0),
            advantage=take(self.advantage, environments, 1),
            target=take(self.target, environments, 1),
        )


def loss(
    network: ActorCritic, config: Config, params: Any, batch: Batch, hparams: HParams
) -> tuple[jax.Array, Metrics]:
    """The loss of a minibatch.

        ratio = exp(log pi - log pi_old)
        policy = -mean min(ratio A, clip(ratio, 1 - eps, 1 + eps) A), A normalised
        value = sum over heads of mean max((V - target)^2, (V_clipped - target)^2)
        loss = policy + c_v value - c_e entropy

    Returns:
        float32[] and its parts with what tells how far the policy moved.
    """
    steps = batch.steps
    logits, value, _ = network.unroll(params, steps.obs, steps.previous, steps.first, batch.memory)
    policy, metrics = policy_loss(logits, steps, normalise(batch.advantage, hparams), hparams)
    error = value_loss(value, steps.value, batch.target, value_clips(hparams, value.shape[-1]))
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
    """Advantages with mean 0 and, but for the floor, deviation 1."""
    centred = advantage - jnp.mean(advantage)
    return centred / (jnp.std(advantage) + hparams.advantage_floor)


def policy_loss(
    logits: jax.Array, steps: Steps, advantage: jax.Array, hparams: HParams
) -> tuple[jax.Array, Metrics]:
    """The clipped surrogate, and how far the policy is from the one that played."""
    moved = log_prob(logits, steps.action) - steps.log_prob
    ratio = jnp.exp(moved)
    clipped = jnp.clip(ratio, 1 - hparams.clip, 1 + hparams.clip)
    surrogate = jnp.minimum(ratio * advantage, clipped * advantage)
    return -jnp.mean(surrogate), {
        # An estimate that is never negative: Schulman, "Approximating KL divergence", 2020.
        "approximate_kl": jnp.mean(ratio - 1 - moved),
        "clip_fraction": jnp.mean((jnp.abs(ratio - 1) > hparams.clip).astype(ratio.dtype)),
    }


def value_clips(hparams: HParams, heads: int) -> jax.Array:
    """float32[V], how far each value may move."""
    own = hparams.value_clip if hparams.bonus_value_clip is None else hparams.bonus_value_clip
    return jnp.stack([hparams.value_clip, *[own] * (heads - 1)])


def value_loss(value: jax.Array, old: jax.Array, target: jax.Array, clip: jax.Array) -> jax.Array:
    """The larger of the squared errors of value and clipped value; mean over steps, sum of heads.

    Args:
        value: float32[T, N, V].
        old: float32[T, N, V], of the network that played.
        target: float32[T, N, V].
        clip: float32[V], how far each may move.
    """
    clip = clip[None, None]
    clipped = old + jnp.clip(value - old, -clip, clip)
    worse = jnp.maximum((value - target) ** 2, (clipped - target) ** 2)
    return jnp.sum(jnp.mean(worse, axis=(0, 1)))


def train(
    network: ActorCritic,
    config: Config,
    key: jax.Array,
    params: Any,
    optimiser_state: Any,
    batch: Batch,
    hparams: HParams,
    rate: jax.Array,
) -> tuple[Any, Any, Metrics]:
    """All epochs of an update.

    Args:
        network: policy and values.
        config: epochs and minibatches.
        key: of the shuffles.
        params: of the network.
        optimiser_state: of `optimiser`.
        batch: the rollout.
        hparams: numbers of the loss.
        rate: learning rate of this update.

    Returns:
        Parameters, optimiser state, and means of the losses over all minibatches.
    """

    def body(carry: Any, environments: jax.Array) -> tuple[Any, Metrics]:
        params, state, going = carry
        part = batch.take(environments)

        def total(params: Any) -> tuple[jax.Array, Metrics]:
            return loss(network, config, params, part, hparams)

        gradients, metrics = jax.grad(total, has_aux=True)(params)
        *learnt, size = optimiser.step(gradients, state, params, rate, hparams.gradient_norm)
        if hparams.target_kl is not None:
            going &= metrics["approximate_kl"] <= hparams.target_kl
            learnt = jax.tree.map(
                lambda new, old: jnp.where(going, new, old), learnt, [params, state]
            )
        return (*learnt, going), metrics | {"gradient_norm": size}

    (params, optimiser_state, _), metrics = passes(
        key, config, config.epochs, body, (params, optimiser_state, jnp.bool_(True))
    )
    return params, optimiser_state, metrics
