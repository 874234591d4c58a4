"""The compiled functions of a batch; state and results are packed into rows of words."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import AxisType, Mesh, PartitionSpec

from .. import ranged
from .._jax.batching import select
from .._jax.packing import Packing
from .._jax.staging import staged
from ..environment import AnyEnvironment
from ..seeds import key_of


def keys_of(seeds: Sequence[int]) -> jax.Array:
    """A random key for each seed; seeds beyond 32 bits are folded in without loss."""
    words = [(seed & 0xFFFFFFFF, seed >> 32) for seed in seeds]
    return _keys_of(*(np.array(part, np.uint32) for part in zip(*words, strict=True)))


# Compiled whole, as are the functions for layouts below: a call of its own for each of their
# operations takes longer to compile.
@jax.jit
def _keys_of(low: jax.Array, high: jax.Array) -> jax.Array:
    return jax.vmap(lambda a, b: jax.random.fold_in(key_of(a), b))(low, high)


@functools.partial(jax.jit, static_argnums=0)
def packed(layout: Packing, tree: Any) -> jax.Array:
    """uint32[words]: a tree, packed."""
    return layout.pack(tree)


@functools.partial(jax.jit, static_argnums=0)
def unpacked(layout: Packing, rows: jax.Array) -> Any:
    """The trees of uint32[N, words], with a leading axis N."""
    return jax.vmap(layout.unpack)(rows)


def mesh_for(num_envs: int) -> Mesh | None:
    """A mesh over the CPU cores, if there are several and their number divides `num_envs`."""
    count = jax.device_count()
    if jax.default_backend() != "cpu" or count == 1 or num_envs % count:
        return None
    return jax.make_mesh((count,), ("env",), axis_types=(AxisType.Auto,))


def _on_each_device(
    mesh: Mesh | None,
    function: Callable[..., Any],
    rows: jax.Array,
    actions: jax.Array,
    numbers: jax.Array,
) -> Any:
    """Apply a function to rows, actions and numbers, on each device separately."""
    if mesh is None:
        return function(rows, actions, numbers)
    env = PartitionSpec("env")
    each = env if numbers.ndim == 2 else PartitionSpec()
    # Devices exchange nothing, so there is no variation along the axis to check.
    return jax.shard_map(
        function, mesh=mesh, in_specs=(env, env, each), out_specs=env, check_vma=False
    )(rows, actions, numbers)


def _over(
    function: Callable[..., Any],
    env: AnyEnvironment,
    layout: Packing,
    numbers: jax.Array,
    *args: Any,
) -> Any:
    """Map a function over the arguments and params of all environments.

    Args:
        function: takes the environment, the arguments of one environment and then its params.
        env: the environment.
        layout: the layout of the params of one environment, with ranges.
        numbers: the packed params: uint32[words] for all, or uint32[N, words], a row for each.
        *args: pytrees with a leading axis N.
    """

    def of_one(numbers: jax.Array, *args: Any) -> Any:
        return function(env, *args, layout.unpack(numbers))

    return jax.vmap(of_one, (0 if numbers.ndim == 2 else None, *(0 for _ in args)))(numbers, *args)


def layouts(env: AnyEnvironment, numbers: Packing) -> tuple[Packing, Packing]:
    """The layouts of an environment's stream and state, and of a step's outcome; traced only.

    Args:
        env: the environment.
        numbers: the layout of its params.
    """

    def params() -> Any:
        return numbers.unpack(jnp.zeros(numbers.words, jnp.uint32))

    def kept() -> Any:
        key = key_of(0)
        return key, ranged.first_state(env, key, params())

    def outcome(key: jax.Array, drawn: Any) -> Any:
        return ranged.outcome(env, key, key, drawn, jnp.int32(0), params())[2:]

    return Packing(kept), Packing(lambda: outcome(*kept()))


_compiled = functools.partial(jax.jit, static_argnums=(0, 1))


# A stream is a key that is split at every reset and step into a key to use and a key to keep. So
# the samples of an environment depend neither on the number of environments nor on whether the
# batch or its caller resets.


# Static arguments of a call: the mesh, and the layouts of stream and state, of the outcome of a
# step, and of the params.
Plan = tuple[Mesh | None, Packing, Packing, Packing]


@_compiled
def reset(env: AnyEnvironment, plan: Plan, keys: jax.Array, numbers: jax.Array) -> tuple[Any, ...]:
    """Start an episode in each environment: rows, observations, info."""
    _, kept, _, layout = plan
    keys, used = _split(keys)
    states = _over(ranged.first_state, env, layout, numbers, used)
    observation = _over(ranged.observe, env, layout, numbers, states)
    info = _over(ranged.describe, env, layout, numbers, states)
    return jax.vmap(kept.pack)((keys, states)), observation, info


@_compiled
def reset_some(
    env: AnyEnvironment,
    plan: Plan,
    keys: jax.Array,
    states: Any,
    mask: jax.Array,
    numbers: jax.Array,
) -> tuple[Any, ...]:
    """Start an episode where the mask is true: rows, observations, info."""
    _, kept, _, layout = plan
    after, used = _split(keys)
    fresh = _over(ranged.first_state, env, layout, numbers, used)
    keys = jnp.where(mask, after, keys)
    states = jax.vmap(select)(mask, fresh, states)
    observation = _over(ranged.observe, env, layout, numbers, states)
    info = _over(ranged.describe, env, layout, numbers, states)
    return jax.vmap(kept.pack)((keys, states)), observation, info


@_compiled
def step(
    env: AnyEnvironment, plan: Plan, rows: jax.Array, actions: jax.Array, numbers: jax.Array
) -> tuple[Any, ...]:
    """Step all; with `env.autoreset` "next-step", reset those whose last step ended."""
    mesh, kept, outcome, layout = plan

    def rules(
        rows: jax.Array, actions: jax.Array, numbers: jax.Array
    ) -> tuple[jax.Array, jax.Array]:
        keys, states = jax.vmap(kept.unpack)(rows)
        keys, used = _split(keys)
        # With "next-step", steps and resets use the keys that they have in the other modes.
        steps, resets = _split(used)
        used = (steps, used if env.autoreset else resets)
        states, _, *rest = _over(ranged.outcome, env, layout, numbers, *used, states, actions)
        return jax.vmap(kept.pack)((keys, states)), jax.vmap(outcome.pack)(tuple(rest))

    def of_rows(rows: jax.Array, actions: jax.Array, numbers: jax.Array) -> tuple[Any, ...]:
        # One environment has many small kernels. As a stage, those of the rules run one after
        # another instead of through the scheduler, which takes longer than they do.
        run = staged(rules) if rows.shape[0] == 1 else rules
        rows, told = run(rows, actions, numbers)
        states = jax.vmap(kept.unpack)(rows)[1]
        return rows, _over(ranged.observe, env, layout, numbers, states), told

    return _on_each_device(mesh, of_rows, rows, actions, numbers)


# The observations are donated, so that the frames of other environments are not copied.
@functools.partial(jax.jit, static_argnums=(0, 1), donate_argnums=3)
def restart(
    env: AnyEnvironment,
    plan: Plan,
    rows: jax.Array,
    observation: Any,
    indices: jax.Array,
    numbers: jax.Array,
) -> tuple[Any, ...]:
    """Start an episode in the environments `indices`: rows, observations, last ones, info."""
    _, kept, _, layout = plan
    if numbers.ndim == 2:
        numbers = numbers[indices]
    final = jax.tree.map(lambda leaf: leaf[indices], observation)
    after, used = _split(jax.vmap(kept.unpack)(rows[indices])[0])
    fresh = _over(ranged.first_state, env, layout, numbers, used)
    first = _over(ranged.observe, env, layout, numbers, fresh)
    rows, observation = jax.tree.map(
        lambda every, some: every.at[indices].set(some),
        (rows, observation),
        (jax.vmap(kept.pack)((after, fresh)), first),
    )
    return rows, observation, final, _over(ranged.describe, env, layout, numbers, fresh)


@_compiled
def observe(env: AnyEnvironment, layout: Packing, states: Any, numbers: jax.Array) -> Any:
    """The observation of each environment."""
    return _over(ranged.observe, env, layout, numbers, states)


def _split(keys: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Split each stream into a stream to keep and a key to use."""
    split = jax.vmap(jax.random.split)(keys)
    return split[:, 0], split[:, 1]
