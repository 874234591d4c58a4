"""Random network distillation (Burda et al. 2018): the error in predicting a random network."""

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
from ..learning import optimiser, running_stats
from ..learning.bonus import BonusScale, Experience, Metrics, initial_scale, scaled
from ..learning.config import Config, HParams
from ..learning.minibatches import passes, take
from ..learning.networks import Eye, dense
from ..learning.observations import ObservationSpec
from ..learning.running_stats import RunningStats

# Whitened pixels further out are clipped, as OpenAI's RND does.
_FURTHEST = 5.0


class RNDState(PyTreeNode):
    """The state of RND.

    Attributes:
        target: parameters of the random network; never trained.
        predictor: parameters of the one that learns to predict it.
        optimiser: state of the predictor's Adam.
        scale: of the bonus; only used with `normalise_bonus`.
        pixels: statistics of each entry of `ObservationSpec.prepare`, as (images, vector); only
            used with `normalise_observations`.
    """

    target: Any
    predictor: Any
    optimiser: Any
    scale: BonusScale
    pixels: Any


class Embedding(nn.Module):
    """Hidden layers, then the embedding."""

    hidden: int
    layers: int
    output: int
    dtype: Any

    @nn.compact
    def __call__(self, features: jax.Array) -> jax.Array:
        """Return dtype[..., output]."""
        for _ in range(self.layers):
            features = nn.relu(dense(self.hidden, 2.0**0.5, self.dtype)(features))
        return dense(self.output, 1.0, self.dtype)(features)


@dataclasses.dataclass(frozen=True)
class RND:
    """The bonus e(o) = mean_j (g_j(o) - f_j(o))^2 of what a step led to; 0 where it ended.

    Target f and predictor g are networks of the same shape. The bonus has returns of its own,
    which go on through the ends of episodes.

    Attributes:
        spec: what observations are.
        config: sizes and switches.
    """

    spec: ObservationSpec
    config: Config
    value_heads: int = 2

    def init(self, key: jax.Array) -> RNDState:
        """Draw both networks."""
        target_key, predictor_key = jax.random.split(key)
        predictor = self._init_network(predictor_key)
        shapes = [*self.spec.images, (self.spec.vector,)]
        *images, vector = [running_stats.empty(shape) for shape in shapes]
        return RNDState(
            target=self._init_network(target_key),
            predictor=predictor,
            optimiser=optimiser.init(predictor),
            scale=initial_scale(self.config.num_envs),
            pixels=(images, vector),
        )

    def reward(
        self, state: RNDState, hparams: HParams, experience: Experience
    ) -> tuple[jax.Array, RNDState, Metrics]:
        """Compute the bonus of a rollout.

        Statistics of pixels change after their use, but for the first rollout, which there is
        nothing before.
        """
        led_to = _led_to(experience)
        merged = state.pixels
        if self.config.normalise_observations:
            merged = self._merge(state.pixels, led_to)
            unseen = state.pixels[1].count == 0
            used = jax.tree.map(lambda a, b: jnp.where(unseen, a, b), merged, state.pixels)
            state = state.replace(pixels=used)
        error = self.error(state, led_to)
        bonus = jnp.where(experience.ended, 0, error)
        metrics = {"rnd_error": jnp.mean(error)}
        state = state.replace(pixels=merged)
        if self.config.normalise_bonus:
            bonus, scale = scaled(bonus, state.scale, hparams.bonus_gamma)
            state = state.replace(scale=scale)
        return hparams.bonus_reward * bonus, state, metrics

    def update(
        self,
        key: jax.Array,
        state: RNDState,
        hparams: HParams,
        experience: Experience,
        rate: jax.Array,
    ) -> tuple[RNDState, Metrics]:
        """Train the predictor on what the steps led to, ends left out."""
        pass_key, chance_key = jax.random.split(key)
        wanted = _wanted(chance_key, hparams, experience)
        data = (_led_to(experience), wanted)

        def body(carry: Any, environments: jax.Array) -> tuple[Any, Metrics]:
            predictor, adam = carry
            obs, wanted = take(data, environments, 1)

            def loss(predictor: Any) -> jax.Array:
                return self._loss(state.replace(predictor=predictor), hparams, obs, wanted)

            value, gradients = jax.value_and_grad(loss)(predictor)
            predictor, adam, size = optimiser.step(
                gradients, adam, predictor, rate, hparams.gradient_norm
            )
            return (predictor, adam), {"rnd_loss": value, "rnd_gradient_norm": size}

        carry = (state.predictor, state.optimiser)
        (predictor, adam), metrics = passes(
            pass_key, self.config, self.config.bonus_epochs, body, carry
        )
        return state.replace(predictor=predictor, optimiser=adam), metrics

    def error(self, state: RNDState, obs: Any) -> jax.Array:
        """float32[T, N], e of observations with leading axes [T, N]."""
        prepare = functools.partial(self._whiten, state.pixels)
        if not self.config.normalise_observations:
            prepare = None
        target = jax.lax.stop_gradient(self._embed(state.target, obs, prepare))
        return jnp.mean((self._embed(state.predictor, obs, prepare) - target) ** 2, axis=-1)

    def _loss(self, state: RNDState, hparams: HParams, obs: Any, wanted: jax.Array) -> jax.Array:
        """The mean error of the observations wanted, bool[T, N], times its coefficient."""
        error = self.error(state, obs)
        number = jnp.maximum(jnp.sum(wanted), 1).astype(jnp.float32)
        return hparams.rnd_loss * jnp.sum(jnp.where(wanted, error, 0)) / number

    def _embed(self, params: Any, obs: Any, prepare: Any) -> jax.Array:
        features = self._eye.encode_sequence(params["encoder"], obs, prepare)
        return self._embedding.apply(params["embedding"], features).astype(jnp.float32)

    def _init_network(self, key: jax.Array) -> dict[str, Any]:
        encoder_key, embedding_key = jax.random.split(key)
        features = jnp.zeros((1, self.config.rnd_hidden), self.config.compute_dtype)
        return {
            "encoder": self._eye.init(encoder_key),
            "embedding": self._embedding.init(embedding_key, features),
        }

    def _merge(self, pixels: Any, obs: Any) -> Any:
        def add(pixels: Any, step: Any) -> tuple[Any, None]:
            images, vector = self.spec.prepare(step, jnp.float32)
            values = (images, vector)
            is_stats = lambda leaf: isinstance(leaf, RunningStats)  # noqa: E731
            return jax.tree.map(running_stats.merge, pixels, values, is_leaf=is_stats), None

        # Step by step: all frames at once would be four times the rollout's memory.
        return jax.lax.scan(add, pixels, obs)[0]

    def _whiten(self, pixels: Any, obs: Any, dtype: Any) -> tuple[list[jax.Array], jax.Array]:
        def whiten(values: jax.Array, stats: RunningStats) -> jax.Array:
            axes = tuple(range(values.ndim - stats.mean.ndim))
            mean = jnp.expand_dims(stats.mean, axes)
            deviation = jnp.expand_dims(jnp.maximum(stats.deviation, 1e-4), axes)
            return jnp.clip((values - mean) / deviation, -_FURTHEST, _FURTHEST).astype(dtype)

        images, vector = self.spec.prepare(obs, jnp.float32)
        images = [whiten(*pair) for pair in zip(images, pixels[0], strict=True)]
        return images, whiten(vector, pixels[1])

    @functools.cached_property
    def _eye(self) -> Eye:
        config = self.config
        return Eye(self.spec, config.rnd_hidden, config, config.compute_dtype)

    @functools.cached_property
    def _embedding(self) -> Embedding:
        config = self.config
        return Embedding(
            config.rnd_hidden, config.rnd_layers, config.rnd_output, config.compute_dtype
        )


def _wanted(key: jax.Array, hparams: HParams, experience: Experience) -> jax.Array:
    """bool[T, N]: a random share of the steps, those that ended an episode left out."""
    kept = jax.random.uniform(key, experience.ended.shape) < hparams.rnd_fraction
    return kept & ~experience.ended


def _led_to(experience: Experience) -> Any:
    return jax.tree.map(lambda leaf: leaf[1:], experience.obs)
