"""Elliptical episodic bonuses (Henaff et al. 2022): how new a step is to its episode."""

from __future__ import annotations

import dataclasses
import functools
from typing import Any, Literal

import jax
import jax.numpy as jnp

from ...fields import choice, number
from ...pytree import PyTreeNode
from ..learning import optimiser
from ..learning.algorithms import BonusNumbers, BonusSettings
from ..learning.axes import PER_ENVIRONMENT
from ..learning.bonus import Experience, Metrics
from ..learning.config import Config
from ..learning.hparams import HParams
from ..learning.observations import ObservationSpec
from .parts import Embedding, InverseModel, inverse_loss, train
from .temporal import drawn_offsets, temporal_loss

Learned = Literal["inverse", "temporal"]


@dataclasses.dataclass(frozen=True, kw_only=True)
class E3BSettings(BonusSettings):
    """Static settings of E3B.

    Attributes:
        e3b_embedding: what E3B's embedding learns: `"inverse"`: to tell the action between two
            steps, as in Henaff et al.; `"temporal"`: to tell steps that are near in time from
            others.
        e3b_reach: how many steps apart is near, at most, for `"temporal"`.
        e3b_latent: size of the embedding.
        e3b_hidden: width of its image features, and of the hidden layers of the inverse model.
        e3b_layers: the number of these.
    """

    e3b_embedding: Learned = choice("inverse", Learned)
    e3b_reach: int = number(8, 1)
    e3b_latent: int = number(32, 1)
    e3b_hidden: int = number(256, 1)
    e3b_layers: int = number(2, 1)


class E3BNumbers(BonusNumbers):
    """Numbers of E3B.

    Attributes:
        e3b_lambda: weight of the ridge that E3B's matrix begins an episode with.
    """

    e3b_lambda: Any = number(0.1, above=0)


class E3BState(PyTreeNode):
    """The state of E3B.

    Attributes:
        params: of the embedding and, where there is one, the inverse model.
        optimiser: state of their Adam.
        inverse: float32[N, L, L], lambda C^-1 of the episodes that go on.
    """

    params: Any
    optimiser: Any
    inverse: jax.Array = dataclasses.field(metadata=PER_ENVIRONMENT)


@dataclasses.dataclass(frozen=True)
class E3B:
    """The bonus phi^T C^-1 phi, where C = lambda I + the episode's phi phi^T before this step.

    phi is an embedding of what a step led to, of length one: with free lengths, which grow while
    it learns, only the first steps of episodes would count. The first observation of an episode
    counts as seen. The bonus is added to the reward, or has a value of its own.

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
        eye, latent, inverse_key = jax.random.split(key, 3)
        params = self._embedding.init(eye, latent)
        if not self._temporal:
            params |= {"inverse": self._inverse.init(inverse_key)}
        start = jnp.eye(self._embedding.latent, dtype=jnp.float32)
        inverse = jnp.repeat(start[None], self.config.num_envs, axis=0)
        return E3BState(params, optimiser.init(params), inverse)

    def reward(
        self, state: E3BState, hparams: HParams, experience: Experience
    ) -> tuple[jax.Array, E3BState, Metrics]:
        """Go through the rollout, with the inverse updated as of Sherman and Morrison."""
        ridge = hparams.bonus_as(E3BNumbers).e3b_lambda
        start = jnp.eye(self._embedding.latent, dtype=jnp.float32)

        def step(inverse: jax.Array, inputs: Any) -> tuple[jax.Array, jax.Array]:
            phi, ended = inputs
            # What a step that ended an episode led to begins the next one.
            inverse = jnp.where(ended[:, None, None], start, inverse)
            # A sum of products: a matrix product may be of less precision on an accelerator.
            u = jnp.sum(inverse * phi[:, None], axis=-1)
            bonus = jnp.sum(phi * u, axis=-1)
            change = u[:, :, None] * (u / (ridge + bonus)[:, None])[:, None]
            return inverse - change, bonus / ridge

        phi = self._embedding.embed(state.params, experience.led_to)
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
        """Train the embedding, ends of episodes left out."""
        # A seed means what it did before there was another embedding.
        pass_key, offset_key = jax.random.split(key) if self._temporal else (key, key)
        offsets = drawn_offsets(offset_key, experience.action.shape, self._settings.e3b_reach)

        def loss(params: Any, part: tuple[Experience, jax.Array]) -> tuple[jax.Array, Metrics]:
            seen, offset = part
            phi = self._embedding.embed(params, seen.obs)
            if self._temporal:
                return temporal_loss("e3b", phi, seen.ended, offset)
            logits = self._inverse.logits(params["inverse"], phi[:-1], phi[1:])
            return inverse_loss("e3b", logits, seen.action, ~seen.ended)

        params, adam, metrics = train(
            "e3b", pass_key, self.config, hparams, rate, loss, (experience, offsets),
            state.params, state.optimiser,
        )  # fmt: skip
        return state.replace(params=params, optimiser=adam), metrics

    @property
    def _settings(self) -> E3BSettings:
        return self.config.bonus_as(E3BSettings)

    @property
    def _temporal(self) -> bool:
        return self._settings.e3b_embedding == "temporal"

    @functools.cached_property
    def _embedding(self) -> Embedding:
        own = self._settings
        return Embedding(
            spec=self.spec, config=self.config, hidden=own.e3b_hidden, latent=own.e3b_latent,
            unit=True,
        )  # fmt: skip

    @functools.cached_property
    def _inverse(self) -> InverseModel:
        return InverseModel(self._embedding, self.actions, self._settings.e3b_layers)
