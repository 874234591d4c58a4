"""Which device of several holds what of a state."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import jax
from jax.sharding import AxisType, NamedSharding, PartitionSpec

from .axes import per_environment
from .config import Config
from .state import TrainState


def place(state: TrainState, config: Config, devices: Sequence[Any] | None = None) -> TrainState:
    """Spread the state of a run, or of many, over the devices of this process.

    Every function of a learner works on a spread state as it is: JAX derives from the placement
    of its arguments where each computation runs, and what the devices must exchange: sums for
    gradients and statistics, no frames, if `Config.shards` is the number of devices.

    Many runs are spread where their number is a multiple of that of the devices; otherwise the
    environments of every run, where `shards` is one. Without either the first device does it
    all, and a warning says so.

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
