"""Worlds from drawings, for tests: keys, balls, boxes with keys in them, lava, doors."""

import dataclasses
import math
from typing import ClassVar

import jax

from jaxenstein.tasks.minigrid.sketch import Sketch
from jaxenstein.tasks.minigrid.state import BALL_KIND, BOX_KIND, GOAL_KIND, KEY_KIND, LAVA_KIND
from jaxenstein.tasks.minigrid.world import GridWorld

RED, GREEN, BLUE, PURPLE, YELLOW = range(5)
# k red key, o green ball, b purple box with a yellow key, x purple box, R locked red door, Y locked
# yellow door, d blue door, G goal, ~ lava, S start, facing east.
PAINT = {"k": (KEY_KIND, RED), "o": (BALL_KIND, GREEN), "b": (BOX_KIND, PURPLE)}
PAINT |= {"x": (BOX_KIND, PURPLE), "G": (GOAL_KIND, 0), "~": (LAVA_KIND, 0)}
DOORS = {"R": (RED, True), "Y": (YELLOW, True), "d": (BLUE, False)}


@dataclasses.dataclass(frozen=True, kw_only=True)
class Drawn(GridWorld):
    """The world of a drawing.

    Attributes:
        text: the drawing.
        quarter: the first heading in quarter turns, 0 for east, 1 for south.
    """

    text: str = ""
    quarter: int = 0

    kinds: ClassVar[tuple[int, ...]] = (KEY_KIND, BALL_KIND, BOX_KIND, GOAL_KIND, LAVA_KIND)

    def lay_out(self, key):
        """The drawing."""
        lines = self.text.split()
        sketch = Sketch(key, len(lines[0]), len(lines))
        for row, line in enumerate(lines):
            for column, mark in enumerate(line):
                if mark == "#":
                    sketch.wall(sketch.tile(column, row))
                if mark in DOORS:
                    sketch.door(column, row, *DOORS[mark])
                if mark in PAINT:
                    number = sketch.thing(*PAINT[mark], (column, row))
                    if mark == "b":
                        sketch.hide(KEY_KIND, YELLOW, number)
                if mark == "S":
                    sketch.start((column, row), self.quarter)
        return sketch.state()


def drawn(text, quarter=0, **changes):
    """A world that turns by 90 degrees, its params, its first state, and a compiled step."""
    env = Drawn(text=text, quarter=quarter, height=16, width=16, autoreset=None)
    params = env.check_params(env.default_params.replace(turn_angle=math.pi / 2, **changes))
    step = jax.jit(lambda state, action: env.advance(jax.random.key(0), state, action, params))
    return env, params, env.init_state(jax.random.key(0), params), step
