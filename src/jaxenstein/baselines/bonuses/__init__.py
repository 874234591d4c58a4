"""Exploration bonuses; importing this package registers them as algorithms."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from ..bonus import Experience, Metrics
from ..config import HParams, register_bonus
from .e3b import E3B, E3BOptions
from .icm import ICM, ICMOptions
from .rnd import RND, RNDOptions


class NoBonus:
    """The bonus of PPO alone: zero."""

    value_heads: int = 1

    def __init__(self, *_: Any) -> None:
        """Ignore all arguments."""

    def init(self, key: jax.Array) -> tuple[()]:
        """An empty state."""
        del key
        return ()

    def reward(
        self, state: Any, hparams: HParams, experience: Experience
    ) -> tuple[jax.Array, Any, Metrics]:
        """Zeros."""
        del hparams
        return jnp.zeros(experience.ended.shape, jnp.float32), state, {}

    def update(self, key: jax.Array, state: Any, *_: Any) -> tuple[Any, Metrics]:
        """Do nothing."""
        del key
        return state, {}


_SIZES = (0.1, 1.0, 10.0)

register_bonus("ppo", NoBonus, grid={})
register_bonus("rnd", RND, RNDOptions, grid={"bonus_reward": _SIZES, "rnd_loss": (0.01, 0.1)})
register_bonus(
    "icm", ICM, ICMOptions, grid={"bonus_learning_rate": (3e-4, 1e-4), "bonus_reward": _SIZES}
)
register_bonus("e3b", E3B, E3BOptions)
