"""Adam with gradient clipping by global norm, over minibatches of whole sequences."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import optax

from .bonus import Metrics
from .config import Config

# As in pobax, Craftax' baselines and SB3; the usual 1e-8 makes early steps larger.
_ADAM = optax.scale_by_adam(eps=1e-5)


def init(params: Any) -> Any:
    """The initial state of Adam."""
    return _ADAM.init(params)


def norm(tree: Any) -> jax.Array:
    """float32[], the Euclidean norm over all leaves."""
    return jnp.sqrt(sum(jnp.sum(leaf**2) for leaf in jax.tree.leaves(tree)))


def clip(gradients: Any, highest: jax.Array) -> tuple[Any, jax.Array]:
    """Clip gradients to a global norm; return them and their norm before clipping, float32[]."""
    size = norm(gradients)
    factor = jnp.minimum(1, highest / jnp.maximum(size, 1e-12))
    return jax.tree.map(lambda leaf: leaf * factor, gradients), size


def step(
    gradients: Any, state: Any, params: Any, learning_rate: jax.Array, highest: jax.Array
) -> tuple[Any, Any, jax.Array]:
    """Clip the gradients, then take a step of Adam.

    Returns:
        Parameters, state, and the norm of the gradients before clipping, float32[].
    """
    gradients, size = clip(gradients, highest)
    # Optax raises a float to an integer power, which strict promotion would refuse.
    with jax.numpy_dtype_promotion("standard"):
        updates, state = _ADAM.update(gradients, state, params)
    params = jax.tree.map(lambda p, u: p - learning_rate * u, params, updates)
    return params, state, size


def sample_minibatches(key: jax.Array, config: Config) -> jax.Array:
    """Shuffle the environments: int32[minibatches, shards, n], indices within shards."""
    within = config.num_envs // config.shards
    keys = jax.random.split(key, config.shards)
    order = jax.vmap(lambda k: jax.random.permutation(k, within))(keys).astype(jnp.int32)
    return order.reshape(config.shards, config.minibatches, -1).swapaxes(0, 1)


def take(tree: Any, environments: jax.Array) -> Any:
    """Take one minibatch: leaves [T, shards * n, ...]; no data moves between shards.

    `tree` has leaves [T, N, ...], and `environments` is int32[shards, n].
    """
    shards = environments.shape[0]

    def one(leaf: jax.Array) -> jax.Array:
        if shards == 1:
            return jnp.take(leaf, environments[0], axis=1, unique_indices=True)
        length, _, *rest = leaf.shape
        leaf = leaf.reshape(length, shards, -1, *rest)
        pick = jax.vmap(lambda a, b: jnp.take(a, b, axis=1), (1, 0), 1)
        return pick(leaf, environments).reshape(length, -1, *rest)

    return jax.tree.map(one, tree)


def passes(
    key: jax.Array,
    config: Config,
    epochs: int,
    body: Callable[[Any, jax.Array], tuple[Any, Any]],
    carry: Any,
) -> tuple[Any, Any]:
    """Scan `body(carry, environments)` over the minibatches of `epochs` shuffles.

    Returns:
        The last carry, and the mean of the other results of `body`.
    """

    def epoch(carry: Any, key: jax.Array) -> tuple[Any, Any]:
        return jax.lax.scan(body, carry, sample_minibatches(key, config))

    carry, results = jax.lax.scan(epoch, carry, jax.random.split(key, epochs))
    return carry, jax.tree.map(jnp.mean, results)


def train(
    key: jax.Array,
    config: Config,
    epochs: int,
    loss: Callable[[Any, Any], tuple[jax.Array, Metrics]],
    data: Any,
    networks: tuple[Any, Any],
    rate: jax.Array,
    highest: jax.Array,
    prefix: str = "",
    near: Callable[[Metrics], jax.Array] | None = None,
) -> tuple[Any, Any, Metrics]:
    """Train networks on a rollout.

    Args:
        key: random key for the shuffles.
        config: defines the minibatches.
        epochs: number of passes over the rollout.
        loss: maps params and a minibatch of `data` to float32[] and metrics.
        data: leaves [T, N, ...].
        networks: parameters and their Adam state.
        rate: learning rate.
        highest: clip gradients to this norm.
        prefix: prefix of the metric `gradient_norm`.
        near: maps the metrics of a minibatch to whether to take its step; after the first False,
            no more steps are taken. None: take all steps.

    Returns:
        Parameters, Adam state, and means of the metrics over all minibatches.
    """

    def body(carry: Any, environments: jax.Array) -> tuple[Any, Metrics]:
        params, adam, going = carry
        gradients, metrics = jax.grad(loss, has_aux=True)(params, take(data, environments))
        *learnt, size = step(gradients, adam, params, rate, highest)
        if near is not None:
            going &= near(metrics)
            learnt = jax.tree.map(
                lambda new, old: jnp.where(going, new, old), learnt, [params, adam]
            )
        return (*learnt, going), metrics | {f"{prefix}gradient_norm": size}

    (params, adam, _), metrics = passes(key, config, epochs, body, (*networks, jnp.bool_(True)))
    return params, adam, metrics
