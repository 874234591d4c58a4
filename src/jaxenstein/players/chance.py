"""The players that know nothing about a task: idle and uniformly random."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp

from ..about import Choose, Player

if TYPE_CHECKING:
    from ..environment import AnyEnvironment

NO_OP = -1
"""An action outside every action space."""


def idle(env: AnyEnvironment, params: Any) -> Choose:
    """Never do anything."""
    del env, params

    def choose(key: jax.Array, state: Any) -> jax.Array:
        del key, state
        return jnp.int32(NO_OP)

    return choose


def uniform(env: AnyEnvironment, params: Any) -> Choose:
    """Sample each action uniformly."""
    del params

    def choose(key: jax.Array, state: Any) -> jax.Array:
        del state
        return jax.random.randint(key, (), 0, env.num_actions, jnp.int32)

    return choose


IDLE = Player("does nothing", idle)
UNIFORM = Player("draws every action uniformly", uniform)
