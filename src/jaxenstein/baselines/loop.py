"""A run as pure functions: its start, and updates that play, reward, estimate and learn."""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp

from . import divergence, optimiser, ppo
from .bonus import Bonus, BonusScale, Experience, Metrics
from .config import Config, HParams
from .networks import ActorCritic
from .rollout import Actors, Finals, Steps, Sums, final_values, rollout, start
from .simulator import Simulator
from .state import TrainState, wrap_key

# Episodes over which the mean success is taken, for `stop_success`.
RECENT = 100


@dataclasses.dataclass(frozen=True)
class Loop:
    """The parts of a training loop; none of its functions knows an algorithm by name.

    Attributes:
        config: the static settings.
        simulator: the environments.
        network: policy and values.
        bonus: the exploration bonus.
        slots: truncations of each environment that a rollout can hold; 0 counts the time limit
            as an end.
        discount: the environment's own.
        clocks: as in `rollout.start`.
    """

    config: Config
    simulator: Simulator
    network: ActorCritic
    bonus: Bonus
    slots: int
    discount: Any
    clocks: tuple[Any, int] | None

    def numbers(self, hparams: HParams | None) -> HParams:
        """The numbers of a run as `HParams.check` returns them; None: the defaults."""
        return (hparams or HParams()).check(self.config.algo)

    def start(self, data: jax.Array) -> TrainState:
        """The state of a run before its first update; `data` is that of its random key."""
        params_key, bonus_key, env_key, key = jax.random.split(wrap_key(data), 4)
        params, number = self.network.init(params_key), self.config.num_envs
        scale = BonusScale.empty(number, *self.parts) if self.config.normalise_bonus else None
        return TrainState(
            key=jax.random.key_data(key),
            update=jnp.int32(0),
            params=params,
            optimiser=optimiser.init(params),
            bonus=self.bonus.init(bonus_key),
            scale=scale,
            recent=jnp.float32(0) if self.config.stop_success else None,
            actors=start(self.simulator, self.network, env_key, number, self.clocks),
            diverged=jnp.int32(0) if self.config.on_divergence == "stop" else None,
        )

    def updates(
        self, state: TrainState, hparams: HParams, number: int
    ) -> tuple[TrainState, Metrics]:
        """A number of updates; `hparams` as in `numbers`. The metrics are [number]."""
        gamma = hparams.gamma
        if gamma is None:
            gamma = jnp.asarray(self.discount, jnp.float32)
        bonus_gamma = gamma if hparams.bonus_gamma is None else hparams.bonus_gamma
        hparams = hparams.replace(gamma=gamma, bonus_gamma=bonus_gamma)
        return jax.lax.scan(lambda s, _: self.update(s, hparams), state, length=number)

    @property
    def parts(self) -> tuple[int, ...]:
        """The shape of the bonus of a step: (), or (value_heads - 1,) where it has own values."""
        return () if self.bonus.value_heads == 1 else (self.bonus.value_heads - 1,)

    def update(self, state: TrainState, hparams: HParams) -> tuple[TrainState, Metrics]:
        """One update: play, reward, estimate and learn; `hparams` have both discounts.

        Returns:
            The next state, and scalars: those of `rollout`; `loss`, `policy_loss`,
            `value_loss`, `entropy`, `approximate_kl`, `clip_fraction` and `gradient_norm` (before
            the clip), means over the minibatches;
            `advantage_mean`, `advantage_deviation`, `value_mean`, `reward_mean`, `bonus_mean`,
            `bonus_max` and `explained_variance` of the rollout, before any normalisation;
            `learning_rate`; `bonus_explained_variance` where the bonus has a value head of its own
            (`bonus_explained_variance_1`, ... where several); and the bonus' own metrics. If
            `on_divergence` is `"stop"`, the update of a diverged run is undone, and the metrics
            have `diverged`, as in `TrainState`.
        """
        before = state
        key, play_key, train_key, bonus_key = jax.random.split(wrap_key(state.key), 4)
        actors, steps, finals, sums = rollout(
            self.simulator, self.network, state.params, play_key, state.actors,
            self.config.rollout, self.slots,
        )  # fmt: skip
        experience = Experience(
            obs=jax.tree.map(lambda a, b: jnp.concatenate([a, b[None]]), steps.obs, actors.obs),
            action=steps.action,
            ended=steps.ended,
        )
        bonus, state, seen = self.reward(state, hparams, experience)
        advantages = self.advantages(state.params, hparams, actors, steps, finals, bonus)
        batch = self._batch(state.actors.memory, steps, advantages, hparams)
        recent = self._recent(state.recent, sums)
        left = self._left(state.update, recent)
        params, adam, learnt = ppo.train(
            self.network, self.config, train_key, (state.params, state.optimiser), batch,
            hparams, hparams.learning_rate * left,
        )  # fmt: skip
        bonus_state, bonus_learnt = self.bonus.update(
            bonus_key, state.bonus, hparams, experience, hparams.bonus_learning_rate * left
        )
        state = state.replace(
            key=jax.random.key_data(key),
            update=state.update + 1,
            params=params,
            optimiser=adam,
            bonus=bonus_state,
            recent=recent,
            actors=actors,
        )
        diagnosis = _diagnose(batch, bonus) | {"learning_rate": hparams.learning_rate * left}
        metrics = sums | learnt | diagnosis | seen | bonus_learnt
        if state.diverged is None:
            return state, metrics
        return divergence.guard(before, state, learnt | bonus_learnt, metrics)

    def reward(
        self, state: TrainState, hparams: HParams, experience: Experience
    ) -> tuple[jax.Array, TrainState, Metrics]:
        """The bonus of a rollout that the agent learns from: float32[T, N, *parts].

        It is zero where a step ended its episode, since the world at that end is not kept.
        """
        bonus, own, metrics = self.bonus.reward(state.bonus, hparams, experience)
        batch = experience.ended.shape
        ended = experience.ended.reshape(*batch, *(1 for _ in self.parts))
        bonus = jnp.where(ended, 0, bonus.reshape(*batch, *self.parts))
        scale = state.scale
        if scale is not None:
            bonus, scale = scale.divide(bonus, hparams.bonus_gamma, hparams.bonus_memory)
        return hparams.bonus_reward * bonus, state.replace(bonus=own, scale=scale), metrics

    def advantages(
        self,
        params: Any,
        hparams: HParams,
        actors: Actors,
        steps: Steps,
        finals: Finals,
        bonus: jax.Array,
    ) -> jax.Array:
        """Advantages of a rollout: float32[T, N, V].

        First those of the rewards, to which the bonus is added if there is one value, then those
        of the parts of a bonus with returns of their own.

        `params` are of the network that played, `actors` follow the rollout, `finals` are the
        episodes that the time limit cut off, and `bonus` is float32[T, N, *parts].
        """
        _, last, _ = self.network.step(
            params, actors.obs, actors.previous, actors.first, actors.memory
        )
        terminated, truncated, reward = steps.ended, jnp.zeros_like(steps.truncated), steps.reward
        ends = jnp.zeros_like(steps.value)
        if self.slots:
            terminated, truncated = steps.terminated, steps.truncated
            ends = final_values(self.simulator, self.network, params, finals, self.config.rollout)
        if self.bonus.value_heads == 1:
            reward = reward + bonus
        values = steps.value[..., 0]
        following = ppo.next_values(values, last[..., 0], terminated, truncated, ends[..., 0])
        result = ppo.advantages(
            reward, values, following, steps.ended, hparams.gamma, hparams.gae_lambda
        )
        if self.bonus.value_heads == 1:
            return result[..., None]
        values = steps.value[..., 1:]
        following = jnp.concatenate([values[1:], last[None, :, 1:]])
        never = jnp.zeros(values.shape, bool)
        intrinsic = ppo.advantages(
            bonus, values, following, never, hparams.bonus_gamma, hparams.gae_lambda
        )
        return jnp.concatenate([result[..., None], intrinsic], axis=-1)

    def _batch(
        self, memory: jax.Array, steps: Steps, advantages: jax.Array, hparams: HParams
    ) -> ppo.Batch:
        total = advantages[..., 0]
        if self.bonus.value_heads > 1:
            total = total + hparams.bonus_advantage * jnp.sum(advantages[..., 1:], axis=-1)
        return ppo.Batch(steps, memory[None], total, advantages + steps.value)

    def _recent(self, recent: jax.Array | None, sums: Sums) -> jax.Array | None:
        """The mean success with the episodes of a rollout; once high enough it stays."""
        if recent is None:
            return None
        number = sums["episodes"].astype(jnp.float32)
        success = sums["successes"].astype(jnp.float32) / jnp.maximum(number, 1)
        mean = success + (recent - success) * jnp.exp(-number / RECENT)
        return jnp.where(recent < self.config.stop_success, mean, recent)

    def _left(self, update: jax.Array, recent: jax.Array | None) -> jax.Array:
        """float32[], the factor of the learning rates."""
        left = jnp.float32(1)
        if self.config.anneal:
            left = jnp.maximum(1 - update.astype(jnp.float32) / self.config.updates, 0)
        if recent is None:
            return left
        return jnp.where(recent < self.config.stop_success, left, 0)


def _diagnose(batch: ppo.Batch, bonus: jax.Array) -> Metrics:
    """Metrics that explain a failed run, over the whole rollout, before any normalisation."""
    steps = batch.steps
    error = jnp.var(batch.target - steps.value, axis=(0, 1))
    spread = jnp.maximum(jnp.var(batch.target, axis=(0, 1)), 1e-12)
    explained = 1 - error / spread
    several = range(1, len(explained)) if len(explained) > 2 else ()
    own = [f"bonus_explained_variance_{part}" for part in several] or ["bonus_explained_variance"]
    names = ["explained_variance", *own]
    return {
        "advantage_mean": jnp.mean(batch.advantage),
        "advantage_deviation": jnp.std(batch.advantage),
        "value_mean": jnp.mean(steps.value[..., 0]),
        "reward_mean": jnp.mean(steps.reward),
        "bonus_mean": jnp.mean(bonus),
        "bonus_max": jnp.max(bonus),
        **{name: explained[index] for index, name in enumerate(names[: len(explained)])},
    }
