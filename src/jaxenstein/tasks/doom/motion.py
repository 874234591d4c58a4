"""What the player does in a tic: the buttons that an action holds, and how they move the body."""

from __future__ import annotations

from typing import Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from .physics import Blocked, Body, Buttons, Reached, bobbed, hold, tic
from .pose import DoomState
from .scenario import DoomScenario

S = TypeVar("S", bound=DoomState)


def held_bits(scenario: DoomScenario[Any, Any], action: jax.Array) -> jax.Array:
    """int32[]: the buttons that an action holds, bit i for `scenario.button_names[i]`."""
    table = jnp.asarray(np.append(scenario.action_buttons, np.int32(0)))
    return table.at[action].get(mode="promise_in_bounds")


def held_buttons(scenario: DoomScenario[Any, Any], action: jax.Array) -> Buttons:
    """The buttons that an action holds."""
    return hold(scenario.button_names, held_bits(scenario, action))


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
    buttons = held_buttons(scenario, action)
    after, reached = tic(scenario.geometry, body, buttons, bodies)
    fields = scenario.body_fields(after)
    if state.gait is not None:
        velocity = after.velocity
        steps, pace = bobbed(state.gait[0], after.angle, buttons, velocity, reached.slid)
        fields["gait"] = jnp.stack([pace, steps])
    return state.replace(**fields), reached
