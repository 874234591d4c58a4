"""Elliptical episodic bonuses (Henaff et al. 2022): how new a step is to its episode."""

from __future__ import annotations

import dataclasses
import functools
from typing import Any, Literal

import jax
import jax.numpy as jnp

from ...fields import choice, number
from ...pytree import PyTreeNode
from .. import optimiser
from ..bonus import PER_ENVIRONMENT, Experience, Metrics
from ..config import Config, HParams
from ..observations import ObservationSpec
from .parts import Embedding, mean

# The temporal loss divides inner products by this, and uses one step of so many as an anchor: with
# all steps the products would cost more than the rest of the training.
TEMPERATURE, STRIDE = 0.1, 4

Learned = Literal["inverse", "temporal"]


@dataclasses.dataclass(frozen=True, kw_only=True)
class E3BOptions:
    """The options of E3B.

    Attributes:
        e3b_embedding: what E3B's embedding learns: `"inverse"`: to predict the action between two
            steps, as in Henaff et al.; `"temporal"`: to distinguish steps that are near in time
            from others.
        e3b_reach: the largest number of steps between two that count as near, for `"temporal"`.
        e3b_latent: size of the embedding.
        e3b_hidden: width of its image features, and of the hidden layers of the inverse model.
        e3b_layers: the number of these.
        e3b_lambda: weight of the ridge in E3B's matrix at the start of an episode.
    """

    e3b_embedding: Learned = choice("inverse", Learned)
    e3b_reach: int = number(8, 1, 10**6)
    e3b_latent: int = number(32, 1)
    e3b_hidden: int = number(256, 1)
    e3b_layers: int = number(2, 1)
    e3b_lambda: Any = number(0.1, above=0)


class E3BState(PyTreeNode):
    """The state of E3B.

    Attributes:
        params: of the embedding and, where there is one, the inverse model.
        optimiser: state of their Adam.
        inverse: float32[N, L, L], lambda C^-1 of the current episodes.
    """

    params: Any
    optimiser: Any
    inverse: jax.Array = dataclasses.field(metadata=PER_ENVIRONMENT)


@dataclasses.dataclass(frozen=True)
class E3B:
    """The bonus phi^T C^-1 phi, where C = lambda I + the episode's phi phi^T before this step.

    phi is an embedding of what a step led to, of length one: with free lengths, which grow in
    training, only the first steps of episodes would count. The first observation of an episode
    counts as seen. The bonus is added to the reward, or has a value head of its own.

    Attributes:
        spec: what observations are.
        actions: their number.
        config: with the settings of `E3BOptions`.
    """

    spec: ObservationSpec
    actions: int
    config: Config

    @property
    def value_heads(self) -> int:
        """One value, or with `bonus_values` two."""
        return 1 + self.config.bonus_values

    def init(self, key: jax.Array) -> E3BState:
        """Initialise the networks; every environment begins an episode."""
        encoder, latent, inverse_key = jax.random.split(key, 3)
        inverse_key = None if self._temporal else inverse_key
        params = self._embedding.init(encoder, latent, inverse_key)
        start = jnp.eye(self._embedding.latent, dtype=jnp.float32)
        inverse = jnp.repeat(start[None], self.config.num_envs, axis=0)
        return E3BState(params, optimiser.init(params), inverse)

    def reward(
        self, state: E3BState, hparams: HParams, experience: Experience
    ) -> tuple[jax.Array, E3BState, Metrics]:
        """Scan the rollout, and update the inverse by the formula of Sherman and Morrison."""
        ridge = hparams.bonus["e3b_lambda"]
        start = jnp.eye(self._embedding.latent, dtype=jnp.float32)

        def step(inverse: jax.Array, inputs: Any) -> tuple[jax.Array, jax.Array]:
            phi, ended = inputs
            # The observation after the end of an episode is the first of the next one.
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
        """Train the embedding, without ends of episodes."""
        # Published seeds of the inverse embedding were trained without this split.
        pass_key, offset_key = jax.random.split(key) if self._temporal else (key, key)
        reach = self.config.bonus["e3b_reach"]
        offsets = sample_offsets(offset_key, experience.action.shape, reach)

        def loss(params: Any, part: tuple[Experience, jax.Array]) -> tuple[jax.Array, Metrics]:
            seen, offset = part
            phi = self._embedding.embed(params, seen.obs)
            if self._temporal:
                return temporal_loss(phi, seen.ended, offset)
            return self._embedding.inverse_loss("e3b", params, phi, seen.action, ~seen.ended)

        params, adam, metrics = optimiser.train(
            pass_key, self.config, self.config.bonus_epochs, loss, (experience, offsets),
            (state.params, state.optimiser), rate, hparams.gradient_norm, "e3b_",
        )  # fmt: skip
        return state.replace(params=params, optimiser=adam), metrics

    @property
    def _temporal(self) -> bool:
        return self.config.bonus["e3b_embedding"] == "temporal"

    @functools.cached_property
    def _embedding(self) -> Embedding:
        own = self.config.bonus
        return Embedding(
            spec=self.spec, actions=self.actions, config=self.config, hidden=own["e3b_hidden"],
            layers=own["e3b_layers"], latent=own["e3b_latent"], unit=True,
        )  # fmt: skip


def sample_offsets(key: jax.Array, shape: tuple[int, ...], reach: int) -> jax.Array:
    """int32[T, N], how far ahead of each step its neighbour is: from 1 to `reach`."""
    return jax.random.randint(key, shape, 1, reach + 1, jnp.int32)


def temporal_loss(phi: jax.Array, ended: jax.Array, offset: jax.Array) -> tuple[jax.Array, Metrics]:
    """Cross-entropy of finding a step's neighbour in time among the neighbours of other steps.

    InfoNCE (van den Oord et al. 2018) with the inner products of embeddings of length one. Steps
    whose episode ends before their neighbour are left out on both sides.

    Args:
        phi: float32[T + 1, N, L], of the observations in their order.
        ended: bool[T, N], whether the step ended its episode.
        offset: int32[T, N], as in `sample_offsets`; those beyond the last step are cut to it.
    """
    steps, number = ended.shape
    episode = jnp.concatenate([jnp.zeros((1, number), jnp.int32), jnp.cumsum(ended, 0, jnp.int32)])
    time = jnp.arange(0, steps, STRIDE, dtype=jnp.int32)[:, None]
    row = jnp.arange(number, dtype=jnp.int32)[None]
    then = jnp.minimum(time + offset[::STRIDE], steps)
    wanted = (episode[then, row] == episode[time, row]).reshape(-1)
    flat = (wanted.size, phi.shape[-1])
    now, near = phi[time, row].reshape(flat), phi[then, row].reshape(flat)
    logits = jnp.where(wanted, now @ near.T / TEMPERATURE, -1e9)
    # Equal logits share the point: an embedding that is the same for all frames tells nothing.
    best = (logits >= jnp.max(logits, axis=-1, keepdims=True)).astype(jnp.float32)
    right = jnp.diagonal(best) / jnp.sum(best, axis=-1)
    loss = mean(-jnp.diagonal(jax.nn.log_softmax(logits)), wanted)
    return loss, {"e3b_temporal_loss": loss, "e3b_temporal_accuracy": mean(right, wanted)}
