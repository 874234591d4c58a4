"""The state of a run, and its random keys as plain arrays."""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp

from ...errors import SettingError
from ...pytree import PyTreeNode
from .axes import PER_ENVIRONMENT
from .bonus import BonusScale
from .rollout import Actors

# Named, lest a setting of JAX change what a seed means.
IMPLEMENTATION = "threefry2x32"


class TrainState(PyTreeNode):
    """A run between two updates: a pytree of plain arrays, all that is needed to go on.

    Attributes:
        key: uint32[2], data of the random key of what is to come.
        update: int32[], updates so far.
        params: of the policy and value network.
        optimiser: its Adam's state.
        bonus: the exploration bonus' state.
        scale: of the bonus; None without `normalise_bonus`.
        recent: float32[], mean success of the last episodes, kept once it has reached
            `stop_success`; None without it.
        actors: the environments, and the policy's memory of them.
    """

    key: jax.Array
    update: jax.Array
    params: Any
    optimiser: Any
    bonus: Any
    scale: BonusScale | None
    recent: jax.Array | None
    actors: Actors = dataclasses.field(metadata=PER_ENVIRONMENT)


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
