"""Turning and walking: the actions that most tasks on tiles share, and the headings of starts."""

from __future__ import annotations

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..engine.level import Level
from ..engine.motion import forward, turn, walk
from ..environment import Params, Scalar
from ..fields import Domain, check_value
from ..params import number
from .draws import sample_unit

TURN_LEFT, TURN_RIGHT, FORWARD, BACKWARD, INTERACT = range(5)
# Far outside this range, float32 cannot resolve degrees.
HEADING = Domain("angle", -3600, 3600, optional=True)
ACTION_NAMES = ("turn left", "turn right", "forward", "backward", "interact")


class SteeringParams(Params):
    """The size of one action.

    Attributes:
        turn_angle: radians turned by one action.
        move_distance: tiles moved by one action; below 1.
    """

    turn_angle: Scalar = number(math.radians(15), 0, 2 * math.pi)
    move_distance: Scalar = number(0.15, 0, below=1)


def steer(
    level: Level,
    closed: jax.Array,
    position: jax.Array,
    heading: jax.Array,
    action: jax.Array,
    params: Any,
) -> tuple[jax.Array, jax.Array]:
    """The position and heading after an action; a move into anything solid is cancelled.

    Args:
        level: the level.
        closed: bool[D], which of its doors are closed.
        position: float32[2], (x, y) in tiles.
        heading: float32[], radians.
        action: int32[]; actions that neither turn nor move change nothing.
        params: `SteeringParams`.
    """
    spin = _either(action, TURN_RIGHT, TURN_LEFT)
    pace = _either(action, FORWARD, BACKWARD)
    return go(level, closed, position, heading, spin, pace, params)


def go(
    level: Level,
    closed: jax.Array,
    position: jax.Array,
    heading: jax.Array,
    spin: jax.Array,
    pace: jax.Array,
    params: Any,
) -> tuple[jax.Array, jax.Array]:
    """As `steer`, for a number of turns to the right and of moves forward, float32[] each."""
    heading = turn(heading, spin * params.turn_angle)
    step = forward(heading) * (pace * params.move_distance)
    return walk(level, closed, position, step), heading


def _either(action: jax.Array, plus: int, minus: int) -> jax.Array:
    """float32[]: 1 for one action, -1 for the other, else 0."""
    return (action == plus).astype(jnp.float32) - (action == minus).astype(jnp.float32)


def centres(cells: Any) -> jax.Array:
    """float32[n, 2]: the centres of (column, row) tiles, given on the host."""
    return jnp.asarray(np.array(cells, np.float32).reshape(-1, 2) + np.float32(0.5))


def sample_heading(bits: jax.Array, heading: Any) -> jax.Array:
    """float32[] radians, uniform over the range of a heading setting, from uint32 bits."""
    low, high = heading_range(heading)
    return turn(jnp.float32(low), jnp.float32(high - low) * sample_unit(bits))


def heading_range(heading: Any) -> tuple[float, float]:
    """A heading setting in radians, as (lowest, highest).

    Args:
        heading: degrees from -3600 to 3600: None for any, a number, or (lowest, highest).

    Raises:
        SettingError: the value has another form or is out of range.
    """
    heading = check_value("heading", HEADING, heading)
    if heading is None:
        return 0.0, 2 * math.pi
    low, high = heading if isinstance(heading, tuple) else (heading, heading)
    return math.radians(low), math.radians(high)
