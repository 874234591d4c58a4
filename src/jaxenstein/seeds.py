"""Random keys of seeds."""

from __future__ import annotations

import jax

IMPLEMENTATION = "threefry2x32"
"""The kind of all keys, named so that no setting of JAX changes the meaning of a seed."""


def key_of(seed: int | jax.Array) -> jax.Array:
    """The typed key of a seed."""
    return jax.random.key(seed, impl=IMPLEMENTATION)
