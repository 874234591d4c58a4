"""Recurrent PPO for any network; `flax_agent.py` and `equinox_agent.py` use it.

Rollouts, resets and updates are one compiled program, as in `ppo.py`, which also defines advantages
and settings. A minibatch has all steps of some environments, so that gradients flow through the
memory.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import optax

from examples.ppo import Report, Settings, advantages

# A network takes weights, a memory float32[N, H], images [T, N, ...] and bool[T, N], whether an
# image is the first of an episode. It returns the next memory, logits [T, N, actions] and values
# [T, N].
Network = Callable[[Any, jax.Array, jax.Array, jax.Array], tuple[jax.Array, jax.Array, jax.Array]]


class Rollout(NamedTuple):
    """Steps of N environments, all [T, N]; `chosen` is false for steps that only reset."""

    observation: jax.Array
    first: jax.Array
    action: jax.Array
    log_prob: jax.Array
    value: jax.Array
    reward: jax.Array
    terminated: jax.Array
    ended: jax.Array
    chosen: jax.Array


class Training(NamedTuple):
    """The state of training between two updates."""

    key: jax.Array
    weights: Any
    optimiser: Any
    memory: jax.Array
    first: jax.Array
    observation: jax.Array
    state: Any


@dataclasses.dataclass(frozen=True, eq=False)
class Trainer:
    """The constants of a training."""

    env: Any
    params: Any
    network: Network
    optimiser: optax.GradientTransformation
    settings: Settings

    def begin(self, key: jax.Array, weights: Any, hidden: int) -> Training:
        """The training state before the first update, with a memory of size `hidden`."""
        key, reset_key = jax.random.split(key)
        count = self.settings.envs
        keys = jax.random.split(reset_key, count)
        observation, state = jax.vmap(self.env.reset, (0, None))(keys, self.params)
        memory, first = jnp.zeros((count, hidden)), jnp.ones(count, bool)
        start = self.optimiser.init(weights)
        return Training(key, weights, start, memory, first, observation, state)

    @functools.partial(jax.jit, static_argnums=(0, 2))
    def run(self, training: Training, updates: int) -> tuple[Training, Report]:
        """Run some updates; return the new state and a report for each update."""
        return jax.lax.scan(lambda t, _: self.update(t), training, None, updates)

    def update(self, training: Training) -> tuple[Training, Report]:
        """Collect a rollout and learn from it."""
        memory, (key, learn_key) = training.memory, jax.random.split(training.key)
        training, (past, info) = jax.lax.scan(
            self.act, training._replace(key=key), None, self.settings.steps
        )
        *_, value = self.look(training)
        values = jnp.concatenate([past.value, value[None]])
        advantage = advantages(
            values, past.reward, past.terminated, past.ended, self.params.discount,
            self.settings.gae_lambda,
        )  # fmt: skip
        weights, optimiser = self.learn(training, memory, past, advantage, learn_key)
        episodes = jnp.sum(past.ended)
        mean = lambda x: jnp.sum(x * past.ended) / episodes  # noqa: E731
        report = Report(episodes, mean(info["episode_return"]), mean(info["episode_length"]))
        return training._replace(weights=weights, optimiser=optimiser), report

    def look(self, training: Training) -> tuple[jax.Array, jax.Array, jax.Array]:
        """The next memory, and the logits [N, actions] and values [N] of the current images."""
        seen = training.observation[None], training.first[None]
        memory, logits, value = self.network(training.weights, training.memory, *seen)
        return memory, logits[0], value[0]

    def act(self, training: Training, _: None) -> tuple[Training, tuple[Rollout, Any]]:
        """One step of all environments."""
        key, action_key, step_key = jax.random.split(training.key, 3)
        memory, logits, value = self.look(training)
        action = jax.random.categorical(action_key, logits)
        log_prob = jnp.take_along_axis(jax.nn.log_softmax(logits), action[:, None], 1)[:, 0]
        keys = jax.random.split(step_key, self.settings.envs)
        observation, state, reward, terminated, truncated, info = jax.vmap(
            self.env.step, (0, 0, 0, None)
        )(keys, training.state, action, self.params)
        # After the end of an episode, a step only resets, and its image is the first of an episode.
        chosen = ~training.state.done
        past = Rollout(
            training.observation, training.first, action, log_prob, value, reward, terminated,
            terminated | truncated, chosen,
        )  # fmt: skip
        after = training._replace(
            key=key, memory=memory, first=~chosen, observation=observation, state=state
        )
        return after, (past, info)

    def learn(
        self, training: Training, memory: jax.Array, past: Rollout, advantage: Any, key: Any
    ) -> tuple[Any, Any]:
        """Train for some epochs; `memory` is the memory before the rollout."""

        def descend(carry: tuple[Any, Any], rows: jax.Array) -> tuple[tuple[Any, Any], None]:
            weights, optimiser = carry
            batch = jax.tree.map(lambda x: x[:, rows], (past, advantage))
            gradient = jax.grad(self.loss)(weights, memory[rows], *batch)
            step, optimiser = self.optimiser.update(gradient, optimiser, weights)
            return (optax.apply_updates(weights, step), optimiser), None

        keys = jax.random.split(key, self.settings.epochs)
        orders = jax.vmap(lambda key: jax.random.permutation(key, self.settings.envs))(keys)
        rows = orders.reshape(self.settings.epochs * self.settings.minibatches, -1)
        return jax.lax.scan(descend, (training.weights, training.optimiser), rows)[0]

    def loss(self, weights: Any, memory: Any, past: Rollout, advantage: jax.Array) -> jax.Array:
        """PPO's clipped loss for whole sequences."""
        _, logits, value = self.network(weights, memory, past.observation, past.first)
        log_probs, s = jax.nn.log_softmax(logits), self.settings
        log_prob = jnp.take_along_axis(log_probs, past.action[..., None], -1)[..., 0]
        entropy = -jnp.sum(jnp.exp(log_probs) * log_probs, -1)
        mean = lambda x: jnp.sum(x * past.chosen) / jnp.sum(past.chosen)  # noqa: E731
        centred = advantage - mean(advantage)
        normal = centred / (jnp.sqrt(mean(centred**2)) + 0.01)
        ratio = jnp.exp(log_prob - past.log_prob)
        clipped = jnp.clip(ratio, 1 - s.clip, 1 + s.clip)
        policy_loss = -mean(jnp.minimum(ratio * normal, clipped * normal))
        value_loss = mean((value - past.value - advantage) ** 2) / 2
        return policy_loss + s.value_cost * value_loss - s.entropy_cost * mean(entropy)


def policy_of(network: Network, weights: Any) -> Any:
    """A policy for `jaxenstein.evaluate`, with the memory (h, first)."""

    def policy(weights: Any, carry: Any, obs: jax.Array, key: jax.Array) -> tuple[Any, jax.Array]:
        memory, first = carry
        memory, logits, _ = network(weights, memory[None], obs[None, None], first[None, None])
        return (memory[0], jnp.zeros_like(first)), jax.random.categorical(key, logits[0, 0])

    # Weights in a Partial become arguments of the compiled program, not constants.
    return jax.tree_util.Partial(policy, weights)
