"""Products and quotients in 32 bits, beside Python's own integers at the ends of their ranges."""

import itertools
from fractions import Fraction

import jax
import jax.numpy as jnp
import numpy as np

from jaxenstein.tasks.doom.fixed import (
    ENTRIES,
    ONE,
    direction,
    divide,
    multiply,
    rounded_fraction,
    sines,
    to_fixed,
)
from tests.reference import doom

LOWEST, HIGHEST = -(2**31), 2**31 - 1
RNG = np.random.default_rng(0)


def spread(ends: list[int], low: int, high: int, count: int = 3000) -> list[int]:
    """The numbers around some ends, and random ones between two of any size."""
    near = {end + offset for end in ends for offset in (-2, -1, 0, 1, 2)}
    sizes = np.exp2(RNG.uniform(0, 31, count)) * RNG.choice([-1, 1], count)
    return sorted({int(v) for v in [*near, *sizes] if low <= v <= high})


def arrays(pairs: list[tuple[int, int]]) -> tuple[jax.Array, jax.Array]:
    table = np.array(pairs, np.int32)
    return jnp.asarray(table[:, 0]), jnp.asarray(table[:, 1])


def test_multiply() -> None:
    values = spread([LOWEST, -ONE, 0, ONE, HIGHEST], LOWEST, HIGHEST)
    fractions = spread([0, 2048, ONE // 2, ONE], 0, ONE)
    pairs = list(itertools.product(values[::20] + values[:3] + values[-3:], fractions[::10]))
    pairs += [(v, f) for v in values for f in (0, 1, ONE - 1, ONE)]
    np.testing.assert_array_equal(multiply(*arrays(pairs)), [v * f >> 16 for v, f in pairs])


def test_rounded_fraction() -> None:
    wholes = spread([1, 2**17, 2**20, 2**21 - 1], 1, 2**21 - 1)
    pairs = [(part, whole) for whole in wholes for part in {0, 1, whole // 3, whole - 1, whole}]
    # Exact halves, which go to the even neighbour, and what is beside them.
    for whole in (2**17, 3 * 2**17, 2**20):
        pairs += [
            (part, whole)
            for k in (0, 1, 2, 3, 40000, 65534, 65535)
            for part in range(whole * (2 * k + 1) // 2**17 - 1, whole * (2 * k + 1) // 2**17 + 2)
            if 0 <= part <= whole
        ]
    expected = [round(Fraction(part * ONE, whole)) for part, whole in pairs]
    np.testing.assert_array_equal(rounded_fraction(*arrays(pairs)), expected)


def test_divide() -> None:
    most = 2**21 - 1
    values = spread([-most, 0, most], -most, most)
    divisors = spread([0, 1, 64, most], 0, most)
    pairs = list(itertools.product(values[::10] + values[-3:], divisors[::15] + divisors[:4]))

    def expected(value: int, divisor: int) -> int:
        if abs(value) >> 15 >= divisor:
            return LOWEST if value < 0 else HIGHEST
        quotient = (abs(value) << 16) // divisor
        return -quotient if value < 0 else quotient

    np.testing.assert_array_equal(divide(*arrays(pairs)), [expected(*pair) for pair in pairs])


def test_sines() -> None:
    expected = [doom.sine(index) for index in range(ENTRIES + ENTRIES // 4)]
    np.testing.assert_array_equal(sines(), expected)


def test_direction_takes_the_top_bits_of_an_angle() -> None:
    angles = np.array([0, 2**19 - 1, 2**19, 2**30, 2**31, 3 * 2**30, 2**32 - 1], np.uint32)
    cosine, sine = jax.vmap(direction)(jnp.asarray(angles))
    np.testing.assert_array_equal(cosine, [doom.cosine(int(a) >> 19) for a in angles])
    np.testing.assert_array_equal(sine, [doom.sine(int(a) >> 19) for a in angles])


def test_to_fixed() -> None:
    assert to_fixed(470.331) == 30823612
    assert to_fixed(-0.5) == -32768
