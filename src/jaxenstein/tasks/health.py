"""Shared parts of tasks in which the agent loses and gains health."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from ..about import About, Event, Player
from ..environment import Environment, Info, Params
from ..spaces import Box

FULL_HEALTH = 100

S = TypeVar("S", bound=Any)
P = TypeVar("P", bound=Params)


class HealthTask(Environment[S, P]):
    """Base of tasks whose states have `health`, int32[], and which end when it is 0."""

    survival: ClassVar[bool] = True

    def describe(self, state: S, params: P) -> Info:
        """Add the health."""
        return super().describe(state, params) | {"health": state.health}

    def variables(self, state: S) -> dict[str, jax.Array]:
        """`health`: float32[1], 0 to 100."""
        return {"health": state.health.astype(jnp.float32)[None]}

    def variable_spaces(self) -> dict[str, Box]:
        """The space of `health`."""
        return {"health": Box(0.0, float(FULL_HEALTH), (1,), np.dtype(np.float32))}


def about_health(taken: Mapping[str, Event], greedy_medkits: Player, step: str) -> About:
    """The description of such a task.

    Args:
        taken: the events for things that are taken.
        greedy_medkits: the best player.
        step: the word for a step.
    """
    return About(
        aim="reached the time limit alive",
        ends="when health reaches 0",
        rewards={"living_reward": f"{{:+g}} per {step}", "death_penalty": "-{:g} at death"},
        events={**taken, "died": Event("died")},
        variables={"health": "0 to 100"},
        captions=("health",),
        players={"greedy_medkits": greedy_medkits},
        expert="greedy_medkits",
        holds={
            "health is from 1 to full": lambda state: (
                (state.health > 0) & (state.health <= FULL_HEALTH)
            )
        },
    )
