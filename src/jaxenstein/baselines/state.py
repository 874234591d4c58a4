"""The state of a run: its arrays, its random keys, and the devices that hold it."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jax.sharding import AxisType, NamedSharding, PartitionSpec

from ..errors import SettingError
from ..pytree import PyTreeNode
from .bonus import PER_ENVIRONMENT, BonusScale
from .config import Config
from .rollout import Actors

# Named, so that no setting of JAX changes what a seed means.
IMPLEMENTATION = "threefry2x32"


class TrainState(PyTreeNode):
    """A run between two updates: a pytree of plain arrays, all that is needed to continue.

    Attributes:
        key: uint32[2], data of the random key of the next updates.
        update: int32[], updates so far.
        params: of the policy and value network.
        optimiser: its Adam's state.
        bonus: the exploration bonus' state.
        scale: of the bonus; None without `normalise_bonus`.
        recent: float32[], mean success of the last episodes, fixed once it has reached
            `stop_success`; None without it.
        actors: the environments, and the policy's memory of them.
        diverged: int32[], 0 while all numbers are finite. After a divergence its bits tell which
            of `divergence.PARTS` were not finite, and all other fields stay fixed, `update`
            included. None if `on_divergence` is `"continue"`.
    """

    key: jax.Array
    update: jax.Array
    params: Any
    optimiser: Any
    bonus: Any
    scale: BonusScale | None
    recent: jax.Array | None
    actors: Actors = dataclasses.field(metadata=PER_ENVIRONMENT)
    diverged: jax.Array | None = None


def key_data(key: jax.Array) -> jax.Array:
    """Raw data of a typed or old key.

    Raises:
        SettingError: it is of another implementation than JAX's default, threefry2x32.
    """
    key = jnp.asarray(key)
    data = jax.random.key_data(key) if jnp.issubdtype(key.dtype, jax.dtypes.prng_key) else key
    if data.shape[-1:] != (2,):
        raise SettingError(
            f"a key must be one of {IMPLEMENTATION}, as jax.random.key(seed, "
            f"impl={IMPLEMENTATION!r}) makes it, not {key.dtype}{list(key.shape)}"
        )
    return data


def wrap_key(data: jax.Array) -> jax.Array:
    """The typed key of raw data."""
    return jax.random.wrap_key_data(data, impl=IMPLEMENTATION)


def per_environment(tree: Any) -> Any:
    """The tree with True for leaves that begin with the axis of the environments, else False.

    Fields of records, at any depth, declare this with `PER_ENVIRONMENT`.
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
    """Spread the state of a run, or of many, over the devices of this process.

    Every function of a learner works on a spread state without changes: JAX derives from the
    placement of its arguments where each computation runs, and what the devices must exchange:
    sums for gradients and statistics, no frames, if `Config.shards` is the number of devices.

    Many runs are spread where their number is a multiple of that of the devices; otherwise the
    environments of every run, where `shards` is one. If neither holds, the first device does all
    the work, and a warning says so.

    Args:
        state: of one run, or with a leading axis of many.
        config: of its learner.
        devices: by default all.
    """
    devices = list(devices or jax.devices())
    size, runs = len(devices), state.update.shape
    if size == 1:
        return state
    mesh = jax.make_mesh((size,), ("device",), axis_types=(AxisType.Auto,), devices=devices)
    if runs and runs[0] % size == 0:
        return jax.device_put(state, NamedSharding(mesh, PartitionSpec("device")))
    if config.shards % size:
        several = f"the number of runs, {runs[0]}, or " if runs else ""
        warnings.warn(
            f"{size} devices are here and one is used: {several}shards would have to be a "
            f"multiple of {size}",
            stacklevel=2,
        )
        return state
    everywhere = NamedSharding(mesh, PartitionSpec())
    apart = NamedSharding(mesh, PartitionSpec(*(None for _ in runs), "device"))
    where = jax.tree.map(lambda inside: apart if inside else everywhere, per_environment(state))
    return jax.device_put(state, where)
