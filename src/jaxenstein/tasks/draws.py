"""Samples from random bits, so that a reset needs one call of the generator; ranges of seeds."""

from __future__ import annotations

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..errors import SettingError

MOST_SEEDS = 2**24
_SEEDS = 2**32


def random_bits(key: jax.Array, shape: tuple[int, ...]) -> jax.Array:
    """uint32 of a shape: those of `jax.random.bits`, drawn in one row.

    Compilers for CPUs work along the last axis alone, and of a short one number by number.
    """
    return jax.random.bits(key, (math.prod(shape),), jnp.uint32).reshape(shape)


def draw_unit(bits: jax.Array) -> jax.Array:
    """float32 in [0, 1), uniform over multiples of 2**-24, from uint32 bits."""
    return (bits >> 8).astype(jnp.float32) * jnp.float32(2.0**-24)


def draw_index(bits: jax.Array, count: int | jax.Array) -> jax.Array:
    """int32 from 0 to `count - 1`, uniform up to `count / 2**24`, from uint32 bits."""
    index = (draw_unit(bits) * jnp.asarray(count, jnp.float32)).astype(jnp.int32)
    return jnp.minimum(index, count - 1)


def sample_seed(key: jax.Array, seeds: tuple[int, int] | None) -> jax.Array:
    """uint32[]: any seed, or one of those from the first to before the second of two.

    Args:
        key: for nothing else.
        seeds: as `checked_seeds` returns them.
    """
    bits = jax.random.bits(key, (), jnp.uint32)
    if seeds is None:
        return bits
    first, stop = seeds
    return jnp.uint32(first) + draw_index(bits, stop - first).astype(jnp.uint32)


def checked_seeds(field: str, seeds: Any) -> tuple[int, int] | None:
    """A setting of seeds as (first, stop), or None for all.

    Args:
        field: the name of the setting.
        seeds: what it was given.

    Raises:
        SettingError: it is no such setting.
    """
    if seeds is None:
        return None
    ends = (seeds.start, seeds.stop) if isinstance(seeds, range) else seeds
    listed = isinstance(ends, tuple | list | np.ndarray) and len(ends) == 2
    whole = listed and all(
        isinstance(end, int | np.integer) and not isinstance(end, bool) for end in ends
    )
    steps = not isinstance(seeds, range) or seeds.step == 1
    if not (whole and steps and 0 <= ends[0] < ends[1] <= _SEEDS) or (
        ends[1] - ends[0] > MOST_SEEDS
    ):
        raise SettingError(
            f"{field} must be None or two whole numbers, the first seed and the one past the "
            f"last, from 0 to 2**32 and at most 2**24 apart, not {seeds!r}"
        )
    return int(ends[0]), int(ends[1])
