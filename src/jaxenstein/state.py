"""States, the outcome of a step, and actions repeated over several world steps."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any, Generic, NamedTuple, TypeVar

import jax
import jax.numpy as jnp

from ._jax.batching import select, varying
from .pytree import PyTreeNode

Info = dict[str, Any]


class State(PyTreeNode):
    """The base of all states; a task's `init_state` leaves the last four fields to the base class.

    Attributes:
        position: float32[2], (x, y) in tiles: x along a row of the map, y down the rows.
        heading: float32[], radians in [0, 2 pi), 0 along +x, growing clockwise on the map.
        time: int32[], world steps since the reset.
        episode_return: float32[], undiscounted sum of rewards since the reset.
        done: bool[], whether the last step ended the episode. With `"same-step"` resets, `step`
            never returns a state in which it is true.
        look: uint32[], the seed of the textures and colours of this episode; None if they do not
            vary.
    """

    position: jax.Array
    heading: jax.Array
    time: jax.Array = dataclasses.field(default_factory=lambda: jnp.int32(0), kw_only=True)
    episode_return: jax.Array = dataclasses.field(
        default_factory=lambda: jnp.float32(0), kw_only=True
    )
    done: jax.Array = dataclasses.field(default_factory=lambda: jnp.bool_(0), kw_only=True)
    look: jax.Array | None = dataclasses.field(default=None, kw_only=True)


S = TypeVar("S", bound=State)
Advanced = tuple[S, jax.Array, jax.Array, Info]
"""state, float32[] reward, bool[] terminated, events."""


class Outcome(NamedTuple, Generic[S]):
    """The outcome of an action, without an observation.

    Attributes:
        state: the state to act in next; after a reset, the first state of an episode.
        final: the state that the action led to, before any reset.
        reward: float32[].
        terminated: bool[], whether the task ended the episode.
        truncated: bool[], whether the time limit ended the episode.
        info: as in `Environment.step`, without observations.
    """

    state: S
    final: S
    reward: jax.Array
    terminated: jax.Array
    truncated: jax.Array
    info: Info


def repeated(
    once: Callable[..., Advanced[S]], count: int, key: jax.Array, state: S, *given: Any
) -> Advanced[S]:
    """Take `count` world steps, or fewer if the episode ends; add up rewards and events.

    Args:
        once: takes one world step; a function of key, state and `given`.
        count: at least 1; with 2 or more, the key is split into one key per step.
        key: the random key of all steps.
        state: the state to start from.
        *given: further arguments, the same for each step.
    """
    if count == 1:
        return once(key, state, *given)

    def nothing(leaf: jax.ShapeDtypeStruct) -> jax.Array:
        return jnp.zeros(leaf.shape, leaf.dtype)

    def step(carry: Any, key: jax.Array) -> tuple[Any, None]:
        over, state, reward, _, events = carry
        after, more, terminated, happened = once(key, state, *given)
        # Combine the events of two steps: logical or for bools, sums for numbers.
        events = jax.tree.map(jnp.add, events, happened)
        new = after.done, after, reward + more, terminated, events
        return select(over, carry, new), None

    keys = jax.random.split(key, count)
    shapes = jax.eval_shape(once, keys[0], state, *given)
    # If the episode has already ended, take one step, as `Environment.step` does.
    start = jnp.bool_(False), state, *jax.tree.map(nothing, shapes[1:])
    start = varying(start, key, state, *given)
    return jax.lax.scan(step, start, keys)[0][1:]
