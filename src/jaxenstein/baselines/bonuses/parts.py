"""What bonuses have in common: layers, an inverse model, and training by an Adam of their own."""

# flax' `apply` is typed as if it might return variables as well, which ours never do.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportReturnType=false

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from typing import Any

import flax.linen as nn
import jax
import jax.numpy as jnp
from jax.typing import DTypeLike

from ..learning import optimiser
from ..learning.bonus import Metrics
from ..learning.config import Config
from ..learning.hparams import HParams
from ..learning.minibatches import passes, take
from ..learning.networks import Eye, dense
from ..learning.observations import ObservationSpec
from ..learning.rollout import log_prob


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
        config: kind of convolutions and dtype.
        hidden: width of the image features.
        latent: size of the embedding, `L`.
        unit: centre each embedding and scale it to length one.
    """

    spec: ObservationSpec
    config: Config
    hidden: int
    latent: int
    unit: bool = False

    def init(self, eye: jax.Array, latent: jax.Array) -> dict[str, Any]:
        """Draw the parameters, with a key for each of both parts."""
        features = jnp.zeros((1, self.hidden), self.config.compute_dtype)
        return {"encoder": self._eye.init(eye), "latent": self._latent.init(latent, features)}

    def embed(self, params: Any, obs: Any) -> jax.Array:
        """Embed observations: dtype[T, N, L]; with `unit` float32."""
        features = self._eye.encode_sequence(params["encoder"], obs)
        latent = self._latent.apply(params["latent"], features)
        if not self.unit:
            return latent
        latent = latent.astype(jnp.float32)
        latent = latent - jnp.mean(latent, axis=-1, keepdims=True)
        return latent * jax.lax.rsqrt(jnp.sum(latent**2, axis=-1, keepdims=True) + 1e-12)

    @functools.cached_property
    def _eye(self) -> Eye:
        return Eye(self.spec, self.hidden, self.config, self.config.compute_dtype)

    @functools.cached_property
    def _latent(self) -> Layers:
        return Layers(self.hidden, 0, self.latent, self.config.compute_dtype)


@dataclasses.dataclass(frozen=True)
class InverseModel:
    """Tells the action from phi(o) and phi(o'), by which an embedding is learned.

    Pathak et al. 2017. It keeps what actions change, and has no use for the rest.

    Attributes:
        embedding: phi.
        actions: their number, `A`.
        layers: number of hidden layers, as wide as the image features.
    """

    embedding: Embedding
    actions: int
    layers: int

    def init(self, key: jax.Array) -> Any:
        """Draw the parameters."""
        pair = jnp.zeros((1, 2 * self.embedding.latent), self.embedding.config.compute_dtype)
        return self._inverse.init(key, pair)

    def logits(self, params: Any, before: jax.Array, after: jax.Array) -> jax.Array:
        """float32[T, N, A], of the action between two embeddings."""
        dtype = self.embedding.config.compute_dtype
        pair = jnp.concatenate([before, after], axis=-1).astype(dtype)
        return self._inverse.apply(params, pair).astype(jnp.float32)

    @functools.cached_property
    def _inverse(self) -> Layers:
        phi = self.embedding
        return Layers(phi.hidden, self.layers, self.actions, phi.config.compute_dtype)


def inverse_loss(
    name: str, logits: jax.Array, action: jax.Array, wanted: jax.Array
) -> tuple[jax.Array, Metrics]:
    """Cross-entropy of the actions taken, over the steps that are wanted.

    Args:
        name: the metrics' prefix.
        logits: float32[T, N, A].
        action: int32[T, N].
        wanted: bool[T, N].
    """
    right = jnp.argmax(logits, axis=-1).astype(action.dtype) == action
    loss = mean(-log_prob(logits, action), wanted)
    return loss, {
        f"{name}_inverse_loss": loss,
        f"{name}_inverse_accuracy": mean(right.astype(jnp.float32), wanted),
    }


def mean(values: jax.Array, wanted: jax.Array) -> jax.Array:
    """float32[], the mean of the values that are wanted; 0 if none is."""
    return jnp.sum(jnp.where(wanted, values, 0)) / number(wanted)


def number(wanted: jax.Array) -> jax.Array:
    """float32[], how many are wanted, at least 1."""
    return jnp.maximum(jnp.sum(wanted), 1).astype(jnp.float32)


def train(
    name: str,
    key: jax.Array,
    config: Config,
    hparams: HParams,
    rate: jax.Array,
    loss: Callable[[Any, Any], tuple[jax.Array, Metrics]],
    data: Any,
    params: Any,
    adam: Any,
) -> tuple[Any, Any, Metrics]:
    """Train networks of a bonus on a rollout, for `bonus_epochs`.

    Args:
        name: the metrics' prefix.
        key: of the shuffles.
        config: epochs and minibatches.
        hparams: the norm that gradients are clipped to.
        rate: learning rate.
        loss: of (params, the part of `data` of some environments): float32[] and metrics.
        data: leaves [T, N, ...].
        params: what is trained.
        adam: state of `optimiser`.

    Returns:
        Parameters, optimiser state, and means of the metrics over all minibatches.
    """

    def body(carry: Any, environments: jax.Array) -> tuple[Any, Metrics]:
        params, adam = carry
        part = take(data, environments, 1)
        gradients, metrics = jax.grad(loss, has_aux=True)(params, part)
        params, adam, size = optimiser.step(gradients, adam, params, rate, hparams.gradient_norm)
        return (params, adam), metrics | {f"{name}_gradient_norm": size}

    (params, adam), metrics = passes(key, config, config.bonus_epochs, body, (params, adam))
    return params, adam, metrics
