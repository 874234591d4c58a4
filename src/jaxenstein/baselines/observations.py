"""Converts observations to network inputs: images and one vector, with numbers of order one."""

from __future__ import annotations

import dataclasses
import math
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import DTypeLike

from ..errors import SettingError
from ..params import split_ranges

Scaling = Literal["bounds", "log", "distance", "bits"]

# The smallest side of an image; smaller arrays are flattened into the vector.
SMALLEST_IMAGE = 8


@dataclasses.dataclass(frozen=True)
class Part:
    """One array of an observation.

    Attributes:
        shape: shape of the array.
        image: whether it is an image, [height, width] or [height, width, channels].
        scaling: `"bounds"`: from [low, high] to [0, 1]; `"log"`: sign(x) log(1 + |x|);
            `"distance"`: 1 / (1 + x); `"bits"`: the eight bits of an id.
        low: lowest value, for `"bounds"`.
        high: highest value, for `"bounds"`.
    """

    shape: tuple[int, ...]
    image: bool
    scaling: Scaling
    low: float = 0.0
    high: float = 1.0


@dataclasses.dataclass(frozen=True)
class ObservationSpec:
    """The arrays of an observation, in the order of `jax.tree.leaves`; hashable."""

    parts: tuple[Part, ...]

    @property
    def image_parts(self) -> tuple[Part, ...]:
        """The parts that are images."""
        return tuple(part for part in self.parts if part.image)

    @property
    def images(self) -> tuple[tuple[int, int, int], ...]:
        """(height, width, channels) of each image that `prepare` returns."""
        return tuple(
            (
                part.shape[0],
                part.shape[1],
                8 if part.scaling == "bits" else math.prod(part.shape[2:]),
            )
            for part in self.image_parts
        )

    @property
    def vector(self) -> int:
        """Length of the vector that `prepare` returns."""
        return sum(math.prod(part.shape) for part in self.parts if not part.image)

    def prepare(self, obs: Any, dtype: DTypeLike) -> tuple[list[jax.Array], jax.Array]:
        """Scale observations with any leading axes.

        Returns:
            The images, dtype[..., height, width, channels], and the vector, dtype[..., vector].
        """
        leaves = jax.tree.leaves(obs)
        lead = leaves[0].shape[: leaves[0].ndim - len(self.parts[0].shape)]
        images, vectors = [], [jnp.zeros((*lead, 0), dtype)]
        for part, leaf in zip(self.parts, leaves, strict=True):
            values = _scale(part, leaf, dtype)
            if part.image:
                channels = values.shape[len(lead) + 2 :]
                images.append(values if channels else values[..., None])
            else:
                vectors.append(values.reshape(*lead, -1))
        return images, jnp.concatenate(vectors, axis=-1)


def observation_spec(env: Any, params: Any) -> ObservationSpec:
    """The arrays in the observations of an environment of this package, or of a gymnax one.

    Raises:
        SettingError: an array has more than three axes, or does not hold numbers.
    """
    params = split_ranges(params)[0]
    shapes = jax.eval_shape(env.reset, jax.random.key(0), params)[0]
    space = env.observation_space(params)
    labels = getattr(env, "observation", None) == "labels"
    paths = jax.tree_util.tree_flatten_with_path(shapes)[0]
    return ObservationSpec(tuple(_part(path, leaf, space, labels) for path, leaf in paths))


def _part(path: Any, leaf: jax.ShapeDtypeStruct, space: Any, labels: bool) -> Part:
    for step in path:
        space = getattr(space, "spaces", {}).get(getattr(step, "key", None))
    where = jax.tree_util.keystr(path) or "the observation"
    dtype = np.dtype(leaf.dtype)
    if len(leaf.shape) > 3 or dtype.kind not in "fiub":
        raise SettingError(
            f"{where} must be an array of numbers with at most three axes, not "
            f"{dtype}{list(leaf.shape)}"
        )
    image = len(leaf.shape) >= 2 and min(leaf.shape[:2]) >= SMALLEST_IMAGE
    if labels and image:
        return Part(leaf.shape, image, "bits")
    low, high = _bounds(space, dtype)
    if math.isfinite(low) and math.isfinite(high) and high > low:
        return Part(leaf.shape, image, "bounds", low, high)
    return Part(leaf.shape, image, "distance" if image and low == 0 else "log")


def _bounds(space: Any, dtype: np.dtype) -> tuple[float, float]:
    if dtype.kind == "b":
        return 0.0, 1.0
    n = getattr(space, "n", None)
    if n is not None:
        return 0.0, float(n - 1)
    low, high = getattr(space, "low", None), getattr(space, "high", None)
    if low is None or high is None:
        return (0.0, 255.0) if dtype == np.uint8 else (-math.inf, math.inf)
    return float(np.min(np.asarray(low))), float(np.max(np.asarray(high)))


def _scale(part: Part, leaf: jax.Array, dtype: DTypeLike) -> jax.Array:
    if part.scaling == "bits":
        bits = jnp.arange(8, dtype=leaf.dtype).reshape((1,) * leaf.ndim + (8,))
        return ((leaf[..., None] >> bits) & 1).astype(dtype)
    # bfloat16 represents bytes exactly, so they need no conversion to float32 first.
    exact = leaf.dtype == jnp.uint8 or dtype != jnp.bfloat16
    values = leaf.astype(dtype if exact else jnp.float32)
    if part.scaling == "bounds":
        values = (values - part.low) / (part.high - part.low)
    elif part.scaling == "distance":
        values = 1 / (1 + jnp.maximum(values, 0))
    else:
        values = jnp.sign(values) * jnp.log1p(jnp.abs(values))
    return values.astype(dtype)
