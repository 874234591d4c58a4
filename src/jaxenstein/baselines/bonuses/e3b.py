"""The elliptical episodic bonus (Henaff et al. 2022): how novel a step is within its episode."""

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

# The temporal loss divides inner products by TEMPERATURE. Only every STRIDE-th step is an anchor;
# with all steps, the products would cost more than the rest of training.
TEMPERATURE, STRIDE = 0.1, 4

Learned = Literal["inverse", "temporal"]


@dataclasses.dataclass(frozen=True, kw_only=True)
class E3BOptions:
    """The options of E3B.

    Attributes:
        e3b_embedding: how to train E3B's embedding; `"inverse"`: predict the action between two
            steps, as in Henaff et al.; `"temporal"`: tell steps that are close in time from others.
        e3b_reach: for `"temporal"`, the most steps between two steps that count as close.
        e3b_latent: size of E3B's embedding.
        e3b_hidden: width of E3B's image features, and of the hidden layers of its inverse model.
        e3b_layers: number of hidden layers of E3B's inverse model.
        e3b_lambda: ridge coefficient of E3B's matrix at the start of an episode.
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
        params: parameters of the embedding and of the inverse model, if there is one.
        optimiser: their Adam state.
        inverse: float32[N, L, L], lambda C^-1 of the current episodes.
    """

    params: Any
    optimiser: Any
    inverse: jax.Array = dataclasses.field(metadata=PER_ENVIRONMENT)


@dataclasses.dataclass(frozen=True)
class E3B:
    """The bonus phi^T C^-1 phi, where C = lambda I + the episode's phi phi^T before this step.

    phi embeds the observation after a step. It has unit length: otherwise lengths grow in training,
    and only the first steps of an episode get a bonus. The first observation of an episode counts
    as seen, except in the first episode of a training. The bonus is added to the reward, or has a
    separate value head.

    Attributes:
        spec: the arrays of an observation.
        actions: number of actions.
        config: contains the settings of `E3BOptions`.
    """

    spec: ObservationSpec
    actions: int
    config: Config

    @property
    def value_heads(self) -> int:
        """1, or 2 with `bonus_values`."""
        return 1 + self.config.bonus_values

    def init(self, key: jax.Array) -> E3BState:
        """Initialise the networks, and the matrices of new episodes."""
        encoder, latent, inverse_key = jax.random.split(key, 3)
        inverse_key = None if self._temporal else inverse_key
        params = self._embedding.init(encoder, latent, inverse_key)
        start = jnp.eye(self._embedding.latent, dtype=jnp.float32)
        inverse = jnp.repeat(start[None], self.config.num_envs, axis=0)
        return E3BState(params, optimiser.init(params), inverse)

    def reward(
        self, state: E3BState, hparams: HParams, experience: Experience
    ) -> tuple[jax.Array, E3BState, Metrics]:
        """Scan the rollout, and update the inverse with the Sherman-Morrison formula."""
        ridge = hparams.bonus["e3b_lambda"]
        start = jnp.eye(self._embedding.latent, dtype=jnp.float32)

        def step(inverse: jax.Array, inputs: Any) -> tuple[jax.Array, jax.Array]:
            phi, ended = inputs
            # The observation after the end of an episode is the first of the next episode.
            inverse = jnp.where(ended[:, None, None], start, inverse)
            # A sum of products, since a matrix product may be less precise on an accelerator.
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
        """Train the embedding; steps that end an episode are left out."""
        # Another derivation of these keys would change published results.
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
    """int32[T, N], the steps from each step to its neighbour: from 1 to `reach`."""
    return jax.random.randint(key, shape, 1, reach + 1, jnp.int32)


def temporal_loss(phi: jax.Array, ended: jax.Array, offset: jax.Array) -> tuple[jax.Array, Metrics]:
    """Cross-entropy of picking a step's neighbour in time among the neighbours of other steps.

    This is InfoNCE (van den Oord et al. 2018) with inner products of unit-length embeddings. Steps
    whose episode ends before their neighbour are neither anchors nor candidates.

    Args:
        phi: float32[T + 1, N, L], embeddings of the observations in order.
        ended: bool[T, N], whether the step ended its episode.
        offset: int32[T, N], as in `sample_offsets`, but clipped to the last observation.
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
    # Ties share the point, so that a constant embedding has the accuracy of chance.
    best = (logits >= jnp.max(logits, axis=-1, keepdims=True)).astype(jnp.float32)
    right = jnp.diagonal(best) / jnp.sum(best, axis=-1)
    loss = mean(-jnp.diagonal(jax.nn.log_softmax(logits)), wanted)
    return loss, {"e3b_temporal_loss": loss, "e3b_temporal_accuracy": mean(right, wanted)}
