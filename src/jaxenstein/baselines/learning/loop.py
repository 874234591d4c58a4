"""One update: play, reward, estimate advantages, learn."""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp

from . import gae, ppo
from .bonus import Bonus, Experience
from .config import Config, HParams
from .networks import ActorCritic
from .rollout import Actors, Finals, Steps, final_values, rollout
from .simulator import Simulator
from .state import Metrics, TrainState, wrap_key


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
    """

    config: Config
    simulator: Simulator
    network: ActorCritic
    bonus: Bonus
    slots: int

    def update(self, state: TrainState, hparams: HParams) -> tuple[TrainState, Metrics]:
        """The whole of an update.

        Args:
            state: before it.
            hparams: the run's numbers, with both discounts.

        Returns:
            The next state, and scalars: the sums of `Episodes`; `loss`, `policy_loss`,
            `value_loss`, `entropy`, `approximate_kl`, `clip_fraction` and `gradient_norm` (before
            the clip), means over the minibatches;
            `advantage_mean`, `advantage_deviation`, `value_mean`, `reward_mean`, `bonus_mean`,
            `bonus_max` and `explained_variance` of the rollout, before any normalisation;
            `learning_rate`; with RND `bonus_explained_variance`, and what the bonus itself
            reports.
        """
        key, play_key, train_key, bonus_key = jax.random.split(wrap_key(state.key), 4)
        actors, steps, finals, episodes = rollout(
            self.simulator, self.network, state.params, play_key, state.actors,
            self.config.rollout, self.slots,
        )  # fmt: skip
        experience = Experience(
            obs=jax.tree.map(lambda a, b: jnp.concatenate([a, b[None]]), steps.obs, actors.obs),
            action=steps.action,
            ended=steps.ended,
        )
        bonus, bonus_state, seen = self.bonus.reward(state.bonus, hparams, experience)
        advantages = self.advantages(state.params, hparams, actors, steps, finals, bonus)
        batch = self._batch(state.actors.memory, steps, advantages, hparams)
        left = self._left(state.update)
        params, adam, learnt = ppo.train(
            self.network, self.config, train_key, state.params, state.optimiser, batch,
            hparams, hparams.learning_rate * left,
        )  # fmt: skip
        bonus_state, bonus_learnt = self.bonus.update(
            bonus_key, bonus_state, hparams, experience, hparams.bonus_learning_rate * left
        )
        state = TrainState(
            key=jax.random.key_data(key),
            update=state.update + 1,
            params=params,
            optimiser=adam,
            bonus=bonus_state,
            actors=actors,
        )
        sums = {name: getattr(episodes, name) for name in type(episodes).__dataclass_fields__}
        diagnosis = _diagnose(batch, bonus) | {"learning_rate": hparams.learning_rate * left}
        return state, sums | learnt | diagnosis | seen | bonus_learnt

    def advantages(
        self,
        params: Any,
        hparams: HParams,
        actors: Actors,
        steps: Steps,
        finals: Finals,
        bonus: jax.Array,
    ) -> jax.Array:
        """Advantages of a rollout.

        Args:
            params: of the network that played.
            hparams: with both discounts.
            actors: the environments after the rollout.
            steps: the rollout.
            finals: what the time limit cut off.
            bonus: float32[T, N].

        Returns:
            float32[T, N, V]: those of the rewards, to which the bonus is added if there is one
            value, then those of a bonus with returns of its own.
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
        following = gae.next_values(values, last[..., 0], terminated, truncated, ends[..., 0])
        result = gae.advantages(
            reward, values, following, steps.ended, hparams.gamma, hparams.gae_lambda
        )
        if self.bonus.value_heads == 1:
            return result[..., None]
        values, never = steps.value[..., 1], jnp.zeros_like(terminated)
        following = gae.next_values(values, last[..., 1], never, never, values)
        intrinsic = gae.advantages(
            bonus, values, following, never, hparams.bonus_gamma, hparams.gae_lambda
        )
        return jnp.stack([result, intrinsic], axis=-1)

    def _batch(
        self, memory: jax.Array, steps: Steps, advantages: jax.Array, hparams: HParams
    ) -> ppo.Batch:
        total = advantages[..., 0]
        if self.bonus.value_heads == 2:
            total = total + hparams.bonus_advantage * advantages[..., 1]
        return ppo.Batch(steps, memory, total, advantages + steps.value)

    def _left(self, update: jax.Array) -> jax.Array:
        """float32[], the share of the learning rates that is left."""
        if not self.config.anneal:
            return jnp.float32(1)
        return jnp.maximum(1 - update.astype(jnp.float32) / self.config.updates, 0)


def _diagnose(batch: ppo.Batch, bonus: jax.Array) -> Metrics:
    """What explains a run that fails, over the whole rollout and before any normalisation."""
    steps = batch.steps
    error = jnp.var(batch.target - steps.value, axis=(0, 1))
    spread = jnp.maximum(jnp.var(batch.target, axis=(0, 1)), 1e-12)
    explained = 1 - error / spread
    names = ("explained_variance", "bonus_explained_variance")
    return {
        "advantage_mean": jnp.mean(batch.advantage),
        "advantage_deviation": jnp.std(batch.advantage),
        "value_mean": jnp.mean(steps.value[..., 0]),
        "reward_mean": jnp.mean(steps.reward),
        "bonus_mean": jnp.mean(bonus),
        "bonus_max": jnp.max(bonus),
        **{name: explained[index] for index, name in enumerate(names[: explained.shape[0]])},
    }
