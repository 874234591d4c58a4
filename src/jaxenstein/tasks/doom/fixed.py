"""Doom's numbers: 16.16 fixed point in 32 bits, its sines, and its random bytes.

Doom multiplies and divides in 64 bits, which JAX only has in its 64-bit mode. Each function here
returns the same bits with only int32 and uint32, within the ranges in its docstring.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

FRACTION_BITS = 16
ONE = 1 << FRACTION_BITS
# The entries of the table of sines per turn; the top bits of an angle select the entry.
ENTRIES = 8192
ENTRY_SHIFT = 32 - 13
FEW = 8
"""Results that few of a batch need are computed for an eighth of the batch at a time."""
_LOW = ONE - 1
_HIGHEST, _LOWEST = 2**31 - 1, -(2**31)


def to_fixed(value: float) -> int:
    """A number as 16.16, rounded to nearest."""
    return round(value * ONE)


def multiply(value: jax.Array, fraction: jax.Array) -> jax.Array:
    """int32: `value * fraction` rounded down, for any int32 value and a fraction of 0 to `ONE`."""
    whole = (value >> FRACTION_BITS) * fraction
    low = (value & _LOW).astype(jnp.uint32) * fraction.astype(jnp.uint32)
    return whole + (low >> FRACTION_BITS).astype(jnp.int32)


def rounded_fraction(part: jax.Array, whole: jax.Array) -> jax.Array:
    """int32: `part / whole`, rounded to nearest, with ties to even.

    Args:
        part: int32, 0 to `whole`.
        whole: int32, 1 to 2**21 - 1.
    """
    quotient, rest = _divide(part, whole)
    up = (2 * rest > whole) | ((2 * rest == whole) & (quotient & 1 == 1))
    return quotient + up.astype(jnp.int32)


def divide(value: jax.Array, divisor: jax.Array) -> jax.Array:
    """int32: `value / divisor` rounded towards zero, saturated if it is too large.

    Args:
        value: int32, with magnitude below 2**21.
        divisor: int32, 0 to 2**21 - 1.
    """
    size, safe = jnp.abs(value), jnp.maximum(divisor, 1)
    whole, rest = _quotient(size, safe)
    quotient = (whole << FRACTION_BITS) + _divide(rest, safe)[0]
    quotient = jnp.where(value < 0, -quotient, quotient)
    most = jnp.where(value < 0, jnp.int32(_LOWEST), jnp.int32(_HIGHEST))
    return jnp.where(size >> 15 >= divisor, most, quotient)


def _divide(part: jax.Array, whole: jax.Array) -> tuple[jax.Array, jax.Array]:
    """int32 twice: 65536 part / whole, and the remainder; in two steps of 10 and 6 bits."""
    first, rest = _quotient(part << 10, whole)
    second, rest = _quotient(rest << 6, whole)
    return (first << 6) + second, rest


def _quotient(value: jax.Array, divisor: jax.Array) -> tuple[jax.Array, jax.Array]:
    """int32 twice: quotient and remainder of value >= 0 and divisor > 0; quotients below 2**20.

    Uses floats, which are off by at most one, because processors have no integer vector division.
    """
    guess = (value.astype(jnp.float32) / divisor.astype(jnp.float32)).astype(jnp.int32)
    rest = value - guess * divisor
    low, high = rest < 0, rest >= divisor
    guess = guess - low.astype(jnp.int32) + high.astype(jnp.int32)
    rest = rest + jnp.where(low, divisor, 0) - jnp.where(high, divisor, 0)
    return guess, rest


def sines() -> np.ndarray:
    """int32[10240]: Doom's sines of a turn and a quarter; the quarter makes them cosines too.

    The second quarter mirrors the first with an offset of one entry, as in the game.
    """
    quarter = ENTRIES // 4
    steps = np.arange(quarter) * (2 * np.pi / ENTRIES)
    first = np.trunc(ONE * np.sin(steps)).astype(np.int32)
    half = np.concatenate([first, first[::-1]])
    circle = np.concatenate([half, -half])
    circle[quarter], circle[3 * quarter] = ONE, -ONE
    return np.concatenate([circle, circle[:quarter]])


def direction(angle: jax.Array) -> tuple[jax.Array, jax.Array]:
    """int32 cosine and sine of an angle (uint32, 2**32 per turn) from Doom's table."""
    table = jnp.asarray(sines())
    entry = (angle >> ENTRY_SHIFT).astype(jnp.int32)
    cosine = table.at[entry + ENTRIES // 4].get(mode="promise_in_bounds")
    return cosine, table.at[entry].get(mode="promise_in_bounds")


def byte(bits: jax.Array, number: int) -> jax.Array:
    """int32[...], 0 to 255: one of the four bytes of uint32[...]."""
    return ((bits >> (8 * number)) & 255).astype(jnp.int32)


def roll(
    dice: int | np.ndarray | jax.Array, sides: int | np.ndarray | jax.Array, byte: jax.Array
) -> jax.Array:
    """int32[...]: `dice` times the roll of a die with `sides` sides, from random bytes."""
    return jnp.asarray(dice) * (byte % jnp.asarray(sides) + 1)


def spread(bits: jax.Array, shift: int | np.ndarray) -> jax.Array:
    """uint32[...]: a random angle error: the difference of two bytes, times 2**shift."""
    return ((byte(bits, 0) - byte(bits, 1)) << shift).astype(jnp.uint32)
