"""The smallest task that has everything: a corridor of three tiles, for the tests of adapters."""

from __future__ import annotations

from typing import Any

import jaxenstein

MAP = "#####\n#S.G#\n#####"
FORWARD, STAY = 2, 4
SIZE = {"height": 12, "width": 16}
N = 3


def make_corridor() -> tuple[Any, Any]:
    """Three steps forward reach the goal; seven steps are the time limit."""
    env, params = jaxenstein.from_ascii(MAP, heading=0.0, **SIZE)
    return env, params.replace(max_steps_in_episode=7, move_distance=0.6)
