"""Plays whole episodes with the networks of one or more runs."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from .. import evaluation
from ..evaluation import Playing, Taken
from .networks import ActorCritic
from .rollout import Actors, start
from .simulator import Simulator


def begin(
    simulator: Simulator, network: ActorCritic, key: jax.Array, runs: int, episodes: int
) -> Playing:
    """All episodes before their first step, [R, E]; the episodes of all runs start alike.

    The actors belong to `R * E` environments, ordered by run.
    """
    actors = start(simulator, network, jax.random.split(key)[0], episodes)
    actors = jax.tree.map(lambda leaf: jnp.concatenate([leaf] * runs), actors)
    return evaluation.unstarted(actors, (runs, episodes))


def advance(
    simulator: Simulator,
    network: ActorCritic,
    params: Any,
    key: jax.Array,
    playing: Playing,
    until: jax.Array,
    greedy: jax.Array,
) -> Playing:
    """Play until all episodes have ended, or `until` (int32[]) steps after the start.

    `params` have shape [R, ...]. `key` gives each run the same random numbers. With `greedy`
    (bool[]), the agents take the most likely action instead of sampling one.
    """
    play_key = jax.random.split(key)[1]
    runs, episodes = playing.running.shape

    def step(number: jax.Array, before: Actors) -> Taken:
        action_key, step_key = jax.random.split(jax.random.fold_in(play_key, number))
        apart = jax.tree.map(lambda leaf: leaf.reshape(runs, episodes, *leaf.shape[1:]), before)
        action, memory = jax.vmap(
            lambda params, actors: _choose(network, params, actors, action_key, greedy)
        )(params, apart)
        action = action.reshape(-1).astype(jnp.int32)
        keys = jnp.concatenate([jax.random.split(step_key, episodes)] * runs)
        outcome = simulator.step(keys, before.env_state, action)
        over = outcome.terminated | outcome.truncated
        actors = before.replace(
            env_state=outcome.state,
            obs=outcome.obs,
            previous=action,
            first=over,
            memory=memory.reshape(-1, *memory.shape[2:]),
        )
        told = outcome.reward, outcome.reached, over
        return Taken(actors, *(part.reshape(runs, episodes) for part in told))

    return evaluation.advance(step, playing, until)


def _choose(
    network: ActorCritic, params: Any, actors: Actors, key: jax.Array, greedy: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """The actions of the agents of one run, int32[E], and their next memory."""
    logits, _, memory = network.step(
        params, actors.obs, actors.previous, actors.first, actors.memory
    )
    sampled = jax.random.categorical(key, logits)
    return jnp.where(greedy, jnp.argmax(logits, axis=-1), sampled), memory
