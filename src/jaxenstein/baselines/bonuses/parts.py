"""Parts that several bonuses share: layers, embeddings, and the inverse model."""

# The type of flax' `apply` allows it to return variables too, which ours never do.
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
    """Hidden layers, then a linear one."""

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
    """An embedding phi of observations.

    Attributes:
        spec: what observations are.
        config: convolutions and dtype.
        hidden: width of the image features.
        latent: size of the embedding, `L`.
        unit: centre each embedding and scale it to length one.
    """

    spec: ObservationSpec
    config: Config
    hidden: int
    latent: int
    unit: bool = False

    def init(self, encoder: jax.Array, latent: jax.Array) -> dict[str, Any]:
        """Initialise the parameters, with a key for each of both parts."""
        features = jnp.zeros((1, self.hidden), self.config.compute_dtype)
        return {
            "encoder": self._encoder.init(encoder),
            "latent": self._latent.init(latent, features),
        }

    def embed(self, params: Any, obs: Any) -> jax.Array:
        """Embed observations: dtype[T, N, L]; with `unit` float32."""
        features = self._encoder.encode_sequence(params["encoder"], obs)
        latent = self._latent.apply(params["latent"], features)
        if not self.unit:
            return latent
        latent = latent.astype(jnp.float32)
        latent = latent - jnp.mean(latent, axis=-1, keepdims=True)
        return latent * jax.lax.rsqrt(jnp.sum(latent**2, axis=-1, keepdims=True) + 1e-12)

    @functools.cached_property
    def _encoder(self) -> ImageEncoder:
        return ImageEncoder(self.spec, self.hidden, self.config, self.config.compute_dtype)

    @functools.cached_property
    def _latent(self) -> Layers:
        return Layers(self.hidden, 0, self.latent, self.config.compute_dtype)


@dataclasses.dataclass(frozen=True)
class InverseModel:
    """Predicts the action from phi(o) and phi(o'), which trains an embedding (Pathak et al. 2017).

    The embedding keeps what actions change, and has no use for the rest.

    Attributes:
        embedding: phi.
        actions: their number, `A`.
        layers: number of hidden layers, as wide as the image features.
    """

    embedding: Embedding
    actions: int
    layers: int

    def init(self, key: jax.Array) -> Any:
        """Initialise the parameters."""
        pair = jnp.zeros((1, 2 * self.embedding.latent), self.embedding.config.compute_dtype)
        return self._inverse.init(key, pair)

    def loss(
        self, name: str, params: Any, phi: jax.Array, action: jax.Array, wanted: jax.Array
    ) -> tuple[jax.Array, Metrics]:
        """Cross-entropy of the actions taken, over the steps that are wanted.

        Args:
            name: the metrics' prefix.
            params: of `init`.
            phi: embeddings [T + 1, N, L].
            action: int32[T, N].
            wanted: bool[T, N].
        """
        dtype = self.embedding.config.compute_dtype
        pair = jnp.concatenate([phi[:-1], phi[1:]], axis=-1).astype(dtype)
        logits = self._inverse.apply(params, pair).astype(jnp.float32)
        right = jnp.argmax(logits, axis=-1).astype(action.dtype) == action
        loss = mean(-log_prob(logits, action), wanted)
        return loss, {
            f"{name}_inverse_loss": loss,
            f"{name}_inverse_accuracy": mean(right.astype(jnp.float32), wanted),
        }

    @functools.cached_property
    def _inverse(self) -> Layers:
        phi = self.embedding
        return Layers(phi.hidden, self.layers, self.actions, phi.config.compute_dtype)


def mean(values: jax.Array, wanted: jax.Array) -> jax.Array:
    """float32[], the mean of the values that are wanted; 0 if none is."""
    return jnp.sum(jnp.where(wanted, values, 0)) / number(wanted)


def number(wanted: jax.Array) -> jax.Array:
    """float32[], how many are wanted, at least 1."""
    return jnp.maximum(jnp.sum(wanted), 1).astype(jnp.float32)
