"""Random network distillation (Burda et al. 2018): the error of predicting a random network."""

# By its type, flax' `apply` may also return variables; ours never does.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportReturnType=false

from __future__ import annotations

import dataclasses
import functools
from typing import Any

import jax
import jax.numpy as jnp

from ...fields import number
from ...pytree import PyTreeNode
from .. import optimiser
from ..bonus import Experience, Metrics
from ..config import Config, HParams
from ..networks import ImageEncoder
from ..observations import ObservationSpec
from .parts import Layers, count_of


@dataclasses.dataclass(frozen=True, kw_only=True)
class RNDOptions:
    """The options of RND.

    Attributes:
        rnd_hidden: width of RND's hidden layers.
        rnd_output: size of RND's embedding.
        rnd_layers: number of RND's hidden layers after the image features.
        rnd_loss: coefficient of RND's loss.
    """

    rnd_hidden: int = number(128, 1)
    rnd_output: int = number(128, 1)
    rnd_layers: int = number(2, 1)
    rnd_loss: Any = number(0.1, 0)


class RNDState(PyTreeNode):
    """The state of RND.

    Attributes:
        target: parameters of the random network; never trained.
        predictor: parameters of the network that learns to predict it.
        optimiser: state of the predictor's Adam.
    """

    target: Any
    predictor: Any
    optimiser: Any


@dataclasses.dataclass(frozen=True)
class RND:
    """The bonus e(o) = mean_j (g_j(o) - f_j(o))^2 of the observation after a step.

    Target f and predictor g are networks of the same shape. The bonus has a separate value head,
    whose returns continue across the ends of episodes.

    Attributes:
        spec: the arrays of an observation.
        actions: number of actions; not used.
        config: contains the settings of `RNDOptions`.
    """

    spec: ObservationSpec
    actions: int
    config: Config
    value_heads: int = 2

    def init(self, key: jax.Array) -> RNDState:
        """Initialise both networks."""
        target_key, predictor_key = jax.random.split(key)
        predictor = self._init_network(predictor_key)
        return RNDState(self._init_network(target_key), predictor, optimiser.init(predictor))

    def reward(
        self, state: RNDState, hparams: HParams, experience: Experience
    ) -> tuple[jax.Array, RNDState, Metrics]:
        """Compute the bonus of a rollout."""
        error = self.error(state, experience.led_to)
        return error, state, {"rnd_error": jnp.mean(error)}

    def update(
        self,
        key: jax.Array,
        state: RNDState,
        hparams: HParams,
        experience: Experience,
        rate: jax.Array,
    ) -> tuple[RNDState, Metrics]:
        """Train the predictor on the observations after steps that did not end an episode."""
        weight = hparams.bonus["rnd_loss"]
        # Another derivation of this key would change published results.
        pass_key, _ = jax.random.split(key)

        def loss(predictor: Any, part: Any) -> tuple[jax.Array, Metrics]:
            obs, wanted = part
            error = self.error(state.replace(predictor=predictor), obs)
            value = weight * jnp.sum(jnp.where(wanted, error, 0)) / count_of(wanted)
            return value, {"rnd_loss": value}

        predictor, adam, metrics = optimiser.train(
            pass_key, self.config, self.config.bonus_epochs, loss,
            (experience.led_to, ~experience.ended), (state.predictor, state.optimiser),
            rate, hparams.gradient_norm, "rnd_",
        )  # fmt: skip
        return state.replace(predictor=predictor, optimiser=adam), metrics

    def error(self, state: RNDState, obs: Any) -> jax.Array:
        """The error e, float32[T, N], of observations with leading axes [T, N]."""

        def embed(params: Any) -> jax.Array:
            features = self._encoder.encode_sequence(params["encoder"], obs)
            return self._layers.apply(params["embedding"], features).astype(jnp.float32)

        target = jax.lax.stop_gradient(embed(state.target))
        return jnp.mean((embed(state.predictor) - target) ** 2, axis=-1)

    def _init_network(self, key: jax.Array) -> dict[str, Any]:
        encoder_key, embedding_key = jax.random.split(key)
        features = jnp.zeros((1, self.config.bonus["rnd_hidden"]), self.config.compute_dtype)
        return {
            "encoder": self._encoder.init(encoder_key),
            "embedding": self._layers.init(embedding_key, features),
        }

    @functools.cached_property
    def _encoder(self) -> ImageEncoder:
        config = self.config
        return ImageEncoder(self.spec, config.bonus["rnd_hidden"], config, config.compute_dtype)

    @functools.cached_property
    def _layers(self) -> Layers:
        own = self.config.bonus
        return Layers(
            own["rnd_hidden"], own["rnd_layers"], own["rnd_output"], self.config.compute_dtype
        )
