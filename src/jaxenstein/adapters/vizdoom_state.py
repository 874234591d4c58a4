"""What the running game reports, as a state of ours."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from typing import Any

import jax
import numpy as np

from ..tasks.doom.fixed import to_fixed
from ..tasks.doom.parts import Game
from ..tasks.doom.scenario import DoomScenario


def told_by(
    env: DoomScenario[Any, Any],
    first: Any,
    objects: Sequence[Any],
    values: Mapping[str, float],
    time: int,
) -> Any:
    """Our state, in numpy, for what the game reports, without what `with_pose` computes.

    Args:
        env: the scenario.
        first: a first state, in numpy, for the parts that the game does not report.
        objects: the objects of the game's state.
        values: the game variables `vizdoom_buffers.VARIABLES` and those of the scenario.
        time: tics since the episode began.
    """
    rows = [
        (
            to_fixed(o.position_x),
            to_fixed(o.position_y),
            o.id,
            turns_of(o.angle),
            to_fixed(math.hypot(o.velocity_x, o.velocity_y)),
        )
        for o in objects
    ]
    game = Game(
        names=tuple(o.name for o in objects),
        objects=np.array(rows, np.int64).reshape(-1, 5),
        variables={name: round(values[name]) for name in ("HEALTH", *env.game_variables)},
    )
    place, velocity = (
        np.array([to_fixed(values[f"{kind}_{axis}"]) for axis in "XY"], np.int32)
        for kind in ("POSITION", "VELOCITY")
    )
    state = first.replace(
        fixed_position=place,
        fixed_velocity=velocity,
        angle=np.uint32(turns_of(values["ANGLE"])),
        time=np.int32(time),
    )
    return env.from_game(state, game)


def with_pose(env: DoomScenario[Any, Any], told: Any) -> Any:
    """The state of `told_by` with position and heading in tiles."""
    return _at_pose(env, told, told.fixed_position, told.fixed_velocity, told.angle)


def turns_of(angle: float) -> int:
    """Degrees of the game as its 32-bit angle; the game divides by its largest one, 2**32 - 1."""
    return round(angle / 360 * (2**32 - 1)) % 2**32


@functools.partial(jax.jit, static_argnums=0)
def _at_pose(env: Any, state: Any, position: Any, velocity: Any, angle: Any) -> Any:
    return env.at_pose(state, position, velocity, angle)
