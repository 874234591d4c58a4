"""The smallest complete task, a corridor of three tiles, for the tests of adapters."""

from __future__ import annotations

from typing import Any

import jaxenstein

MAP = "#####\n#S.G#\n#####"
FORWARD, STAY = 2, 4
SIZE = {"height": 12, "width": 16}
N = 3

# Fast feet reach a goal at different times; idlers run out of time.
CROWD = "#######\n#S.rGG#\n#SS...#\n#######"


def make_crowd(**settings: Any) -> tuple[Any, Any]:
    """A room in which the episodes of a batch end at different times."""
    env, params = jaxenstein.from_ascii(CROWD, height=8, width=12, **settings)
    return env, params.replace(move_distance=0.5, goal_radius=1.2, max_steps_in_episode=9)


def make_corridor() -> tuple[Any, Any]:
    """Three steps forward reach the goal; seven steps are the time limit."""
    env, params = jaxenstein.from_ascii(MAP, heading=0.0, **SIZE)
    return env, params.replace(max_steps_in_episode=7, move_distance=0.6)
