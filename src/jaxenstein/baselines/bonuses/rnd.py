"""Random network distillation (Burda et al. 2018): the error in predicting a random network."""

# flax' `apply` is typed as if it might return variables as well, which ours never do.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportReturnType=false

from __future__ import annotations

import dataclasses
import functools
from typing import Any

import jax
import jax.numpy as jnp

from ... import fields
from ...pytree import PyTreeNode
from ..learning import optimiser
from ..learning.algorithms import BonusNumbers, BonusSettings
from ..learning.bonus import Experience, Metrics
from ..learning.config import Config
from ..learning.hparams import HParams
from ..learning.networks import Eye
from ..learning.observations import ObservationSpec
from .parts import Layers, number, train


@dataclasses.dataclass(frozen=True, kw_only=True)
class RNDSettings(BonusSettings):
    """Static settings of RND.

    Attributes:
        rnd_hidden: width of RND's hidden layers.
        rnd_output: size of RND's embedding.
        rnd_layers: number of RND's hidden layers behind its image features.
    """

    rnd_hidden: int = fields.number(128, 1)
    rnd_output: int = fields.number(128, 1)
    rnd_layers: int = fields.number(2, 1)


class RNDNumbers(BonusNumbers):
    """Numbers of RND.

    Attributes:
        rnd_loss: coefficient of RND's loss.
    """

    rnd_loss: Any = fields.number(0.1, 0)


class RNDState(PyTreeNode):
    """The state of RND.

    Attributes:
        target: parameters of the random network; never trained.
        predictor: parameters of the one that learns to predict it.
        optimiser: state of the predictor's Adam.
    """

    target: Any
    predictor: Any
    optimiser: Any


@dataclasses.dataclass(frozen=True)
class RND:
    """The bonus e(o) = mean_j (g_j(o) - f_j(o))^2 of what a step led to.

    Target f and predictor g are networks of the same shape. The bonus has returns of its own,
    which go on through the ends of episodes.

    Attributes:
        spec: what observations are.
        actions: their number, which it has no use for.
        config: with `RNDSettings`.
    """

    spec: ObservationSpec
    actions: int
    config: Config
    value_heads: int = 2

    def init(self, key: jax.Array) -> RNDState:
        """Draw both networks."""
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
        """Train the predictor on what the steps led to, ends left out."""
        weight = hparams.bonus_as(RNDNumbers).rnd_loss
        # A seed means what it did when a second key was drawn with this one.
        pass_key, _ = jax.random.split(key)
        data = (experience.led_to, ~experience.ended)

        def loss(predictor: Any, part: Any) -> tuple[jax.Array, Metrics]:
            obs, wanted = part
            error = self.error(state.replace(predictor=predictor), obs)
            value = weight * jnp.sum(jnp.where(wanted, error, 0)) / number(wanted)
            return value, {"rnd_loss": value}

        predictor, adam, metrics = train(
            "rnd", pass_key, self.config, hparams, rate, loss, data, state.predictor,
            state.optimiser,
        )  # fmt: skip
        return state.replace(predictor=predictor, optimiser=adam), metrics

    def error(self, state: RNDState, obs: Any) -> jax.Array:
        """float32[T, N], e of observations with leading axes [T, N]."""

        def embed(params: Any) -> jax.Array:
            features = self._eye.encode_sequence(params["encoder"], obs)
            return self._layers.apply(params["embedding"], features).astype(jnp.float32)

        target = jax.lax.stop_gradient(embed(state.target))
        return jnp.mean((embed(state.predictor) - target) ** 2, axis=-1)

    def _init_network(self, key: jax.Array) -> dict[str, Any]:
        encoder_key, embedding_key = jax.random.split(key)
        features = jnp.zeros((1, self._settings.rnd_hidden), self.config.compute_dtype)
        return {
            "encoder": self._eye.init(encoder_key),
            "embedding": self._layers.init(embedding_key, features),
        }

    @property
    def _settings(self) -> RNDSettings:
        return self.config.bonus_as(RNDSettings)

    @functools.cached_property
    def _eye(self) -> Eye:
        config = self.config
        return Eye(self.spec, self._settings.rnd_hidden, config, config.compute_dtype)

    @functools.cached_property
    def _layers(self) -> Layers:
        own = self._settings
        return Layers(own.rnd_hidden, own.rnd_layers, own.rnd_output, self.config.compute_dtype)
