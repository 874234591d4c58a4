"""Chance as Doom has it: out of random bytes."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np


def byte(bits: jax.Array, number: int) -> jax.Array:
    """int32[...], 0 to 255: one of the four bytes of uint32[...]."""
    return ((bits >> (8 * number)) & 255).astype(jnp.int32)


def roll(
    dice: int | np.ndarray | jax.Array, sides: int | np.ndarray | jax.Array, byte: jax.Array
) -> jax.Array:
    """int32[...]: so many times a die of so many sides, from random bytes."""
    return jnp.asarray(dice) * (byte % jnp.asarray(sides) + 1)


def spread(bits: jax.Array, shift: int | np.ndarray) -> jax.Array:
    """uint32[...]: an angle's error, the difference of two bytes times 2**shift."""
    return ((byte(bits, 0) - byte(bits, 1)) << shift).astype(jnp.uint32)
