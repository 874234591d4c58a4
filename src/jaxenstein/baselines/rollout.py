"""Collects rollouts: `T` steps in `N` environments with the current policy."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from ..pytree import PyTreeNode
from .networks import ActorCritic
from .simulator import Outcome, Simulator, at_times

Sums = dict[str, jax.Array]


class Actors(PyTreeNode):
    """The environments between two steps, and the memory of the policy in each.

    Attributes:
        env_state: states of the environments.
        obs: current observations.
        previous: int32[N], the last actions.
        first: bool[N], whether `obs` is the first observation of an episode; `previous` and
            `memory` then belong to the episode before, and the network ignores them.
        memory: float32[N, hidden], the recurrent state before `obs`.
        episode_return: float32[N], undiscounted return of the episode so far.
        episode_length: int32[N], steps in the episode so far.
        reached: bool[N], whether the episode has reached the task's aim.
    """

    env_state: Any
    obs: Any
    previous: jax.Array
    first: jax.Array
    memory: jax.Array
    episode_return: jax.Array
    episode_length: jax.Array
    reached: jax.Array


class Steps(PyTreeNode):
    """The steps of a rollout; every leaf has leading axes [T, N].

    Attributes:
        obs: observations before each step.
        previous: int32, the actions before `obs`.
        first: bool, whether `obs` is the first observation of an episode.
        action: int32.
        log_prob: float32, log-probability of the action.
        value: float32[T, N, V].
        reward: float32.
        terminated: bool, whether the task ended the episode.
        truncated: bool, whether only the time limit did.
    """

    obs: Any
    previous: jax.Array
    first: jax.Array
    action: jax.Array
    log_prob: jax.Array
    value: jax.Array
    reward: jax.Array
    terminated: jax.Array
    truncated: jax.Array

    @property
    def ended(self) -> jax.Array:
        """bool[T, N], terminated or truncated."""
        return self.terminated | self.truncated


class Finals(PyTreeNode):
    """The first few truncations of each environment in a rollout.

    Attributes:
        time: int32[N, K], the step of each truncation; `T` in empty slots.
        count: int32[N], number of truncations.
        final: as `Outcome.final`, with leading axes [N, K].
        action: int32[N, K], the last action of each episode.
        memory: float32[N, K, hidden], the recurrent state before the last observation.
    """

    time: jax.Array
    count: jax.Array
    final: Any
    action: jax.Array
    memory: jax.Array


def start(
    simulator: Simulator,
    network: ActorCritic,
    key: jax.Array,
    batch: int,
    clocks: tuple[Any, int] | None = None,
) -> Actors:
    """Reset `batch` environments.

    With `clocks`, (most steps in an episode, world steps per step), the clock of each state starts
    at a random step of the episode.
    """
    reset_key, clock_key = jax.random.split(key)
    obs, state = simulator.reset(jax.random.split(reset_key, batch))
    if clocks is not None:
        most, each = clocks
        steps = jax.random.randint(clock_key, (batch,), 0, jnp.maximum(most, 1), jnp.int32)
        state = at_times(state, steps * each)
        # What a task shows may depend on its clock.
        obs = simulator.final_observation(simulator.final_of(obs, state))
    return Actors(
        env_state=state,
        obs=obs,
        previous=jnp.full(batch, -1, jnp.int32),
        first=jnp.ones(batch, bool),
        memory=network.initial_memory(batch),
        episode_return=jnp.zeros(batch, jnp.float32),
        # Counts steps played, even if the clock starts later.
        episode_length=jnp.zeros(batch, jnp.int32),
        reached=jnp.zeros(batch, bool),
    )


def rollout(
    simulator: Simulator,
    network: ActorCritic,
    params: Any,
    key: jax.Array,
    actors: Actors,
    length: int,
    slots: int,
) -> tuple[Actors, Steps, Finals, Sums]:
    """Play `length` steps, `T`, in each environment, starting from `actors`.

    `slots`, `K`, is the number of truncations to keep for each environment.

    Returns:
        The next actors, the steps, the truncations, and sums over the episodes that ended:
        `episodes` (their number), `return_sum`, `return_square_sum`, `length_sum` and `successes`.
    """
    batch = actors.first.shape[0]

    def step(carry: Any, index_and_key: Any) -> tuple[Any, Steps]:
        actors, finals, sums = carry
        index, key = index_and_key
        action_key, step_key = jax.random.split(key)
        logits, value, memory = network.step(
            params, actors.obs, actors.previous, actors.first, actors.memory
        )
        action = jax.random.categorical(action_key, logits).astype(jnp.int32)
        outcome = simulator.step(jax.random.split(step_key, batch), actors.env_state, action)
        taken = Steps(
            obs=actors.obs,
            previous=actors.previous,
            first=actors.first,
            action=action,
            log_prob=log_prob(logits, action),
            value=value,
            reward=outcome.reward,
            terminated=outcome.terminated,
            truncated=outcome.truncated,
        )
        if slots:
            finals = _remember(finals, index, outcome, action, memory)
        actors, ended = _follow(actors, outcome, action, memory)
        return (actors, finals, jax.tree.map(jnp.add, sums, ended)), taken

    keys = jax.random.split(key, length)
    finals = _empty_finals(simulator, actors, length, slots)
    none, zero = jnp.int32(0), jnp.float32(0)
    sums = {"episodes": none, "return_sum": zero, "return_square_sum": zero, "length_sum": none,
            "successes": none}  # fmt: skip
    (actors, finals, sums), steps = jax.lax.scan(
        step, (actors, finals, sums), (jnp.arange(length, dtype=jnp.int32), keys)
    )
    return actors, steps, finals, sums


def log_prob(logits: jax.Array, action: jax.Array) -> jax.Array:
    """float[...], log-probability of int[...] actions under logits [..., A]."""
    log_probs = jax.nn.log_softmax(logits)
    return jnp.take_along_axis(log_probs, action[..., None], axis=-1)[..., 0]


def final_values(
    simulator: Simulator, network: ActorCritic, params: Any, finals: Finals, length: int
) -> jax.Array:
    """Values of the last observations of truncated episodes, float32[T, N, V]; zero elsewhere."""
    batch, slots = finals.time.shape
    merge = lambda leaf: leaf.reshape(batch * slots, *leaf.shape[2:])  # noqa: E731
    obs = simulator.final_observation(jax.tree.map(merge, finals.final))
    action, memory = merge(finals.action), merge(finals.memory)
    never = jnp.zeros(batch * slots, bool)
    _, value, _ = network.step(params, obs, action, never, memory)
    value = value.reshape(batch, slots, -1)
    environment = jnp.broadcast_to(jnp.arange(batch, dtype=jnp.int32)[:, None], finals.time.shape)
    zeros = jnp.zeros((length, batch, value.shape[-1]), value.dtype)
    return zeros.at[finals.time, environment].set(value, mode="drop")


def _follow(
    actors: Actors, outcome: Outcome, action: jax.Array, memory: jax.Array
) -> tuple[Actors, Sums]:
    """The next actors, and sums over the episodes that the step ended."""
    ended = outcome.terminated | outcome.truncated
    total = actors.episode_return + outcome.reward
    steps = actors.episode_length + 1
    reached = actors.reached | outcome.reached
    sums = {
        "episodes": jnp.sum(ended, dtype=jnp.int32),
        "return_sum": jnp.sum(jnp.where(ended, total, 0)),
        "return_square_sum": jnp.sum(jnp.where(ended, total**2, 0)),
        "length_sum": jnp.sum(jnp.where(ended, steps, 0), dtype=jnp.int32),
        "successes": jnp.sum(ended & reached, dtype=jnp.int32),
    }
    actors = Actors(
        env_state=outcome.state,
        obs=outcome.obs,
        previous=action,
        first=ended,
        memory=memory,
        episode_return=jnp.where(ended, 0, total),
        episode_length=jnp.where(ended, 0, steps),
        reached=reached & ~ended,
    )
    return actors, sums


def _empty_finals(simulator: Simulator, actors: Actors, length: int, slots: int) -> Finals:
    """Empty slots for truncations, filled with the current states so that they can be rendered."""
    batch = actors.first.shape[0]

    def fill(leaf: jax.Array) -> jax.Array:
        return jnp.broadcast_to(leaf[:, None], (batch, slots, *leaf.shape[1:]))

    return Finals(
        time=jnp.full((batch, slots), length, jnp.int32),
        count=jnp.zeros(batch, jnp.int32),
        final=jax.tree.map(fill, simulator.final_of(actors.obs, actors.env_state)),
        action=fill(actors.previous),
        memory=fill(actors.memory),
    )


def _remember(
    finals: Finals, index: jax.Array, outcome: Outcome, action: jax.Array, memory: jax.Array
) -> Finals:
    """Store the truncations of this step."""

    def put(slots: jax.Array, new: jax.Array, place: jax.Array, wanted: jax.Array) -> jax.Array:
        return slots.at[place].set(jnp.where(wanted, new, slots[place]))

    place = jnp.minimum(finals.count, finals.time.shape[1] - 1)
    new = (jnp.full_like(action, index), outcome.final, action, memory)
    old = (finals.time, finals.final, finals.action, finals.memory)
    time, final, action, memory = jax.tree.map(
        lambda slots, leaf: jax.vmap(put)(slots, leaf, place, outcome.truncated), old, new
    )
    count = finals.count + outcome.truncated.astype(jnp.int32)
    return Finals(time, count, final, action, memory)
