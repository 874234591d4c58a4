"""The training loop as pure functions: the first state, and updates that play and learn."""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp

from ..errors import SettingError
from . import divergence, optimiser, ppo
from .bonus import Bonus, Experience, Metrics, RunningScale
from .config import Config, HParams
from .networks import ActorCritic
from .rollout import Actors, Finals, Steps, Sums, final_values, rollout, start
from .simulator import Simulator
from .state import TrainState, wrap_key

# Number of episodes in the running mean of successes, for `stop_success`.
RECENT = 100
# Names that the rows of metrics.jsonl have for themselves.
RESERVED = ("update", "steps", "seed", "return", "length", "success", divergence.METRIC)


@dataclasses.dataclass(frozen=True)
class Loop:
    """A training loop and its parts; no function depends on the name of an algorithm.

    Attributes:
        config: the static settings.
        simulator: the environments.
        network: policy and values.
        bonus: the exploration bonus.
        slots: the most truncations of one environment in a rollout; 0: the time limit counts as
            termination.
        discount: the environment's own discount.
        clocks: see `rollout.start`.
    """

    config: Config
    simulator: Simulator
    network: ActorCritic
    bonus: Bonus
    slots: int
    discount: Any
    clocks: tuple[Any, int] | None

    def numbers(self, hparams: HParams | None) -> HParams:
        """The hyperparameters as `HParams.check` returns them; None for the defaults."""
        return (hparams or HParams()).check(self.config.algo)

    def start(self, data: jax.Array) -> TrainState:
        """The state of a run before its first update; `data` is the data of its random key."""
        params_key, bonus_key, env_key, key = jax.random.split(wrap_key(data), 4)
        params, number = self.network.init(params_key), self.config.num_envs
        scale, reward_scale = None, None
        if self.config.normalise_bonus:
            scale = RunningScale.empty(number, *self.parts)
        if self.config.normalise_rewards:
            reward_scale = RunningScale.empty(number)
        return TrainState(
            key=jax.random.key_data(key),
            update=jnp.int32(0),
            params=params,
            optimiser=optimiser.init(params),
            bonus=self.bonus.init(bonus_key),
            scale=scale,
            reward_scale=reward_scale,
            recent=jnp.float32(0) if self.config.stop_success else None,
            actors=start(self.simulator, self.network, env_key, number, self.clocks),
            diverged=jnp.int32(0) if self.config.on_divergence == "stop" else None,
        )

    def updates(
        self, state: TrainState, hparams: HParams, number: int
    ) -> tuple[TrainState, Metrics]:
        """Run `number` updates with `hparams` from `numbers`; metrics are [number]."""
        gamma = hparams.gamma
        if gamma is None:
            gamma = jnp.asarray(self.discount, jnp.float32)
        bonus_gamma = gamma if hparams.bonus_gamma is None else hparams.bonus_gamma
        hparams = hparams.replace(gamma=gamma, bonus_gamma=bonus_gamma)
        return jax.lax.scan(lambda s, _: self.update(s, hparams), state, length=number)

    @property
    def parts(self) -> tuple[int, ...]:
        """The shape of the bonus of a step: (), or (value_heads - 1,) with separate value heads."""
        return () if self.bonus.value_heads == 1 else (self.bonus.value_heads - 1,)

    def update(self, state: TrainState, hparams: HParams) -> tuple[TrainState, Metrics]:
        """One update: collect a rollout, compute the bonus and the advantages, and learn.

        `hparams` must have both discounts.

        Returns:
            The next state, and a dictionary of scalar metrics:

            - those of `rollout`;
            - means over the minibatches: `loss`, `policy_loss`, `value_loss`, `entropy`,
              `approximate_kl`, `clip_fraction`, and `gradient_norm` before clipping;
            - statistics of the rollout: `reward_mean` of the environment's rewards; `bonus_mean`
              and `bonus_max` of the bonus from which the agent learns, which is divided by its
              deviation with `normalise_bonus` and multiplied by `bonus_reward`; and
              `advantage_mean`, `advantage_deviation`, `value_mean`, `explained_variance` and, if
              the bonus has a separate value head, `bonus_explained_variance`
              (`bonus_explained_variance_1`, ... for several heads), for the rewards from which
              it learns, before advantages are normalised in minibatches;
            - `learning_rate`, and the metrics of the bonus;
            - `diverged`, as in `TrainState`, if `on_divergence` is `"stop"`. The update of a
              diverged run is then undone.
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
        bonus, state, seen = self.bonuses(state, hparams, experience)
        rewards, state = self.rewards(state, hparams, steps)
        advantages = self.advantages(state.params, hparams, actors, rewards, finals, bonus)
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
        metrics, of_bonus = sums | learnt | diagnosis, seen | bonus_learnt
        _check_names(of_bonus, metrics)
        metrics |= of_bonus
        if state.diverged is None:
            return state, metrics
        return divergence.guard(before, state, learnt | bonus_learnt, metrics)

    def bonuses(
        self, state: TrainState, hparams: HParams, experience: Experience
    ) -> tuple[jax.Array, TrainState, Metrics]:
        """The scaled bonus of a rollout, float32[T, N, *parts].

        It is zero where a step ended an episode, since the last observation is not kept.
        """
        bonus, own, metrics = self.bonus.reward(state.bonus, hparams, experience)
        batch = experience.ended.shape
        ended = experience.ended.reshape(*batch, *(1 for _ in self.parts))
        bonus = jnp.where(ended, 0, bonus.reshape(*batch, *self.parts))
        scale = state.scale
        if scale is not None:
            bonus, scale = scale.divide(bonus, hparams.bonus_gamma, memory=hparams.bonus_memory)
        return hparams.bonus_reward * bonus, state.replace(bonus=own, scale=scale), metrics

    def rewards(
        self, state: TrainState, hparams: HParams, steps: Steps
    ) -> tuple[Steps, TrainState]:
        """The steps of a rollout with the rewards to learn from."""
        if state.reward_scale is None:
            return steps, state
        reward, scale = state.reward_scale.divide(
            steps.reward, hparams.gamma, ended=steps.ended, least=1.0
        )
        return steps.replace(reward=reward), state.replace(reward_scale=scale)

    def advantages(
        self,
        params: Any,
        hparams: HParams,
        actors: Actors,
        steps: Steps,
        finals: Finals,
        bonus: jax.Array,
    ) -> jax.Array:
        """Advantages of a rollout, float32[T, N, V].

        The first advantages are those of the rewards; they include the bonus if it has no separate
        value head. The advantages of each part of the bonus follow.

        `params` are those of the rollout policy, `actors` is the state after the rollout, `finals`
        are the truncated episodes, and `bonus` is float32[T, N, *parts].
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
        """The running mean success including this rollout; fixed once it reaches `stop_success`."""
        if recent is None:
            return None
        number = sums["episodes"].astype(jnp.float32)
        success = sums["successes"].astype(jnp.float32) / jnp.maximum(number, 1)
        mean = success + (recent - success) * jnp.exp(-number / RECENT)
        return jnp.where(recent < self.config.stop_success, mean, recent)

    def _left(self, update: jax.Array, recent: jax.Array | None) -> jax.Array:
        """float32[], the factor on the learning rates."""
        left = jnp.float32(1)
        if self.config.anneal:
            left = jnp.maximum(1 - update.astype(jnp.float32) / self.config.updates, 0)
        if recent is None:
            return left
        return jnp.where(recent < self.config.stop_success, left, 0)


def _diagnose(batch: ppo.Batch, bonus: jax.Array) -> Metrics:
    """Metrics of the whole rollout before normalisation, which help to explain a failed run."""
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


def _check_names(of_bonus: Metrics, own: Metrics) -> None:
    """Raise a `SettingError` if a metric of the bonus has the name of another one."""
    if both := sorted({*of_bonus} & {*own, *RESERVED}):
        raise SettingError(
            f"the bonus returns metrics with names that the training uses: {', '.join(both)}; "
            "begin their names with that of the bonus"
        )
