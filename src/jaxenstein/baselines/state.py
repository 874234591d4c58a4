"""The state of a run: its arrays, random keys, and placement on devices."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import AxisType, NamedSharding, PartitionSpec

from ..errors import SettingError
from ..pytree import PyTreeNode
from ..seeds import IMPLEMENTATION
from .bonus import PER_ENVIRONMENT, RunningScale
from .config import Config
from .rollout import Actors


class TrainState(PyTreeNode):
    """A run between two updates: a pytree with all arrays needed to continue.

    Attributes:
        key: uint32[2], data of the random key for the next updates.
        update: int32[], number of updates so far.
        params: parameters of the policy and value network.
        optimiser: their Adam state.
        bonus: state of the exploration bonus.
        scale: scale of the bonus; None without `normalise_bonus`.
        reward_scale: scale of the rewards; None without `normalise_rewards`.
        recent: float32[], mean success of recent episodes, fixed once it reaches `stop_success`;
            None without `stop_success`.
        actors: the environments, and the policy's memory in each.
        diverged: int32[], 0 while all numbers are finite. After a divergence, its bits name the
            `divergence.PARTS` that were not finite, and no other field changes any more. None if
            `on_divergence` is `"continue"`.
    """

    key: jax.Array
    update: jax.Array
    params: Any
    optimiser: Any
    bonus: Any
    scale: RunningScale | None
    reward_scale: RunningScale | None
    recent: jax.Array | None
    actors: Actors = dataclasses.field(metadata=PER_ENVIRONMENT)
    diverged: jax.Array | None = None


def key_data(key: jax.Array) -> jax.Array:
    """The raw data of a typed or raw key.

    Raises:
        SettingError: the key does not use JAX's default implementation, threefry2x32.
    """
    key = jnp.asarray(key)
    data = jax.random.key_data(key) if jnp.issubdtype(key.dtype, jax.dtypes.prng_key) else key
    if data.shape[-1:] != (2,):
        raise SettingError(
            f"a key must be a {IMPLEMENTATION} key, from jax.random.key(seed, "
            f"impl={IMPLEMENTATION!r}), not {key.dtype}{list(key.shape)}"
        )
    return data


def wrap_key(data: jax.Array) -> jax.Array:
    """The typed key of raw data."""
    return jax.random.wrap_key_data(data, impl=IMPLEMENTATION)


def per_environment(tree: Any) -> Any:
    """A tree of bools: whether the first axis of each leaf is the environments.

    Dataclass fields, at any depth, declare this with `PER_ENVIRONMENT`.
    """
    if not isinstance(tree, PyTreeNode):
        return jax.tree.map(
            lambda node: isinstance(node, PyTreeNode) and per_environment(node),
            tree,
            is_leaf=lambda node: isinstance(node, PyTreeNode),
        )
    parts = {}
    for field in dataclasses.fields(tree):  # type: ignore[arg-type]
        part = getattr(tree, field.name)
        if "per_environment" in field.metadata:
            parts[field.name] = jax.tree.map(lambda _: True, part)
        elif "static" not in field.metadata:
            parts[field.name] = per_environment(part)
    return tree.replace(**parts)


def place(state: TrainState, config: Config, devices: Sequence[Any] | None = None) -> TrainState:
    """Spread the state of one or more runs over devices.

    All functions of a learner accept the result: JAX derives from the placement where each
    computation runs. If `Config.shards` is the number of devices, the devices exchange only sums
    for gradients and statistics, no frames.

    If the number of runs is a multiple of the number of devices, each device gets some runs.
    Otherwise, if `shards` is such a multiple, each device gets some environments of every run. If
    neither is, the first device does all the work, and a warning says so.

    If the devices belong to several processes, each process passes the same state.

    Args:
        state: the state of one run, or of several runs along a leading axis.
        config: the config of the learner.
        devices: all devices of all processes by default.

    Raises:
        SettingError: the devices belong to several processes, and neither number is a multiple.
    """
    devices = list(devices or jax.devices())
    size, runs = len(devices), state.update.shape
    check_spread(runs[0] if runs else 1, config)
    if size == 1:
        return state
    mesh = jax.make_mesh((size,), ("device",), axis_types=(AxisType.Auto,), devices=devices)
    if runs and runs[0] % size == 0:
        return _put(state, NamedSharding(mesh, PartitionSpec("device")))
    if config.shards % size:
        several = f"the number of runs, {runs[0]}, or " if runs else ""
        warnings.warn(
            f"only one of {size} devices is used: to use all, {several}shards must be a multiple "
            f"of {size}",
            stacklevel=2,
        )
        return state
    everywhere = NamedSharding(mesh, PartitionSpec())
    apart = NamedSharding(mesh, PartitionSpec(*(None for _ in runs), "device"))
    where = jax.tree.map(lambda inside: apart if inside else everywhere, per_environment(state))
    return _put(state, where)


def check_spread(runs: int, config: Config) -> None:
    """Check that several processes can share the work.

    Raises:
        SettingError: the number of their devices divides neither the number of runs nor `shards`.
    """
    size, processes = jax.device_count(), jax.process_count()
    if processes > 1 and runs % size and config.shards % size:
        raise SettingError(
            f"{processes} processes have {size} devices: the number of runs, {runs}, or shards, "
            f"{config.shards}, must be a multiple of {size}"
        )


def _put(state: Any, where: Any) -> Any:
    """`jax.device_put`, also if the devices belong to several processes."""
    if jax.process_count() == 1:
        return jax.device_put(state, where)

    def put(leaf: Any, where: NamedSharding) -> jax.Array:
        if jnp.issubdtype(leaf.dtype, jax.dtypes.prng_key):
            data = put(jax.random.key_data(leaf), where)
            return jax.random.wrap_key_data(data, impl=str(jax.random.key_impl(leaf)))
        whole = np.asarray(leaf)
        return jax.make_array_from_callback(whole.shape, where, lambda index: whole[index])

    if isinstance(where, NamedSharding):
        return jax.tree.map(lambda leaf: put(leaf, where), state)
    return jax.tree.map(put, state, where)
