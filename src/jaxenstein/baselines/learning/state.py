"""The state of a run, and its random keys as plain arrays."""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp

from ...pytree import PyTreeNode
from .axes import PER_ENVIRONMENT
from .bonus import BonusScale
from .rollout import Actors


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
    """Raw data of a typed or old key."""
    key = jnp.asarray(key)
    return jax.random.key_data(key) if jnp.issubdtype(key.dtype, jax.dtypes.prng_key) else key


def wrap_key(data: jax.Array) -> jax.Array:
    """The typed key of raw data."""
    return jax.random.wrap_key_data(data)
