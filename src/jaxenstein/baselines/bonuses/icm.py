"""The intrinsic curiosity module (Pathak et al. 2017): the error of predicting the next step."""

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
from ..observations import ObservationSpec
from .parts import Embedding, Layers, mean


@dataclasses.dataclass(frozen=True, kw_only=True)
class ICMOptions:
    """The options of ICM.

    Attributes:
        icm_latent: size of ICM's embedding.
        icm_hidden: width of ICM's image features, and of the hidden layers of its two models.
        icm_layers: number of hidden layers of each of ICM's models.
        icm_forward_trains_encoder: let the loss of ICM's forward model also train the embedding, as
            in the original; if false, only the inverse model does.
        icm_inverse: coefficient of the loss of ICM's inverse model.
        icm_forward: coefficient of the loss of ICM's forward model.
    """

    icm_latent: int = number(128, 1)
    icm_hidden: int = number(256, 1)
    icm_layers: int = number(2, 1)
    icm_forward_trains_encoder: bool = False
    icm_inverse: Any = number(1.0, 0)
    icm_forward: Any = number(1.0, 0)


class ICMState(PyTreeNode):
    """The state of ICM.

    Attributes:
        params: parameters of the embedding, the inverse model and the forward model.
        optimiser: their Adam state.
    """

    params: Any
    optimiser: Any


@dataclasses.dataclass(frozen=True)
class ICM:
    """The bonus mean_j (phi_j(o') - chi_j(phi(o), a))^2.

    The forward model chi predicts phi(o'). phi is an `Embedding`, trained by an inverse model. The
    bonus is added to the reward, or has a separate value head.

    Attributes:
        spec: the arrays of an observation.
        actions: number of actions.
        config: contains the settings of `ICMOptions`.
    """

    spec: ObservationSpec
    actions: int
    config: Config

    @property
    def value_heads(self) -> int:
        """1, or 2 with `bonus_values`."""
        return 1 + self.config.bonus_values

    def init(self, key: jax.Array) -> ICMState:
        """Initialise the networks."""
        encoder, latent, inverse, forward = jax.random.split(key, 4)
        width = self._embedding.latent + self.actions
        inputs = jnp.zeros((1, width), self.config.compute_dtype)
        params = self._embedding.init(encoder, latent, inverse)
        params["forward"] = self._forward.init(forward, inputs)
        return ICMState(params, optimiser.init(params))

    def reward(
        self, state: ICMState, hparams: HParams, experience: Experience
    ) -> tuple[jax.Array, ICMState, Metrics]:
        """Compute the error of the forward model."""
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
        """Train all three networks; steps that end an episode are left out."""
        weights = hparams.bonus

        def loss(params: Any, part: Experience) -> tuple[jax.Array, Metrics]:
            latent, wanted = self._embedding.embed(params, part.obs), ~part.ended
            inverse, metrics = self._embedding.inverse_loss(
                "icm", params, latent, part.action, wanted
            )
            forward = mean(self.forward_error(params, latent, part.action), wanted)
            total = weights["icm_inverse"] * inverse + weights["icm_forward"] * forward
            return total, metrics | {"icm_forward_loss": forward}

        params, adam, metrics = optimiser.train(
            key, self.config, self.config.bonus_epochs, loss, experience,
            (state.params, state.optimiser), rate, hparams.gradient_norm, "icm_",
        )  # fmt: skip
        return ICMState(params, adam), metrics

    def forward_error(self, params: Any, latent: jax.Array, action: jax.Array) -> jax.Array:
        """The error float32[T, N] for embeddings [T + 1, N] and actions int32[T, N].

        It has no gradient in the embeddings unless `icm_forward_trains_encoder` is set.
        """
        if not self.config.bonus["icm_forward_trains_encoder"]:
            latent = jax.lax.stop_gradient(latent)
        taken = jax.nn.one_hot(action, self.actions, dtype=latent.dtype)
        inputs = jnp.concatenate([latent[:-1], taken], axis=-1)
        predicted = self._forward.apply(params["forward"], inputs)
        error = predicted.astype(jnp.float32) - latent[1:].astype(jnp.float32)
        return jnp.mean(error**2, axis=-1)

    @functools.cached_property
    def _embedding(self) -> Embedding:
        own = self.config.bonus
        return Embedding(
            spec=self.spec, actions=self.actions, config=self.config, hidden=own["icm_hidden"],
            layers=own["icm_layers"], latent=own["icm_latent"],
        )  # fmt: skip

    @functools.cached_property
    def _forward(self) -> Layers:
        own = self.config.bonus
        return Layers(
            own["icm_hidden"], own["icm_layers"], own["icm_latent"], self.config.compute_dtype
        )
