"""The compiled calls of a batch of environments; what they keep and tell lies in rows of words."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import AxisType, Mesh, PartitionSpec

from .._jax.batching import select
from .._jax.packing import Packing
from ..environment import AnyEnvironment, outcome_of


def keys_of(seeds: Sequence[int]) -> jax.Array:
    """A key for each seed; seeds beyond 32 bits are folded in, without loss."""
    words = [(seed & 0xFFFFFFFF, seed >> 32) for seed in seeds]
    low, high = (jnp.asarray(np.array(part, np.uint32)) for part in zip(*words, strict=True))
    return jax.vmap(lambda a, b: jax.random.fold_in(jax.random.key(a), b))(low, high)


def mesh_for(num_envs: int) -> Mesh | None:
    """The cores to spread over, if there are several and they can be given equal shares."""
    count = jax.device_count()
    if jax.default_backend() != "cpu" or count == 1 or num_envs % count:
        return None
    return jax.make_mesh((count,), ("env",), axis_types=(AxisType.Auto,))


def _apart(mesh: Mesh | None, function: Callable[..., Any]) -> Callable[..., Any]:
    """A function of (rows, actions, numbers) on each device's rows and actions by themselves."""
    if mesh is None:
        return function
    env, everywhere = PartitionSpec("env"), PartitionSpec()
    # Nothing is exchanged, so there is nothing to check about what varies along the axis.
    return jax.shard_map(
        function, mesh=mesh, in_specs=(env, env, everywhere), out_specs=env, check_vma=False
    )


def layouts(env: AnyEnvironment, params: Any) -> tuple[Packing, Packing]:
    """Of an environment's stream and state, and of a step's outcome; compiles nothing."""

    def kept() -> Any:
        return jax.random.key(0), env.first_state(jax.random.key(0), params)

    def outcome(key: jax.Array, state: Any) -> Any:
        return outcome_of(env, key, key, state, jnp.int32(0), params)[2:]

    return Packing(kept), Packing(lambda: outcome(*kept()))


_compiled = functools.partial(jax.jit, static_argnums=(0, 1))


# A stream is a key that is split at every reset and at every step: one part is used, the other
# stays. So an environment samples the same whatever the number of its neighbours, and whether
# the batch or its caller makes the resets.


@_compiled
def reset(env: AnyEnvironment, kept: Packing, keys: jax.Array, params: Any) -> tuple[Any, ...]:
    """Begin an episode in each environment: rows, observations, info."""
    keys, used = _split(keys)
    observation, states = jax.vmap(env.reset, (0, None))(used, params)
    info = jax.vmap(env.describe, (0, None))(states, params)
    return jax.vmap(kept.pack)((keys, states)), observation, info


@_compiled
def reset_some(
    env: AnyEnvironment, kept: Packing, keys: jax.Array, states: Any, mask: jax.Array, params: Any
) -> tuple[Any, ...]:
    """Begin an episode where the mask says so: rows, observations, info."""
    after, used = _split(keys)
    fresh = jax.vmap(env.first_state, (0, None))(used, params)
    keys = jnp.where(mask, after, keys)
    states = jax.vmap(select)(mask, fresh, states)
    observation = jax.vmap(env.observe, (0, None))(states, params)
    info = jax.vmap(env.describe, (0, None))(states, params)
    return jax.vmap(kept.pack)((keys, states)), observation, info


# How a step is carried out, which is part of the program: over which devices, and the layouts of
# what is kept, of the outcome of a step, and of the params.
Plan = tuple[Mesh | None, Packing, Packing, Packing]


@_compiled
def step(
    env: AnyEnvironment, plan: Plan, rows: jax.Array, actions: jax.Array, numbers: jax.Array
) -> tuple[Any, ...]:
    """Step all; where `env.autoreset` is `"next-step"`, reset those whose last step ended."""
    mesh, kept, outcome, layout = plan

    def of_rows(rows: jax.Array, actions: jax.Array, numbers: jax.Array) -> tuple[Any, ...]:
        params = layout.unpack(numbers)
        keys, states = jax.vmap(kept.unpack)(rows)
        keys, used = _split(keys)
        # A reset takes the key that `restart` would take, the world's step that of other modes.
        steps, resets = _split(used)
        used = (steps, used if env.autoreset else resets)
        step = jax.vmap(functools.partial(outcome_of, env), (0, 0, 0, 0, None))
        states, _, *rest = step(*used, states, actions, params)
        observation = jax.vmap(env.observe, (0, None))(states, params)
        return jax.vmap(kept.pack)((keys, states)), observation, jax.vmap(outcome.pack)(tuple(rest))

    return _apart(mesh, of_rows)(rows, actions, numbers)


# The observations are given away, so that the frames of the others need not be copied.
@functools.partial(jax.jit, static_argnums=(0, 1), donate_argnums=3)
def restart(
    env: AnyEnvironment,
    kept: Packing,
    rows: jax.Array,
    observation: Any,
    indices: jax.Array,
    params: Any,
) -> tuple[Any, ...]:
    """Begin one in the environments `indices`: rows, observations, the last ones, info."""
    final = jax.tree.map(lambda leaf: leaf[indices], observation)
    after, used = _split(jax.vmap(kept.unpack)(rows[indices])[0])
    first, fresh = jax.vmap(env.reset, (0, None))(used, params)
    rows, observation = jax.tree.map(
        lambda every, some: every.at[indices].set(some),
        (rows, observation),
        (jax.vmap(kept.pack)((after, fresh)), first),
    )
    return rows, observation, final, jax.vmap(env.describe, (0, None))(fresh, params)


def _split(keys: jax.Array) -> tuple[jax.Array, jax.Array]:
    """What stays of each stream, and a key of each to use."""
    split = jax.vmap(jax.random.split)(keys)
    return split[:, 0], split[:, 1]
