"""Playing whole episodes with a fixed policy."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from ...pytree import PyTreeNode
from .networks import ActorCritic
from .rollout import Actors, start
from .simulator import Simulator


class Evaluation(PyTreeNode):
    """Episodes, each from its beginning to its end: long ones count as much as short ones.

    Attributes:
        episode_return: float32[E], undiscounted.
        episode_length: int32[E], steps.
        success: bool[E], whether the task's aim was reached.
        terminated: bool[E], whether the task ended the episode, not the time limit.
    """

    episode_return: jax.Array
    episode_length: jax.Array
    success: jax.Array
    terminated: jax.Array


class Playing(PyTreeNode):
    """Episodes that are being played.

    Attributes:
        steps: int32[], taken so far.
        actors: of `E` environments.
        running: bool[E], whose first episode goes on.
        result: of the episodes so far.
    """

    steps: jax.Array
    actors: Actors
    running: jax.Array
    result: Evaluation


def begin(simulator: Simulator, network: ActorCritic, key: jax.Array, episodes: int) -> Playing:
    """One episode in each of `episodes` environments, before its first step."""
    actors = start(simulator, network, jax.random.split(key)[0], episodes)
    nothing = Evaluation(
        episode_return=jnp.zeros(episodes, jnp.float32),
        episode_length=jnp.zeros(episodes, jnp.int32),
        success=jnp.zeros(episodes, bool),
        terminated=jnp.zeros(episodes, bool),
    )
    return Playing(jnp.int32(0), actors, jnp.ones(episodes, bool), nothing)


def advance(
    simulator: Simulator,
    network: ActorCritic,
    params: Any,
    key: jax.Array,
    playing: Playing,
    until: Any,
    greedy: bool,
) -> Playing:
    """Play on until the last episode ends, or so many steps have been taken since the beginning."""
    play_key = jax.random.split(key)[1]

    def body(before: Playing) -> Playing:
        running, result = before.running, before.result
        action_key, step_key = jax.random.split(jax.random.fold_in(play_key, before.steps))
        actors, reward, outcome = _step(
            simulator, network, params, before.actors, action_key, step_key, greedy
        )
        result = Evaluation(
            episode_return=result.episode_return + jnp.where(running, reward, 0),
            episode_length=result.episode_length + running.astype(jnp.int32),
            success=result.success | (running & outcome.reached),
            terminated=result.terminated | (running & outcome.terminated),
        )
        running = running & ~(outcome.terminated | outcome.truncated)
        return Playing(before.steps + 1, actors, running, result)

    return jax.lax.while_loop(lambda p: jnp.any(p.running) & (p.steps < until), body, playing)


def evaluate(
    simulator: Simulator,
    network: ActorCritic,
    params: Any,
    key: jax.Array,
    episodes: int,
    greedy: bool,
) -> Evaluation:
    """Play one episode in each of `episodes` environments, until the last one ends."""
    playing = begin(simulator, network, key, episodes)
    forever = jnp.int32(jnp.iinfo(jnp.int32).max)
    return advance(simulator, network, params, key, playing, forever, greedy).result


def _step(
    simulator: Simulator,
    network: ActorCritic,
    params: Any,
    actors: Actors,
    action_key: jax.Array,
    step_key: jax.Array,
    greedy: bool,
) -> tuple[Actors, jax.Array, Any]:
    logits, _, memory = network.step(
        params, actors.obs, actors.previous, actors.first, actors.memory
    )
    action = jnp.argmax(logits, axis=-1) if greedy else jax.random.categorical(action_key, logits)
    action = action.astype(jnp.int32)
    keys = jax.random.split(step_key, action.shape[0])
    outcome = simulator.step(keys, actors.env_state, action)
    actors = actors.replace(
        env_state=outcome.state,
        obs=outcome.obs,
        previous=action,
        first=outcome.terminated | outcome.truncated,
        memory=memory,
    )
    return actors, outcome.reward, outcome
