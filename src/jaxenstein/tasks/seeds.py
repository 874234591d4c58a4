"""Settings that say which seeds are drawn from: those of levels, those of looks."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..errors import SettingError
from .draws import draw_index

MOST_SEEDS = 2**24
_SEEDS = 2**32


def draw_seed(key: jax.Array, seeds: tuple[int, int] | None) -> jax.Array:
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
