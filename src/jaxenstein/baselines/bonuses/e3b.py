"""Elliptical episodic bonuses (Henaff et al. 2022): how new a step is to its episode."""

from __future__ import annotations

import dataclasses
import functools
from typing import Any

import jax
import jax.numpy as jnp

from ...pytree import PyTreeNode
from ..learning import optimiser
from ..learning.algorithms import BonusNumbers, BonusSettings
from ..learning.axes import PER_ENVIRONMENT
from ..learning.bonus import Experience, Metrics
from ..learning.config import Config
from ..learning.fields import positive
from ..learning.hparams import HParams
from ..learning.observations import ObservationSpec
from .parts import InverseModel, inverse_loss, train


@dataclasses.dataclass(frozen=True, kw_only=True)
class E3BSettings(BonusSettings):
    """Static settings of E3B.

    Attributes:
        e3b_latent: size of E3B's embedding.
        e3b_hidden: width of the hidden layers of its inverse model.
        e3b_layers: their number.
    """

    e3b_latent: int = 32
    e3b_hidden: int = 256
    e3b_layers: int = 2


class E3BNumbers(BonusNumbers):
    """Numbers of E3B.

    Attributes:
        e3b_lambda: weight of the ridge that E3B's matrix begins an episode with.
    """

    e3b_lambda: Any = positive(0.1)


class E3BState(PyTreeNode):
    """The state of E3B.

    Attributes:
        params: of the embedding and the inverse model.
        optimiser: state of their Adam.
        inverse: float32[N, L, L], lambda C^-1 of the episodes that go on.
    """

    params: Any
    optimiser: Any
    inverse: jax.Array = dataclasses.field(metadata=PER_ENVIRONMENT)


@dataclasses.dataclass(frozen=True)
class E3B:
    """The bonus phi^T C^-1 phi, where C = lambda I + the episode's phi phi^T before this step.

    phi is the embedding of what a step led to, by an `InverseModel`, of length one: with free
    lengths, which grow while it learns, only the first steps of episodes would count. The bonus
    is added to the reward, or has a value of its own.

    Attributes:
        spec: what observations are.
        actions: their number.
        config: with `E3BSettings`.
    """

    spec: ObservationSpec
    actions: int
    config: Config

    @property
    def value_heads(self) -> int:
        """One value, or with `bonus_values` two."""
        return 1 + self.config.bonus_values

    def init(self, key: jax.Array) -> E3BState:
        """Draw the networks; every environment begins an episode."""
        params = self._model.init(*jax.random.split(key, 3))
        start = jnp.eye(self._model.latent, dtype=jnp.float32)
        inverse = jnp.repeat(start[None], self.config.num_envs, axis=0)
        return E3BState(params, optimiser.init(params), inverse)

    def reward(
        self, state: E3BState, hparams: HParams, experience: Experience
    ) -> tuple[jax.Array, E3BState, Metrics]:
        """Go through the rollout, with the inverse updated as of Sherman and Morrison."""
        ridge = hparams.bonus_as(E3BNumbers).e3b_lambda
        start = jnp.eye(self._model.latent, dtype=jnp.float32)

        def step(inverse: jax.Array, inputs: Any) -> tuple[jax.Array, jax.Array]:
            phi, ended = inputs
            # A sum of products: a matrix product may be of less precision on an accelerator.
            u = jnp.sum(inverse * phi[:, None], axis=-1)
            bonus = jnp.sum(phi * u, axis=-1)
            change = u[:, :, None] * (u / (ridge + bonus)[:, None])[:, None]
            return jnp.where(ended[:, None, None], start, inverse - change), bonus / ridge

        phi = self._model.embed(state.params, experience.led_to)
        inverse, bonus = jax.lax.scan(step, state.inverse, (phi, experience.ended))
        return bonus, state.replace(inverse=inverse), {"e3b_bonus": jnp.mean(bonus)}

    def update(
        self,
        key: jax.Array,
        state: E3BState,
        hparams: HParams,
        experience: Experience,
        rate: jax.Array,
    ) -> tuple[E3BState, Metrics]:
        """Train the embedding by the inverse model alone, ends of episodes left out."""

        def loss(params: Any, part: Experience) -> tuple[jax.Array, Metrics]:
            phi = self._model.embed(params, part.obs)
            logits = self._model.logits(params, phi[:-1], phi[1:])
            return inverse_loss("e3b", logits, part.action, ~part.ended)

        params, adam, metrics = train(
            "e3b", key, self.config, hparams, rate, loss, experience, state.params, state.optimiser
        )
        return state.replace(params=params, optimiser=adam), metrics

    @functools.cached_property
    def _model(self) -> InverseModel:
        own = self.config.bonus_as(E3BSettings)
        return InverseModel(
            self.spec, self.actions, self.config, own.e3b_hidden, own.e3b_layers, own.e3b_latent,
            unit=True,
        )  # fmt: skip
