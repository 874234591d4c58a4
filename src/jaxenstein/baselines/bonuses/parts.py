"""Layers, embeddings and masked means that several bonuses share."""

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

from ..bonus import Metrics
from ..config import Config
from ..networks import ImageEncoder, dense
from ..observations import ObservationSpec
from ..rollout import log_prob


class Layers(nn.Module):
    """Hidden layers, then a linear layer."""

    hidden: int
    layers: int
    output: int
    dtype: DTypeLike

    @nn.compact
    def __call__(self, features: jax.Array) -> jax.Array:
        """Return dtype[..., output]."""
        for _ in range(self.layers):
            features = nn.relu(dense(self.hidden, 2.0**0.5, self.dtype)(features))
        return dense(self.output, 1.0, self.dtype)(features)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Embedding:
    """An embedding phi of observations, and an inverse model that can train it.

    The inverse model predicts the action from phi(o) and phi(o') (Pathak et al. 2017), so the
    embedding represents only the parts of an observation that actions change.

    Attributes:
        spec: the arrays of an observation.
        actions: number of actions, `A`.
        config: defines convolutions and dtype.
        hidden: width of the image features, and of the hidden layers of the inverse model.
        layers: number of hidden layers of the inverse model.
        latent: size of the embedding, `L`.
        unit: centre each embedding and scale it to length one.
    """

    spec: ObservationSpec
    actions: int
    config: Config
    hidden: int
    layers: int
    latent: int
    unit: bool = False

    def init(
        self, encoder: jax.Array, latent: jax.Array, inverse: jax.Array | None
    ) -> dict[str, Any]:
        """Initialise the parameters with a key per part; None leaves out the inverse model."""
        dtype = self.config.compute_dtype
        params = {
            "encoder": self._encoder.init(encoder),
            "latent": self._latent.init(latent, jnp.zeros((1, self.hidden), dtype)),
        }
        if inverse is not None:
            pair = jnp.zeros((1, 2 * self.latent), dtype)
            params["inverse"] = self._inverse.init(inverse, pair)
        return params

    def embed(self, params: Any, obs: Any) -> jax.Array:
        """Embed observations: dtype[T, N, L], or float32 with `unit`."""
        features = self._encoder.encode_sequence(params["encoder"], obs)
        latent = self._latent.apply(params["latent"], features)
        if not self.unit:
            return latent
        latent = latent.astype(jnp.float32)
        latent = latent - jnp.mean(latent, axis=-1, keepdims=True)
        return latent * jax.lax.rsqrt(jnp.sum(latent**2, axis=-1, keepdims=True) + 1e-12)

    def inverse_loss(
        self, name: str, params: Any, phi: jax.Array, action: jax.Array, wanted: jax.Array
    ) -> tuple[jax.Array, Metrics]:
        """Cross-entropy of predicting actions int32[T, N] from embeddings `phi` [T + 1, N, L].

        Only steps with `wanted`, bool[T, N], count; `name` is the prefix of the metrics.
        """
        pair = jnp.concatenate([phi[:-1], phi[1:]], axis=-1).astype(self.config.compute_dtype)
        logits = self._inverse.apply(params["inverse"], pair).astype(jnp.float32)
        right = jnp.argmax(logits, axis=-1).astype(action.dtype) == action
        loss = mean(-log_prob(logits, action), wanted)
        return loss, {
            f"{name}_inverse_loss": loss,
            f"{name}_inverse_accuracy": mean(right.astype(jnp.float32), wanted),
        }

    @functools.cached_property
    def _encoder(self) -> ImageEncoder:
        return ImageEncoder(self.spec, self.hidden, self.config, self.config.compute_dtype)

    @functools.cached_property
    def _latent(self) -> Layers:
        return Layers(self.hidden, 0, self.latent, self.config.compute_dtype)

    @functools.cached_property
    def _inverse(self) -> Layers:
        return Layers(self.hidden, self.layers, self.actions, self.config.compute_dtype)


def mean(values: jax.Array, wanted: jax.Array) -> jax.Array:
    """float32[], the mean of the values where `wanted`; 0 if there are none."""
    return jnp.sum(jnp.where(wanted, values, 0)) / count_of(wanted)


def count_of(wanted: jax.Array) -> jax.Array:
    """float32[], the number of wanted values, at least 1."""
    return jnp.maximum(jnp.sum(wanted), 1).astype(jnp.float32)
