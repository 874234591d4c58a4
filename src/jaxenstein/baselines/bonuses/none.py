"""No bonus: PPO alone."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from ..learning.bonus import Experience, Metrics
from ..learning.config import Config
from ..learning.hparams import HParams
from ..learning.observations import ObservationSpec


class NoBonus:
    """Zero."""

    value_heads: int = 1

    def __init__(self, spec: ObservationSpec, actions: int, config: Config) -> None:
        """Nothing is needed."""

    def init(self, key: jax.Array) -> tuple[()]:
        """Nothing."""
        del key
        return ()

    def reward(
        self, state: Any, hparams: HParams, experience: Experience
    ) -> tuple[jax.Array, Any, Metrics]:
        """Zeros."""
        del hparams
        return jnp.zeros(experience.ended.shape, jnp.float32), state, {}

    def update(
        self, key: jax.Array, state: Any, hparams: HParams, experience: Experience, rate: jax.Array
    ) -> tuple[Any, Metrics]:
        """Nothing to learn."""
        del key, hparams, experience, rate
        return state, {}
