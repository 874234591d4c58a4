"""Random network distillation (Burda et al. 2018): the error in predicting a random network."""

# flax' `apply` is typed as if it might return variables as well, which ours never do.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportReturnType=false

from __future__ import annotations

import dataclasses
import functools
from typing import Any

import jax
import jax.numpy as jnp
from jax.typing import DTypeLike

from ...pytree import PyTreeNode
from ..learning import optimiser, running_stats
from ..learning.algorithms import BonusNumbers, BonusSettings
from ..learning.bonus import Experience, Metrics
from ..learning.config import Config
from ..learning.fields import count, share
from ..learning.hparams import HParams
from ..learning.networks import Eye
from ..learning.observations import ObservationSpec
from ..learning.running_stats import RunningStats
from .parts import Layers, number, train

# Whitened pixels further out are clipped, as OpenAI's RND does.
_FURTHEST = 5.0
# Statistics of the entries of images and vector.
Pixels = tuple[list[RunningStats], RunningStats]


@dataclasses.dataclass(frozen=True, kw_only=True)
class RNDSettings(BonusSettings):
    """Static settings of RND.

    Attributes:
        rnd_hidden: width of RND's hidden layers.
        rnd_output: size of RND's embedding.
        rnd_layers: number of RND's hidden layers behind its image features.
        rnd_deeper: hidden layers that RND's predictor has beyond those of its random network.
        rnd_normalise_observations: whiten the frames that RND sees by running statistics.
        rnd_warm_up: steps of each environment with random actions, before the first update,
            that these statistics begin with.
    """

    rnd_hidden: int = 128
    rnd_output: int = 128
    rnd_layers: int = 2
    rnd_deeper: int = count(0, least=0)
    rnd_normalise_observations: bool = False
    rnd_warm_up: int = count(0, least=0)


class RNDNumbers(BonusNumbers):
    """Numbers of RND.

    Attributes:
        rnd_loss: coefficient of RND's loss.
        rnd_fraction: share of the frames that RND's predictor is trained on.
    """

    rnd_loss: Any = 0.1
    rnd_fraction: Any = share(1.0)


class RNDState(PyTreeNode):
    """The state of RND.

    Attributes:
        target: parameters of the random network; never trained.
        predictor: parameters of the one that learns to predict it.
        optimiser: state of the predictor's Adam.
        pixels: statistics of each entry of `ObservationSpec.prepare`, as (images, vector); only
            used with `rnd_normalise_observations`.
    """

    target: Any
    predictor: Any
    optimiser: Any
    pixels: Pixels


@dataclasses.dataclass(frozen=True)
class RND:
    """The bonus e(o) = mean_j (g_j(o) - f_j(o))^2 of what a step led to.

    Target f and predictor g are networks of the same shape, but for `rnd_deeper`. The bonus has
    returns of its own, which go on through the ends of episodes.

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
        predictor = self._init_network(predictor_key, self._predictor)
        shapes = [*self.spec.images, (self.spec.vector,)]
        *images, vector = [running_stats.empty(shape) for shape in shapes]
        return RNDState(
            target=self._init_network(target_key, self._target),
            predictor=predictor,
            optimiser=optimiser.init(predictor),
            pixels=(images, vector),
        )

    @property
    def warm_up(self) -> int:
        """Steps of random play that the statistics of pixels begin with."""
        own = self._settings
        return own.rnd_warm_up if own.rnd_normalise_observations else 0

    def watch(self, state: RNDState, obs: Any) -> RNDState:
        """The state with observations [N] in its statistics."""
        return state.replace(
            pixels=self._merge(state.pixels, jax.tree.map(lambda leaf: leaf[None], obs))
        )

    def reward(
        self, state: RNDState, hparams: HParams, experience: Experience
    ) -> tuple[jax.Array, RNDState, Metrics]:
        """Compute the bonus of a rollout.

        Statistics of pixels change after their use, but for those of the first rollout where
        there is nothing before.
        """
        led_to = experience.led_to
        if not self._settings.rnd_normalise_observations:
            error = self.error(state, led_to)
            return error, state, {"rnd_error": jnp.mean(error)}
        merged = self._merge(state.pixels, led_to)
        unseen = state.pixels[1].count == 0
        used = jax.tree.map(lambda a, b: jnp.where(unseen, a, b), merged, state.pixels)
        error = self.error(state.replace(pixels=used), led_to)
        return error, state.replace(pixels=merged), {"rnd_error": jnp.mean(error)}

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
        numbers = hparams.bonus_as(RNDNumbers)
        kept = jax.random.uniform(chance_key, experience.ended.shape) < numbers.rnd_fraction
        data = (experience.led_to, kept & ~experience.ended)

        def loss(predictor: Any, part: Any) -> tuple[jax.Array, Metrics]:
            obs, wanted = part
            error = self.error(state.replace(predictor=predictor), obs)
            value = numbers.rnd_loss * jnp.sum(jnp.where(wanted, error, 0)) / number(wanted)
            return value, {"rnd_loss": value}

        predictor, adam, metrics = train(
            "rnd", pass_key, self.config, hparams, rate, loss, data, state.predictor,
            state.optimiser,
        )  # fmt: skip
        return state.replace(predictor=predictor, optimiser=adam), metrics

    def error(self, state: RNDState, obs: Any) -> jax.Array:
        """float32[T, N], e of observations with leading axes [T, N]."""
        prepare = functools.partial(self._whiten, state.pixels)
        if not self._settings.rnd_normalise_observations:
            prepare = None

        def embed(layers: Layers, params: Any) -> jax.Array:
            features = self._eye.encode_sequence(params["encoder"], obs, prepare)
            return layers.apply(params["embedding"], features).astype(jnp.float32)

        target = jax.lax.stop_gradient(embed(self._target, state.target))
        return jnp.mean((embed(self._predictor, state.predictor) - target) ** 2, axis=-1)

    def _init_network(self, key: jax.Array, layers: Layers) -> dict[str, Any]:
        encoder_key, embedding_key = jax.random.split(key)
        features = jnp.zeros((1, self._settings.rnd_hidden), self.config.compute_dtype)
        return {
            "encoder": self._eye.init(encoder_key),
            "embedding": layers.init(embedding_key, features),
        }

    def _merge(self, pixels: Pixels, obs: Any) -> Pixels:
        def add(pixels: Pixels, step: Any) -> tuple[Pixels, None]:
            images, vector = self.spec.prepare(step, jnp.float32)
            values = (images, vector)
            is_stats = lambda leaf: isinstance(leaf, RunningStats)  # noqa: E731
            return jax.tree.map(running_stats.merge, pixels, values, is_leaf=is_stats), None

        # Step by step: all frames at once would be four times the rollout's memory.
        return jax.lax.scan(add, pixels, obs)[0]

    def _whiten(
        self, pixels: Pixels, obs: Any, dtype: DTypeLike
    ) -> tuple[list[jax.Array], jax.Array]:
        def whiten(values: jax.Array, stats: RunningStats) -> jax.Array:
            axes = tuple(range(values.ndim - stats.mean.ndim))
            mean = jnp.expand_dims(stats.mean, axes)
            deviation = jnp.expand_dims(jnp.maximum(stats.deviation, 1e-4), axes)
            return jnp.clip((values - mean) / deviation, -_FURTHEST, _FURTHEST).astype(dtype)

        images, vector = self.spec.prepare(obs, jnp.float32)
        images = [whiten(*pair) for pair in zip(images, pixels[0], strict=True)]
        return images, whiten(vector, pixels[1])

    @property
    def _settings(self) -> RNDSettings:
        return self.config.bonus_as(RNDSettings)

    @functools.cached_property
    def _eye(self) -> Eye:
        config = self.config
        return Eye(self.spec, self._settings.rnd_hidden, config, config.compute_dtype)

    @functools.cached_property
    def _target(self) -> Layers:
        own = self._settings
        return Layers(own.rnd_hidden, own.rnd_layers, own.rnd_output, self.config.compute_dtype)

    @functools.cached_property
    def _predictor(self) -> Layers:
        return self._target.clone(layers=self._target.layers + self._settings.rnd_deeper)
