"""How the player's body moves in a tic of a scenario."""

from __future__ import annotations

from typing import Any, TypeVar

import jax
import jax.numpy as jnp

from .physics import Blocked, Body, Reached, bobbed, tic
from .pose import DoomState
from .scenario import DoomScenario

S = TypeVar("S", bound=DoomState)


def moved(
    scenario: DoomScenario[S, Any], state: S, action: jax.Array, bodies: Blocked | None = None
) -> tuple[S, Reached]:
    """The state after the body has moved in a tic, and the positions that it reached.

    Args:
        scenario: the scenario.
        state: the state before the tic.
        action: the action.
        bodies: a function that tells where other bodies are in its way, if there are any.
    """
    body = Body(state.fixed_position, state.fixed_velocity, state.angle, state.turn_tics)
    buttons = scenario.pressed(action)
    after, reached = tic(scenario.geometry, body, buttons, bodies)
    fields = scenario.body_fields(after)
    if state.gait is not None:
        velocity = after.velocity
        steps, pace = bobbed(state.gait[0], after.angle, buttons, velocity, reached.slid)
        fields["gait"] = jnp.stack([pace, steps])
    return state.replace(**fields), reached
