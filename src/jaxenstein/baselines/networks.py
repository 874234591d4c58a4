"""The networks: image encoder, GRU with resets inside a sequence, actor and critic.

Every function accepts any leading axes; the first axis of a sequence is time. Parameters and
results are float32; computations use the dtype of the config.
"""

# By its type, flax' `apply` may also return variables; ours never does.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportReturnType=false

from __future__ import annotations

import dataclasses
import functools
from typing import Any

import flax.linen as nn
import jax
import jax.numpy as jnp
from jax.typing import DTypeLike

from ..convolution import output_size, patch_convolution
from ..errors import SettingError
from .config import Config
from .convolution import conv_lax
from .observations import ObservationSpec

Layers = tuple[tuple[int, int, int], ...]

# Number of pixels to encode at once on a CPU: 16 frames of 64x64, or 256 of 16x16.
PIECE = 16 * 64 * 64

NATURE: Layers = ((8, 4, 32), (4, 2, 64), (3, 1, 64))
"""(kernel, stride, features) of Mnih et al. 2015; for images of at least 36 pixels a side."""

SMALL: Layers = ((4, 2, 16), (3, 2, 32))
"""Layers for smaller images."""

PATCHES: Layers = ((4, 4, 32),)
"""Patches without overlap, as in Dosovitskiy et al. 2021: a single matrix product."""

# About the mean over the pixels of our frames; `contrast` subtracts it.
MEAN = 0.3

_SQRT2 = 2.0**0.5


def dense(size: int, gain: float, dtype: DTypeLike) -> nn.Dense:
    """A dense layer with orthogonal initial weights and zero bias."""
    initial = nn.initializers.orthogonal(gain)
    return nn.Dense(size, kernel_init=initial, dtype=dtype, param_dtype=jnp.float32)


class Encoder(nn.Module):
    """Encodes an observation: convolutions for each image, then a dense layer over all parts."""

    spec: ObservationSpec
    features: int
    layers: Layers | None
    implementation: str
    dtype: DTypeLike

    @nn.compact
    def __call__(self, images: list[jax.Array], vector: jax.Array) -> jax.Array:
        """Map the result of `ObservationSpec.prepare` to dtype[..., features]."""
        parts = [
            self._convolve(image, shape, index)
            for index, (image, shape) in enumerate(zip(images, self.spec.images, strict=True))
        ]
        merged = jnp.concatenate([*parts, vector], axis=-1)
        return nn.relu(dense(self.features, _SQRT2, self.dtype)(merged))

    def _convolve(self, image: jax.Array, shape: tuple[int, int, int], index: int) -> jax.Array:
        convolve = conv_lax if self.implementation == "lax" else patch_convolution
        channels = shape[-1]
        for number, (kernel, stride, features) in enumerate(layers_for(shape, self.layers)):
            name = f"image{index}_convolution{number}"
            size = (kernel, kernel, channels, features)
            orthogonal = nn.initializers.orthogonal(_SQRT2)
            weights = self.param(f"{name}_kernel", orthogonal, size, jnp.float32)
            bias = self.param(f"{name}_bias", nn.initializers.zeros, (features,), jnp.float32)
            image = convolve(image, weights.astype(self.dtype), stride)
            bias = bias.astype(self.dtype).reshape((1,) * (image.ndim - 1) + (-1,))
            image = nn.relu(image + bias)
            channels = features
        return image.reshape(*image.shape[:-3], -1)


def layers_for(shape: tuple[int, int, int], layers: Layers | None) -> Layers:
    """The convolutions for an image.

    Raises:
        SettingError: the image is too small for the layers.
    """
    height, width, _ = shape
    if layers is None:
        layers = NATURE if min(height, width) >= 36 else SMALL
    for kernel, stride, _ in layers:
        if min(height, width) < kernel:
            raise SettingError(
                f"convolutions {list(layers)} are too large for images of {shape[0]}x{shape[1]}: "
                f"the input of kernel {kernel} is {height}x{width}; use fewer or smaller layers"
            )
        height, width = output_size(height, kernel, stride), output_size(width, kernel, stride)
    return layers


def _orthogonal_gates(key: jax.Array, shape: tuple[int, int], dtype: DTypeLike) -> jax.Array:
    """Recurrent weights, orthogonal in each of the three gates."""
    size = shape[0]
    orthogonal = nn.initializers.orthogonal()
    gates = [orthogonal(k, (size, size), dtype) for k in jax.random.split(key, 3)]
    return jnp.concatenate(gates, axis=1)


class GRU(nn.Module):
    """A gated recurrent unit (Cho et al. 2014), with the reset gate after the matrix as in cuDNN.

    r = sig(Wr x + br + Ur h),  z = sig(Wz x + bz + Uz h)
    n = tanh(Wn x + bn + r (Un h + cn)),  h' = (1 - z) n + z h
    """

    size: int
    dtype: DTypeLike

    @nn.compact
    def __call__(
        self, inputs: jax.Array, reset: jax.Array, hidden: jax.Array
    ) -> tuple[jax.Array, jax.Array]:
        """Run over a sequence.

        Args:
            inputs: dtype[T, N, F].
            reset: bool[T, N], whether to clear the memory before the step.
            hidden: float32[N, size], the memory before the first step.

        Returns:
            float32[T, N, size], the memory after each step, and float32[N, size], the last one.
        """
        gates = nn.Dense(3 * self.size, dtype=self.dtype, param_dtype=jnp.float32)(inputs)
        size = (self.size, 3 * self.size)
        weights = self.param("recurrent", _orthogonal_gates, size, jnp.float32)
        bias = self.param("candidate_bias", nn.initializers.zeros, (self.size,), jnp.float32)
        weights, bias = weights.astype(self.dtype), bias.astype(hidden.dtype)[None]

        def cell(
            hidden: jax.Array, step: tuple[jax.Array, jax.Array]
        ) -> tuple[jax.Array, jax.Array]:
            gates, reset = step
            hidden = jnp.where(reset[:, None], jnp.zeros_like(hidden), hidden)
            recurrent = (hidden.astype(self.dtype) @ weights).astype(hidden.dtype)
            reset_x, update_x, new_x = jnp.split(gates.astype(hidden.dtype), 3, axis=-1)
            reset_h, update_h, new_h = jnp.split(recurrent, 3, axis=-1)
            update = nn.sigmoid(update_x + update_h)
            new = jnp.tanh(new_x + nn.sigmoid(reset_x + reset_h) * (new_h + bias))
            hidden = (1 - update) * new + update * hidden
            return hidden, hidden

        last, all_steps = jax.lax.scan(cell, hidden, (gates, reset))
        return all_steps, last


class Heads(nn.Module):
    """Policy logits and values, each with its own hidden layer."""

    actions: int
    values: int
    hidden: int
    value_gain: float
    dtype: DTypeLike

    @nn.compact
    def __call__(self, memory: jax.Array) -> tuple[jax.Array, jax.Array]:
        """Return dtype[..., actions] and dtype[..., values]."""
        memory = memory.astype(self.dtype)
        actor = nn.relu(dense(self.hidden, _SQRT2, self.dtype)(memory))
        logits = dense(self.actions, 0.01, self.dtype)(actor)
        critic = nn.relu(dense(self.hidden, _SQRT2, self.dtype)(memory))
        return logits, dense(self.values, self.value_gain, self.dtype)(critic)


@dataclasses.dataclass(frozen=True)
class ImageEncoder:
    """An image encoder with its own parameters.

    Attributes:
        spec: the arrays of an observation.
        features: size of the result.
        config: defines the convolutions.
        dtype: dtype of the computations.
        contrast: as in `Config`; 0 leaves images unchanged.
    """

    spec: ObservationSpec
    features: int
    config: Config
    dtype: DTypeLike
    contrast: float = 0.0

    def init(self, key: jax.Array) -> Any:
        """Initialise the parameters."""
        images = [jnp.zeros((1, *shape), self.dtype) for shape in self.spec.images]
        return self._module.init(key, images, jnp.zeros((1, self.spec.vector), self.dtype))

    def encode(self, params: Any, obs: Any) -> jax.Array:
        """Map observations to dtype[..., features]."""
        images, vector = self.spec.prepare(obs, self.dtype)
        if self.contrast:
            images = [
                image if part.scaling == "bits" else self.contrast * (image - MEAN)
                for image, part in zip(images, self.spec.image_parts, strict=True)
            ]
        return self._module.apply(params, images, vector)

    def encode_sequence(self, params: Any, obs: Any) -> jax.Array:
        """Encode observations with leading axes [T, N].

        A CPU encodes them piece by piece, so that each piece stays in the cache, and again in the
        backward pass. This is twice as fast and needs far less memory.
        """
        length, batch = jax.tree.leaves(obs)[0].shape[:2]
        pixels = max((shape[0] * shape[1] for shape in self.spec.images), default=1)
        piece = max(
            size
            for size in range(1, length + 1)
            if length % size == 0 and (size == 1 or size * batch * pixels <= PIECE)
        )
        if jax.default_backend() != "cpu" or piece == length:
            return self.encode(params, obs)
        pieces = jax.tree.map(lambda leaf: leaf.reshape(-1, piece, *leaf.shape[1:]), obs)
        encode = jax.checkpoint(lambda part: self.encode(params, part))
        features = jax.lax.map(encode, pieces)
        return features.reshape(length, batch, -1)

    @functools.cached_property
    def _module(self) -> Encoder:
        config = self.config
        return Encoder(
            self.spec, self.features, config.convolutions, config.convolution, self.dtype
        )


@dataclasses.dataclass(frozen=True)
class ActorCritic:
    """The recurrent network of policy and values.

    Attributes:
        spec: the arrays of an observation.
        actions: number of actions, `A`.
        values: number of values, `V`.
        config: sizes, dtype and convolutions.
        dtype: dtype of the computations.
        state_dtype: dtype of memory and results; tests use float64.
    """

    spec: ObservationSpec
    actions: int
    values: int
    config: Config
    dtype: DTypeLike = jnp.float32
    state_dtype: DTypeLike = jnp.float32

    @functools.cached_property
    def encoder(self) -> ImageEncoder:
        """The image encoder."""
        config = self.config
        return ImageEncoder(self.spec, config.features, config, self.dtype, config.contrast)

    def init(self, key: jax.Array) -> dict[str, Any]:
        """Initialise the parameters."""
        encoder_key, core_key, heads_key = jax.random.split(key, 3)
        width = self.config.features + self.actions
        sequence = jnp.zeros((1, 1, width), self.dtype)
        memory = self.initial_memory(1)
        params = {
            "encoder": self.encoder.init(encoder_key),
            "core": self._core.init(core_key, sequence, jnp.zeros((1, 1), bool), memory),
            "heads": self._heads.init(heads_key, memory),
        }
        if self.config.persistence:
            params["persistence"] = jnp.full(self.actions, self.config.persistence, jnp.float32)
        return params

    def initial_memory(self, batch: int) -> jax.Array:
        """The memory at the start of an episode: float[batch, hidden], zeros."""
        return jnp.zeros((batch, self.config.hidden), self.state_dtype)

    def unroll(
        self, params: Any, obs: Any, previous: jax.Array, first: jax.Array, memory: jax.Array
    ) -> tuple[jax.Array, jax.Array, jax.Array]:
        """Run over sequences.

        Args:
            params: parameters from `init`.
            obs: observations with leading axes [T, N].
            previous: int32[T, N], the actions before each observation; ignored where `first`.
            first: bool[T, N], whether the observation is the first of an episode.
            memory: float32[N, hidden] before the first step.

        Returns:
            float32[T, N, A] logits, float32[T, N, V] values, float32[N, hidden] memory after
            the last step.
        """
        features = self.encoder.encode_sequence(params["encoder"], obs)
        if not self.config.recurrent:
            first = jnp.ones_like(first)
        # The one-hot vector of -1, for no action, is zero.
        action = jnp.where(first, jnp.full_like(previous, -1), previous)
        action = jax.nn.one_hot(action, self.actions, dtype=self.dtype)
        inputs = jnp.concatenate([features, action], axis=-1)
        steps, last = self._core.apply(params["core"], inputs, first, memory)
        logits, values = self._heads.apply(params["heads"], steps)
        logits, values = logits.astype(self.state_dtype), values.astype(self.state_dtype)
        if "persistence" in params:
            again = params["persistence"].astype(self.state_dtype)[None, None]
            logits = logits + again * action.astype(self.state_dtype)
        return logits, values, last

    def step(
        self, params: Any, obs: Any, previous: jax.Array, first: jax.Array, memory: jax.Array
    ) -> tuple[jax.Array, jax.Array, jax.Array]:
        """One step of `unroll`, without the time axis."""
        obs = jax.tree.map(lambda leaf: leaf[None], obs)
        logits, values, memory = self.unroll(params, obs, previous[None], first[None], memory)
        return logits[0], values[0], memory

    @functools.cached_property
    def _core(self) -> GRU:
        return GRU(self.config.hidden, self.dtype)

    @functools.cached_property
    def _heads(self) -> Heads:
        gain = 0.01 if self.config.zero_values else 1.0
        return Heads(self.actions, self.values, self.config.head, gain, self.dtype)
