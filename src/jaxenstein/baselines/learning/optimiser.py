"""Adam behind a clip of the gradient's global norm, with traced numbers."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import optax

# As pobax, Craftax' baselines and SB3 have it; with the usual 1e-8 early steps are larger.
_ADAM = optax.scale_by_adam(eps=1e-5)


def init(params: Any) -> Any:
    """The state of the optimiser."""
    return _ADAM.init(params)


def norm(tree: Any) -> jax.Array:
    """float32[], the Euclidean norm over all leaves."""
    return jnp.sqrt(sum(jnp.sum(leaf**2) for leaf in jax.tree.leaves(tree)))


def clip(gradients: Any, highest: jax.Array) -> tuple[Any, jax.Array]:
    """Scale the gradients down to a global norm.

    Returns:
        The gradients, and float32[] their norm before.
    """
    size = norm(gradients)
    factor = jnp.minimum(1, highest / jnp.maximum(size, 1e-12))
    return jax.tree.map(lambda leaf: leaf * factor, gradients), size


def step(
    gradients: Any, state: Any, params: Any, learning_rate: jax.Array, highest: jax.Array
) -> tuple[Any, Any, jax.Array]:
    """Clip, then take a step of Adam.

    Returns:
        Parameters, state, and float32[] the gradient's norm before the clip.
    """
    gradients, size = clip(gradients, highest)
    # Optax raises a float to a whole number, which strict promotion would refuse.
    with jax.numpy_dtype_promotion("standard"):
        updates, state = _ADAM.update(gradients, state, params)
    params = jax.tree.map(lambda p, u: p - learning_rate * u, params, updates)
    return params, state, size
