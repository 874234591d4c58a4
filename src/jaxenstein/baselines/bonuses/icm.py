"""The intrinsic curiosity module (Pathak et al. 2017): the error in predicting what follows."""

# flax' `apply` is typed as if it might return variables as well, which ours never do.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportReturnType=false

from __future__ import annotations

import dataclasses
import functools
from typing import Any

import flax.linen as nn
import jax
import jax.numpy as jnp

from ...pytree import PyTreeNode
from ..learning import optimiser
from ..learning.bonus import BonusScale, Experience, Metrics, initial_scale, scaled
from ..learning.config import Config, HParams
from ..learning.minibatches import passes, take
from ..learning.networks import Eye, dense
from ..learning.observations import ObservationSpec
from ..learning.rollout import log_prob
from .rnd import Embedding


class ICMState(PyTreeNode):
    """The state of ICM.

    Attributes:
        params: of the embedding, the inverse and the forward model.
        optimiser: state of their Adam.
        scale: of the bonus; only used with `normalise_bonus`.
    """

    params: Any
    optimiser: Any
    scale: BonusScale


class Latent(nn.Module):
    """The last layer of the embedding."""

    size: int
    dtype: Any

    @nn.compact
    def __call__(self, features: jax.Array) -> jax.Array:
        """Return dtype[..., size]."""
        return dense(self.size, 1.0, self.dtype)(features)


class Losses(PyTreeNode):
    """The models' errors at each step; leading axes [T, N].

    Attributes:
        inverse: float32, cross-entropy of the action taken.
        right: bool, whether the most likely action is the one taken.
        forward: float32, mean squared error of the predicted embedding.
    """

    inverse: jax.Array
    right: jax.Array
    forward: jax.Array


@dataclasses.dataclass(frozen=True)
class ICM:
    """The bonus mean_j (phi_j(o') - chi_j(phi(o), a))^2; 0 where a step ended its episode.

    An inverse model learns to tell the action from phi(o) and phi(o'), and with it the
    embedding phi; the forward model chi learns to predict phi(o'). The bonus is added to the
    reward.

    Attributes:
        spec: what observations are.
        actions: their number.
        config: sizes and switches.
    """

    spec: ObservationSpec
    actions: int
    config: Config
    value_heads: int = 1

    def init(self, key: jax.Array) -> ICMState:
        """Draw the networks."""
        config = self.config
        eye, latent, inverse, forward = jax.random.split(key, 4)
        embedding = jnp.zeros((1, config.icm_latent), config.compute_dtype)
        features = jnp.zeros((1, config.icm_hidden), config.compute_dtype)
        action = jnp.zeros((1, self.actions), config.compute_dtype)
        params = {
            "encoder": self._eye.init(eye),
            "latent": self._latent.init(latent, features),
            "inverse": self._inverse.init(inverse, jnp.concatenate([embedding] * 2, axis=-1)),
            "forward": self._forward.init(forward, jnp.concatenate([embedding, action], axis=-1)),
        }
        return ICMState(params, optimiser.init(params), initial_scale(config.num_envs))

    def reward(
        self, state: ICMState, hparams: HParams, experience: Experience
    ) -> tuple[jax.Array, ICMState, Metrics]:
        """Compute the bonus of a rollout."""
        losses = self.losses(state.params, experience.obs, experience.action)
        bonus = jnp.where(experience.ended, 0, losses.forward)
        if self.config.normalise_bonus:
            bonus, scale = scaled(bonus, state.scale, hparams.bonus_gamma)
            state = state.replace(scale=scale)
        return hparams.bonus_reward * bonus, state, {"icm_error": jnp.mean(losses.forward)}

    def update(
        self,
        key: jax.Array,
        state: ICMState,
        hparams: HParams,
        experience: Experience,
        rate: jax.Array,
    ) -> tuple[ICMState, Metrics]:
        """Train all three networks, ends of episodes left out."""
        data = (experience.obs, experience.action, ~experience.ended)

        def body(carry: Any, environments: jax.Array) -> tuple[Any, Metrics]:
            params, adam = carry
            obs, action, wanted = take(data, environments, 1)

            def loss(params: Any) -> tuple[jax.Array, Metrics]:
                losses = self.losses(params, obs, action)
                number = jnp.maximum(jnp.sum(wanted), 1).astype(jnp.float32)
                inverse = jnp.sum(jnp.where(wanted, losses.inverse, 0)) / number
                forward = jnp.sum(jnp.where(wanted, losses.forward, 0)) / number
                right = jnp.sum(jnp.where(losses.right & wanted, 1.0, 0.0))
                total = hparams.icm_inverse * inverse + hparams.icm_forward * forward
                return total, {
                    "icm_inverse_loss": inverse,
                    "icm_inverse_accuracy": right / number,
                    "icm_forward_loss": forward,
                }

            gradients, metrics = jax.grad(loss, has_aux=True)(params)
            params, adam, size = optimiser.step(
                gradients, adam, params, rate, hparams.gradient_norm
            )
            return (params, adam), metrics | {"icm_gradient_norm": size}

        (params, adam), metrics = passes(
            key, self.config, self.config.bonus_epochs, body, (state.params, state.optimiser)
        )
        return state.replace(params=params, optimiser=adam), metrics

    def losses(self, params: Any, obs: Any, action: jax.Array) -> Losses:
        """Errors of the models; `obs` [T + 1, N], `action` int32[T, N].

        Unless `icm_forward_trains_encoder`, the forward error has no gradient in the embedding.
        """
        features = self._eye.encode_sequence(params["encoder"], obs)
        latent = self._latent.apply(params["latent"], features)
        before, after = latent[:-1], latent[1:]
        logits = self._inverse.apply(
            params["inverse"], jnp.concatenate([before, after], axis=-1)
        ).astype(jnp.float32)
        if not self.config.icm_forward_trains_encoder:
            before, after = jax.lax.stop_gradient((before, after))
        taken = jax.nn.one_hot(action, self.actions, dtype=before.dtype)
        predicted = self._forward.apply(
            params["forward"], jnp.concatenate([before, taken], axis=-1)
        )
        error = predicted.astype(jnp.float32) - after.astype(jnp.float32)
        return Losses(
            inverse=-log_prob(logits, action),
            right=jnp.argmax(logits, axis=-1).astype(action.dtype) == action,
            forward=jnp.mean(error**2, axis=-1),
        )

    @functools.cached_property
    def _eye(self) -> Eye:
        config = self.config
        return Eye(self.spec, config.icm_hidden, config, config.compute_dtype)

    @functools.cached_property
    def _latent(self) -> Latent:
        return Latent(self.config.icm_latent, self.config.compute_dtype)

    @functools.cached_property
    def _inverse(self) -> Embedding:
        config = self.config
        return Embedding(config.icm_hidden, config.icm_layers, self.actions, config.compute_dtype)

    @functools.cached_property
    def _forward(self) -> Embedding:
        config = self.config
        return Embedding(
            config.icm_hidden, config.icm_layers, config.icm_latent, config.compute_dtype
        )
