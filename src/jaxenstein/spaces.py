"""Action and observation spaces, named as in Gymnasium."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np


@dataclasses.dataclass(frozen=True)
class Discrete:
    """The integers 0 to `n - 1`, as int32[].

    Examples:
        >>> Discrete(3).contains(2), Discrete(3).contains(3)
        (True, False)
    """

    n: int

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of a value: ()."""
        return ()

    @property
    def dtype(self) -> np.dtype:
        """int32."""
        return np.dtype(np.int32)

    def sample(self, key: jax.Array) -> jax.Array:
        """Sample uniformly."""
        return jax.random.randint(key, (), 0, self.n, jnp.int32)

    def contains(self, value: Any) -> bool:
        """Whether a concrete value is in the space."""
        array = np.asarray(value)
        return array.shape == () and array.dtype.kind in "iu" and 0 <= int(array) < self.n


@dataclasses.dataclass(frozen=True)
class Box:
    """Arrays of one shape and dtype between two bounds, both included.

    Examples:
        >>> box = Box(0, 255, (2, 2), np.dtype(np.uint8))
        >>> box.contains(box.sample(jax.random.key(0)))
        True
        >>> box.contains(np.zeros((2, 2), np.float32))
        False
    """

    low: float
    high: float
    shape: tuple[int, ...]
    dtype: np.dtype = dataclasses.field(default_factory=lambda: np.dtype(np.float32))

    def sample(self, key: jax.Array) -> jax.Array:
        """Sample uniformly between the bounds; an infinite range is cut to a width of 2."""
        if np.issubdtype(self.dtype, np.integer):
            return jax.random.randint(key, self.shape, int(self.low), int(self.high) + 1).astype(
                self.dtype
            )
        below = self.high - 2.0 if np.isfinite(self.high) else -1.0
        low = self.low if np.isfinite(self.low) else below
        high = self.high if np.isfinite(self.high) else low + 2.0
        return jax.random.uniform(key, self.shape, self.dtype, low, high)

    def contains(self, value: Any) -> bool:
        """Whether a concrete value is in the space."""
        array = np.asarray(value)
        if array.shape != self.shape or array.dtype != self.dtype:
            return False
        return bool(np.all((array >= self.low) & (array <= self.high)))


@dataclasses.dataclass(frozen=True)
class Dict:
    """Dictionaries with one space for each key."""

    spaces: Mapping[str, Discrete | Box]

    def __hash__(self) -> int:
        """The hash of the entries in any order."""
        return hash(frozenset(self.spaces.items()))

    def sample(self, key: jax.Array) -> dict[str, jax.Array]:
        """Sample each entry independently."""
        keys = jax.random.split(key, len(self.spaces))
        return {
            name: space.sample(k)
            for (name, space), k in zip(self.spaces.items(), keys, strict=True)
        }

    def contains(self, value: Any) -> bool:
        """Whether a concrete value is in the space."""
        if not isinstance(value, Mapping) or set(value) != set(self.spaces):
            return False
        return all(space.contains(value[name]) for name, space in self.spaces.items())


Space = Discrete | Box | Dict
