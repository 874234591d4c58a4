"""Playing whole episodes with a fixed policy."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from ..pytree import PyTreeNode
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
    """Unfinished episodes, E of each of R runs.

    Attributes:
        steps: int32[], taken so far.
        actors: of `R * E` environments, run after run.
        running: bool[R, E], whether the episode has not ended.
        result: [R, E], of the episodes so far.
    """

    steps: jax.Array
    actors: Actors
    running: jax.Array
    result: Evaluation


def begin(
    simulator: Simulator, network: ActorCritic, key: jax.Array, runs: int, episodes: int
) -> Playing:
    """Every episode before its first step; those of all runs begin alike."""
    actors = start(simulator, network, jax.random.split(key)[0], episodes)
    actors = jax.tree.map(lambda leaf: jnp.concatenate([leaf] * runs), actors)
    shape = runs, episodes
    nothing = Evaluation(
        episode_return=jnp.zeros(shape, jnp.float32),
        episode_length=jnp.zeros(shape, jnp.int32),
        success=jnp.zeros(shape, bool),
        terminated=jnp.zeros(shape, bool),
    )
    return Playing(jnp.int32(0), actors, jnp.ones(shape, bool), nothing)


def advance(
    simulator: Simulator,
    network: ActorCritic,
    params: Any,
    key: jax.Array,
    playing: Playing,
    until: jax.Array,
    greedy: jax.Array,
) -> Playing:
    """Play until the last episode ends, or `until` (int32[]) steps have been taken from the start.

    `params` are [R, ...]; `key` gives each run the same random numbers; with `greedy` (bool[]) the
    agents take the most likely action instead of sampling one.
    """
    play_key = jax.random.split(key)[1]

    def body(before: Playing) -> Playing:
        running, result = before.running, before.result
        action_key, step_key = jax.random.split(jax.random.fold_in(play_key, before.steps))
        runs, episodes = running.shape
        apart = jax.tree.map(
            lambda leaf: leaf.reshape(runs, episodes, *leaf.shape[1:]), before.actors
        )
        action, memory = jax.vmap(
            lambda params, actors: _choose(network, params, actors, action_key, greedy)
        )(params, apart)
        action = action.reshape(-1).astype(jnp.int32)
        keys = jnp.concatenate([jax.random.split(step_key, episodes)] * runs)
        outcome = simulator.step(keys, before.actors.env_state, action)
        over = outcome.terminated | outcome.truncated
        actors = before.actors.replace(
            env_state=outcome.state,
            obs=outcome.obs,
            previous=action,
            first=over,
            memory=memory.reshape(-1, *memory.shape[2:]),
        )
        reward, reached, terminated, over = (
            part.reshape(runs, episodes)
            for part in (outcome.reward, outcome.reached, outcome.terminated, over)
        )
        result = Evaluation(
            episode_return=result.episode_return + jnp.where(running, reward, 0),
            episode_length=result.episode_length + running.astype(jnp.int32),
            success=result.success | (running & reached),
            terminated=result.terminated | (running & terminated),
        )
        return Playing(before.steps + 1, actors, running & ~over, result)

    return jax.lax.while_loop(lambda p: jnp.any(p.running) & (p.steps < until), body, playing)


def _choose(
    network: ActorCritic, params: Any, actors: Actors, key: jax.Array, greedy: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """The actions of one run's agents, int32[E], and their memory."""
    logits, _, memory = network.step(
        params, actors.obs, actors.previous, actors.first, actors.memory
    )
    sampled = jax.random.categorical(key, logits)
    return jnp.where(greedy, jnp.argmax(logits, axis=-1), sampled), memory
