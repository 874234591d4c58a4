"""Spreading one run over several devices, along its environments.

Every function of a learner works on a spread state as it is: JAX derives from the placement of
its arguments where each computation runs, and what the devices must exchange: sums for gradients
and statistics, no frames, if `Config.shards` is the number of devices.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import jax
from jax.sharding import AxisType, Mesh, NamedSharding, PartitionSpec

from ...errors import SettingError

if TYPE_CHECKING:
    from .config import Config

AXIS = "env"


def make_mesh(devices: Any = None) -> Mesh:
    """A mesh of all devices, or of those given, with the one axis `"env"`."""
    devices = list(devices or jax.devices())
    return jax.make_mesh((len(devices),), (AXIS,), axis_types=(AxisType.Auto,), devices=devices)


def shard(state: Any, mesh: Mesh, config: Config) -> Any:
    """Spread a `TrainState` over the devices of a mesh.

    Args:
        state: of one run.
        mesh: with an axis `"env"`.
        config: of the learner.

    Returns:
        The state, whose environments lie evenly on the devices, and whose parameters on all.

    Raises:
        SettingError: the environments or `config.shards` do not divide evenly.
    """
    size = dict(mesh.shape).get(AXIS, 0)
    if size < 1 or config.shards % size:
        raise SettingError(
            f"shards must be the number of devices along the mesh's axis {AXIS!r}, {size}, or a "
            f"multiple of it, not {config.shards}"
        )
    everywhere = NamedSharding(mesh, PartitionSpec())
    apart = NamedSharding(mesh, PartitionSpec(AXIS))
    placed = jax.tree.map(lambda _: everywhere, state)
    placed = placed.replace(actors=jax.tree.map(lambda _: apart, state.actors))
    if hasattr(state.bonus, "scale"):
        scale = placed.bonus.scale.replace(total=apart)
        placed = placed.replace(bonus=placed.bonus.replace(scale=scale))
    return jax.device_put(state, placed)
