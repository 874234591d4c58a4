"""States, the outcome of a step, and one action held for several steps of the world."""

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
    """What every state has; `init_state` leaves the last four to the base.

    Attributes:
        position: float32[2], (x, y) in tiles: x along a row of the map, y down the rows.
        heading: float32[], radians in [0, 2 pi), 0 along +x, growing clockwise on the map.
        time: int32[], steps since the reset.
        episode_return: float32[], undiscounted sum of rewards since the reset.
        done: bool[], whether the last step ended the episode. `step` with `"same-step"` resets
            never shows a state where it is true.
        look: uint32[], the seed of how the world looks in this episode; None where that does not
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
    """What an action led to, without an observation of it.

    Attributes:
        state: the state to act in next: a first state where the step reset.
        final: the state that the action led to, before a reset.
        reward: float32[].
        terminated: bool[], the task's own end.
        truncated: bool[], the time limit.
        info: as of `Environment.step`, without observations.
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
    """Take `count` steps of the world, fewer where the episode ends: rewards and events add up.

    Args:
        once: a function of key, state and `given`: one step of the world.
        count: at least 1; from 2 on each step has a key of its own.
        key: of all of them.
        state: to begin with.
        *given: the same for each of them.
    """
    if count == 1:
        return once(key, state, *given)

    def nothing(leaf: jax.ShapeDtypeStruct) -> jax.Array:
        return jnp.zeros(leaf.shape, leaf.dtype)

    def step(carry: Any, key: jax.Array) -> tuple[Any, None]:
        over, state, reward, _, events = carry
        after, more, terminated, happened = once(key, state, *given)
        # A bool of two events tells of either, a number of both.
        events = jax.tree.map(jnp.add, events, happened)
        new = after.done, after, reward + more, terminated, events
        return select(over, carry, new), None

    keys = jax.random.split(key, count)
    shapes = jax.eval_shape(once, keys[0], state, *given)
    # Where the episode is over already, it goes on for one step, as everywhere.
    start = jnp.bool_(False), state, *jax.tree.map(nothing, shapes[1:])
    start = varying(start, key, state, *given)
    return jax.lax.scan(step, start, keys)[0][1:]
