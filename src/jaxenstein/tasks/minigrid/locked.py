"""Worlds of one room's width or one hall, with doors to open: DoorKey, LockedRoom, RedBlueDoors."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from ...params import number
from ..steering import INTERACT
from .aims import Aim
from .sketch import COLOURS, Sketch
from .state import GOAL_KIND, KEY_KIND, GridState
from .world import GridParams, GridWorld

RED, BLUE, YELLOW = 0, 2, 4


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoorKey(GridWorld):
    """A wall with a locked yellow door; its key lies on the near side, the goal on the far one.

    Attributes:
        size: tiles of the world's side, walls included.
    """

    size: int = number(8, 5, 64)

    kinds: ClassVar[tuple[int, ...]] = (KEY_KIND, GOAL_KIND)

    def lay_out(self, key: jax.Array) -> GridState:
        """Draw the wall, the door, the start and the key."""
        size = self.size
        sketch = Sketch(key, size, size)
        sketch.thing(GOAL_KIND, 0, (size - 2, size - 2))
        column = sketch.number(2, size - 2)
        near = sketch.area(0, 0, column, size)
        sketch.wall(sketch.area(column, 0, 1, size))
        sketch.start_in(near)
        sketch.door(column, sketch.number(1, size - 2), YELLOW, locked=True)
        sketch.thing(KEY_KIND, YELLOW, sketch.tile_in(near & sketch.free & ~sketch.start_tile))
        return sketch.state()


@dataclasses.dataclass(frozen=True, kw_only=True)
class LockedRoom(GridWorld):
    """A hall with three rooms on each side; one is locked and holds the goal, another its key."""

    kinds: ClassVar[tuple[int, ...]] = (KEY_KIND, GOAL_KIND)

    def lay_out(self, key: jax.Array) -> GridState:
        """Draw the rooms of the goal and of the key, and the six colours of the doors."""
        size, left, right = 19, 7, 11
        sketch = Sketch(key, size, size)
        sketch.wall(sketch.area(left, 0, 1, size) | sketch.area(right, 0, 1, size))
        for row in (6, 12):
            sketch.wall(sketch.area(0, row, left, 1) | sketch.area(right, row, left + 1, 1))
        first = sketch.shuffled(6)
        locked, other = first[0], first[1]
        colours = sketch.shuffled(COLOURS)
        for room in range(6):
            column, top = (left, right)[room % 2], 6 * (room // 2)
            sketch.door(column, top + 3, colours[room], locked=locked == room)
        sketch.thing(GOAL_KIND, 0, sketch.tile_in(_inside(sketch, locked)))
        sketch.thing(KEY_KIND, colours[locked], sketch.tile_in(_inside(sketch, other)))
        return sketch.start_in(sketch.area(left, 0, right - left, size)).state()


def _inside(sketch: Sketch, room: jax.Array) -> jax.Array:
    """bool[rows, columns], the inner tiles of one of the six rooms of LockedRoom."""
    left = jnp.where(room % 2 == 0, 1, 12)
    return sketch.area(left, 6 * (room // 2) + 1, 6, 5)


@dataclasses.dataclass(frozen=True, kw_only=True)
class RedBlueDoors(GridWorld):
    """A room with a red door in the west and a blue one in the east: open red, then blue.

    Attributes:
        size: tiles of the room's side, walls included; the world is twice as wide.
    """

    size: int = number(8, 4, 32)

    kinds: ClassVar[tuple[int, ...]] = ()
    aim_words: ClassVar[str] = "opened the red door, then the blue one"
    fail_words: ClassVar[str] = "opened the blue door first"

    def lay_out(self, key: jax.Array) -> GridState:
        """Draw the start and the places of the doors."""
        size, left = self.size, self.size // 2
        sketch = Sketch(key, 2 * size, size)
        for column in (left, left + size - 1):
            sketch.wall(sketch.area(column, 0, 1, size))
        sketch.start_in(sketch.area(left, 0, size, size))
        sketch.door(left, sketch.number(1, size - 1), RED)
        sketch.door(left + size - 1, sketch.number(1, size - 1), BLUE)
        return sketch.state()

    def judge(
        self, before: GridState, after: GridState, action: jax.Array, params: GridParams
    ) -> tuple[jax.Array, jax.Array]:
        """Whether the blue door is open, and whether the red one was before."""
        del action, params
        red, blue = before.doors.opened[0], after.doors.opened[1]
        return blue & red, blue & ~red

    def aim(self, state: GridState) -> Aim:
        """The red door, and once it is open the blue one."""
        which = jnp.where(state.doors.opened[0], 1, 0) == np.arange(2)
        return Aim(self.door_tiles(state, which), jnp.int32(INTERACT))
