"""Minibatches of whole environment sequences, and a pass over all of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

from .config import Config


def draw_minibatches(key: jax.Array, config: Config) -> jax.Array:
    """Shuffle the environments into minibatches.

    Returns:
        int32[minibatches, shards, n]: in each minibatch, `n` environments of each shard, by
        their index within the shard.
    """
    within = config.num_envs // config.shards
    keys = jax.random.split(key, config.shards)
    order = jax.vmap(lambda k: jax.random.permutation(k, within))(keys).astype(jnp.int32)
    return order.reshape(config.shards, config.minibatches, -1).swapaxes(0, 1)


def take(tree: Any, environments: jax.Array, axis: int) -> Any:
    """The environments of one minibatch.

    Args:
        tree: leaves with the environments along `axis`.
        environments: int32[shards, n].
        axis: 1 for sequences, 0 for what there is once for each environment.

    Returns:
        Leaves with `shards * n` along `axis`. Nothing is moved between shards.
    """
    shards = environments.shape[0]

    def one(leaf: jax.Array) -> jax.Array:
        if shards == 1:
            return jnp.take(leaf, environments[0], axis=axis, unique_indices=True)
        shape = leaf.shape
        leaf = leaf.reshape(*shape[:axis], shards, -1, *shape[axis + 1 :])
        pick = jax.vmap(lambda a, b: jnp.take(a, b, axis=axis), (axis, 0), axis)
        return pick(leaf, environments).reshape(*shape[:axis], -1, *shape[axis + 1 :])

    return jax.tree.map(one, tree)


def passes(
    key: jax.Array,
    config: Config,
    epochs: int,
    body: Callable[[Any, jax.Array], tuple[Any, Any]],
    carry: Any,
) -> tuple[Any, Any]:
    """Call `body(carry, environments)` for all minibatches of `epochs` shuffles.

    Returns:
        The last carry, and the mean of what the calls returned besides.
    """

    def epoch(carry: Any, key: jax.Array) -> tuple[Any, Any]:
        return jax.lax.scan(body, carry, draw_minibatches(key, config))

    carry, results = jax.lax.scan(epoch, carry, jax.random.split(key, epochs))
    return carry, jax.tree.map(jnp.mean, results)
