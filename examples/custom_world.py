"""Your own world in the style of MiniGrid: fetch a ball from behind a locked door.

    python examples/custom_world.py

The general scripted player for such worlds plays it.
"""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import jax
import jax.numpy as jnp

import jaxenstein
from jaxenstein.tasks.minigrid.sketch import COLOURS, RIGHT, RoomSketch
from jaxenstein.tasks.minigrid.state import (
    BALL_KIND,
    BOX_KIND,
    DROP,
    KEY_KIND,
    PICK_UP,
    GridState,
    Step,
    Subgoal,
)
from jaxenstein.tasks.minigrid.world import GridWorld


@dataclasses.dataclass(frozen=True, kw_only=True)
class BringBack(GridWorld):
    """Bring the requested ball into the first room."""

    kinds: ClassVar[tuple[int, ...]] = (KEY_KIND, BALL_KIND, BOX_KIND)
    asks: ClassVar[bool] = True
    aim_words: ClassVar[str] = "brought the ball back"

    def lay_out(self, key: jax.Array) -> GridState:
        """Draw the door, the box with its key, the balls, the start and the instruction."""
        sketch = RoomSketch(key, across=2, down=1)
        colours = sketch.shuffled(COLOURS)
        sketch.door_in((0, 0), RIGHT, colours[0], locked=True)
        sketch.hide(KEY_KIND, colours[0], sketch.put(BOX_KIND, sketch.colour(), (0, 0)))
        for i in range(3):
            sketch.put(BALL_KIND, colours[i], (1, 0))
        return sketch.start_room((0, 0)).state(asked=(BALL_KIND, colours[sketch.number(0, 3)]))

    def judge(self, step: Step) -> tuple[jax.Array, jax.Array]:
        """Return whether the ball lies in the first room, and False: the task cannot be failed."""
        there = self.tiles_of(step.after, self.asked_for(step.after))[:, :5]
        return jnp.any(there), jnp.bool_(False)

    def subgoal(self, state: GridState) -> Subgoal:
        """Fetch the ball, then drop it on any tile of the first room."""
        held = jnp.any(state.things.held & self.asked_for(state))
        floor = (jnp.asarray(state.level.walls)[0] == 0) & (jnp.arange(11) < 5)[None]
        free = floor & ~self.tiles_of(state, state.things.lying)
        where = jnp.where(held, free, self.tiles_of(state, self.asked_for(state)))
        return Subgoal(where, jnp.where(held, DROP, PICK_UP).astype(jnp.int32))


if __name__ == "__main__":
    world = BringBack(name="bring-back", height=32, width=32)
    episode = jaxenstein.record(world, world.default_params, "expert", seed=0)
    print(f"{episode.steps} steps, return {episode.returns[-1]:g}")
