"""The intrinsic curiosity module (Pathak et al. 2017): the error in predicting what follows."""

# flax' `apply` is typed as if it might return variables as well, which ours never do.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportReturnType=false

from __future__ import annotations

import dataclasses
import functools
from typing import Any

import jax
import jax.numpy as jnp

from ...fields import number
from ...pytree import PyTreeNode
from ..learning import optimiser
from ..learning.algorithms import BonusNumbers, BonusSettings
from ..learning.bonus import Experience, Metrics
from ..learning.config import Config
from ..learning.hparams import HParams
from ..learning.observations import ObservationSpec
from .parts import Embedding, InverseModel, Layers, inverse_loss, mean, train


@dataclasses.dataclass(frozen=True, kw_only=True)
class ICMSettings(BonusSettings):
    """Static settings of ICM.

    Attributes:
        icm_latent: size of ICM's embedding.
        icm_hidden: width of the hidden layers of ICM's two models.
        icm_layers: their number.
        icm_forward_trains_encoder: let the forward model's loss train the embedding too, as in
            the original; if false the inverse model alone does.
    """

    icm_latent: int = number(128, 1)
    icm_hidden: int = number(256, 1)
    icm_layers: int = number(2, 1)
    icm_forward_trains_encoder: bool = False


class ICMNumbers(BonusNumbers):
    """Numbers of ICM.

    Attributes:
        icm_inverse: coefficient of the inverse model's loss.
        icm_forward: coefficient of the forward model's loss.
    """

    icm_inverse: Any = number(1.0, 0)
    icm_forward: Any = number(1.0, 0)


class ICMState(PyTreeNode):
    """The state of ICM.

    Attributes:
        params: of the embedding, the inverse and the forward model.
        optimiser: state of their Adam.
    """

    params: Any
    optimiser: Any


@dataclasses.dataclass(frozen=True)
class ICM:
    """The bonus mean_j (phi_j(o') - chi_j(phi(o), a))^2.

    The forward model chi learns to predict phi(o'), an embedding that an `InverseModel` trains. The
    bonus is added to the reward, or has a value of its own.

    Attributes:
        spec: what observations are.
        actions: their number.
        config: with `ICMSettings`.
    """

    spec: ObservationSpec
    actions: int
    config: Config

    @property
    def value_heads(self) -> int:
        """One value, or with `bonus_values` two."""
        return 1 + self.config.bonus_values

    def init(self, key: jax.Array) -> ICMState:
        """Draw the networks."""
        eye, latent, inverse, forward = jax.random.split(key, 4)
        width = self._settings.icm_latent + self.actions
        inputs = jnp.zeros((1, width), self.config.compute_dtype)
        params = self._embedding.init(eye, latent) | {
            "inverse": self._inverse.init(inverse),
            "forward": self._forward.init(forward, inputs),
        }
        return ICMState(params, optimiser.init(params))

    def reward(
        self, state: ICMState, hparams: HParams, experience: Experience
    ) -> tuple[jax.Array, ICMState, Metrics]:
        """The forward model's error."""
        latent = self._embedding.embed(state.params, experience.obs)
        error = self.forward_error(state.params, latent, experience.action)
        return error, state, {"icm_error": jnp.mean(error)}

    def update(
        self,
        key: jax.Array,
        state: ICMState,
        hparams: HParams,
        experience: Experience,
        rate: jax.Array,
    ) -> tuple[ICMState, Metrics]:
        """Train all three networks, ends of episodes left out."""
        numbers = hparams.bonus_as(ICMNumbers)

        def loss(params: Any, part: Experience) -> tuple[jax.Array, Metrics]:
            latent, wanted = self._embedding.embed(params, part.obs), ~part.ended
            logits = self._inverse.logits(params["inverse"], latent[:-1], latent[1:])
            inverse, metrics = inverse_loss("icm", logits, part.action, wanted)
            forward = mean(self.forward_error(params, latent, part.action), wanted)
            total = numbers.icm_inverse * inverse + numbers.icm_forward * forward
            return total, metrics | {"icm_forward_loss": forward}

        params, adam, metrics = train(
            "icm", key, self.config, hparams, rate, loss, experience, state.params, state.optimiser
        )
        return ICMState(params, adam), metrics

    def forward_error(self, params: Any, latent: jax.Array, action: jax.Array) -> jax.Array:
        """float32[T, N], of embeddings [T + 1, N] and actions int32[T, N].

        Unless `icm_forward_trains_encoder`, it has no gradient in the embeddings.
        """
        if not self._settings.icm_forward_trains_encoder:
            latent = jax.lax.stop_gradient(latent)
        taken = jax.nn.one_hot(action, self.actions, dtype=latent.dtype)
        inputs = jnp.concatenate([latent[:-1], taken], axis=-1)
        predicted = self._forward.apply(params["forward"], inputs)
        error = predicted.astype(jnp.float32) - latent[1:].astype(jnp.float32)
        return jnp.mean(error**2, axis=-1)

    @property
    def _settings(self) -> ICMSettings:
        return self.config.bonus_as(ICMSettings)

    @functools.cached_property
    def _embedding(self) -> Embedding:
        own = self._settings
        return Embedding(
            spec=self.spec, config=self.config, hidden=own.icm_hidden, latent=own.icm_latent
        )

    @functools.cached_property
    def _inverse(self) -> InverseModel:
        return InverseModel(self._embedding, self.actions, self._settings.icm_layers)

    @functools.cached_property
    def _forward(self) -> Layers:
        own = self._settings
        return Layers(own.icm_hidden, own.icm_layers, own.icm_latent, self.config.compute_dtype)
