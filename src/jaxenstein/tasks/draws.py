"""Samples from random bits, so that a reset calls the random generator only once."""

from __future__ import annotations

import math
from typing import TypeVar

import jax
import jax.numpy as jnp
import numpy as np

Words = TypeVar("Words", jax.Array, np.ndarray)


def random_bits(key: jax.Array, shape: tuple[int, ...]) -> jax.Array:
    """uint32 of a shape: the bits of `jax.random.bits`, drawn as one row.

    CPU compilers only vectorise along the last axis, which is too short in small shapes.
    """
    return jax.random.bits(key, (math.prod(shape),), jnp.uint32).reshape(shape)


def sample_unit(bits: jax.Array) -> jax.Array:
    """float32 in [0, 1), uniform over multiples of 2**-24, from uint32 bits."""
    return (bits >> 8).astype(jnp.float32) * jnp.float32(2.0**-24)


def sample_index(bits: jax.Array, count: int | jax.Array) -> jax.Array:
    """int32 from 0 to `count - 1`, uniform up to `count / 2**24`, from uint32 bits."""
    index = (sample_unit(bits) * jnp.asarray(count, jnp.float32)).astype(jnp.int32)
    return jnp.minimum(index, count - 1)


def sample_seed(key: jax.Array, seeds: tuple[int, int] | None) -> jax.Array:
    """uint32[]: any seed, or one from a range.

    Args:
        key: a random key that is not used elsewhere.
        seeds: the first seed and the one after the last, or None for any seed.
    """
    bits = jax.random.bits(key, (), jnp.uint32)
    if seeds is None:
        return bits
    first, stop = seeds
    return jnp.uint32(first) + sample_index(bits, stop - first).astype(jnp.uint32)


def mixed(word: Words) -> Words:
    """uint32: the words after a bijection that mixes their bits, Chris Wellons' lowbias32."""
    for shift, factor in ((16, 0x7FEB352D), (15, 0x846CA68B)):
        word = (word ^ (word >> np.uint32(shift))) * np.uint32(factor)
    return word ^ (word >> np.uint32(16))


def random_order(bits: jax.Array, real: jax.Array) -> jax.Array:
    """int32[n]: a random order of the first `real` of n, then the others, from uint32[n]."""
    lacking = np.arange(len(bits), dtype=np.int32) >= real
    return jnp.argsort(jnp.where(lacking, jnp.uint32(2**32 - 1), bits >> 1))
