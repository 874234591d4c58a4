"""Embeddings by nearness in time: what is seen within a few steps is alike, all else is not."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from ..learning.bonus import Metrics
from .parts import mean

# What inner products are divided by, and of how many steps one is told from the others: of all,
# the products would cost more than all else.
TEMPERATURE, STRIDE = 0.1, 4


def drawn_offsets(key: jax.Array, shape: tuple[int, ...], reach: int) -> jax.Array:
    """int32[T, N], how far ahead of each step its neighbour is: from 1 to `reach`."""
    return jax.random.randint(key, shape, 1, reach + 1, jnp.int32)


def temporal_loss(
    name: str, phi: jax.Array, ended: jax.Array, offset: jax.Array
) -> tuple[jax.Array, Metrics]:
    """Cross-entropy of telling a step's neighbour in time from the neighbours of other steps.

    InfoNCE (van den Oord et al. 2018) with the inner products of embeddings of length one. Steps
    whose episode ends before their neighbour are left out on both sides.

    Args:
        name: the metrics' prefix.
        phi: float32[T + 1, N, L], of the observations in their order.
        ended: bool[T, N], whether the step ended its episode.
        offset: int32[T, N], as of `drawn_offsets`; those beyond the last are cut to it.
    """
    steps, number = ended.shape
    episode = jnp.concatenate([jnp.zeros((1, number), jnp.int32), jnp.cumsum(ended, 0, jnp.int32)])
    time = jnp.arange(0, steps, STRIDE, dtype=jnp.int32)[:, None]
    row = jnp.arange(number, dtype=jnp.int32)[None]
    then = jnp.minimum(time + offset[::STRIDE], steps)
    wanted = (episode[then, row] == episode[time, row]).reshape(-1)
    flat = (wanted.size, phi.shape[-1])
    now, near = phi[time, row].reshape(flat), phi[then, row].reshape(flat)
    logits = jnp.where(wanted, now @ near.T / TEMPERATURE, -1e9)
    # Those that tie share it: an embedding that is the same for all frames tells nothing.
    best = (logits >= jnp.max(logits, axis=-1, keepdims=True)).astype(jnp.float32)
    right = jnp.diagonal(best) / jnp.sum(best, axis=-1)
    loss = mean(-jnp.diagonal(jax.nn.log_softmax(logits)), wanted)
    return loss, {
        f"{name}_temporal_loss": loss,
        f"{name}_temporal_accuracy": mean(right, wanted),
    }
