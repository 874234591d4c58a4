"""Which device of several trains what of an experiment."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import jax
from jax.sharding import AxisType, NamedSharding, PartitionSpec

if TYPE_CHECKING:
    from ..runs.experiment import Experiment


def place(state: Any, experiment: Experiment, devices: Any = None) -> Any:
    """Spread the state of all runs over the devices of this process.

    The runs are spread where their number is a multiple of that of the devices; otherwise the
    environments of every run, where `shards` is one. Without either the first device does it
    all, and a warning says so.

    Args:
        state: a `TrainState` with a leading axis of runs.
        experiment: that it belongs to.
        devices: by default all.
    """
    devices = list(devices or jax.devices())
    many = len(devices)
    if many == 1:
        return state
    mesh = jax.make_mesh((many,), ("device",), axis_types=(AxisType.Auto,), devices=devices)
    apart = NamedSharding(mesh, PartitionSpec("device"))
    if len(experiment.runs) % many == 0:
        return jax.device_put(state, apart)
    if experiment.config.shards % many:
        warnings.warn(
            f"{many} devices are here and one is used: the number of runs, "
            f"{len(experiment.runs)}, or shards would have to be a multiple of {many}",
            stacklevel=5,
        )
        return state
    everywhere = NamedSharding(mesh, PartitionSpec())
    within = NamedSharding(mesh, PartitionSpec(None, "device"))
    placed = jax.tree.map(lambda _: everywhere, state)
    placed = placed.replace(actors=jax.tree.map(lambda _: within, state.actors))
    if hasattr(state.bonus, "scale"):
        scale = placed.bonus.scale.replace(total=within)
        placed = placed.replace(bonus=placed.bonus.replace(scale=scale))
    return jax.device_put(state, placed)
