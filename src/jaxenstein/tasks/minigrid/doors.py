"""Worlds with doors to open: DoorKey, LockedRoom, RedBlueDoors, Unlock, KeyCorridor and others."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from ...maps.things import BLUE, GREEN, GREY, RED, YELLOW
from ...params import number
from ..draws import sample_index
from ..key_corridor import corridor_sketch
from ..steering import INTERACT
from .sketch import COLOURS, DOWN, LEFT, RIGHT, UP, RoomSketch, Sketch
from .state import BALL_KIND, BOX_KIND, GOAL_KIND, KEY_KIND, GridState, Step, Subgoal
from .world import GridWorld, PickUpWorld


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoorKey(GridWorld):
    """A wall with a locked yellow door; the key is on the near side, the goal on the far side.

    Attributes:
        size: tiles along the world's side, walls included.
    """

    size: int = number(8, 5, 64)

    kinds: ClassVar[tuple[int, ...]] = (KEY_KIND, GOAL_KIND)

    def lay_out(self, key: jax.Array) -> GridState:
        """Sample the wall, the door, the start and the key."""
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
    """A hall with three rooms on each side; one is locked and has the goal, another has its key."""

    kinds: ClassVar[tuple[int, ...]] = (KEY_KIND, GOAL_KIND)

    def lay_out(self, key: jax.Array) -> GridState:
        """Sample the rooms of the goal and of the key, and the six colours of the doors."""
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
        size: tiles along the room's side, walls included; the world is twice as wide.
    """

    size: int = number(8, 4, 32)

    kinds: ClassVar[tuple[int, ...]] = ()
    aim_words: ClassVar[str] = "opened the red door, then the blue one"
    fail_words: ClassVar[str] = "opened the blue door first"

    def lay_out(self, key: jax.Array) -> GridState:
        """Sample the start and the positions of the doors."""
        size, left = self.size, self.size // 2
        sketch = Sketch(key, 2 * size, size)
        for column in (left, left + size - 1):
            sketch.wall(sketch.area(column, 0, 1, size))
        sketch.start_in(sketch.area(left, 0, size, size))
        sketch.door(left, sketch.number(1, size - 1), RED)
        sketch.door(left + size - 1, sketch.number(1, size - 1), BLUE)
        return sketch.state()

    def judge(self, step: Step) -> tuple[jax.Array, jax.Array]:
        """Whether the blue door is open, and whether the red one was opened before."""
        red, blue = step.before.doors.opened[0], step.after.doors.opened[1]
        return blue & red, blue & ~red

    def subgoal(self, state: GridState) -> Subgoal:
        """The red door, then the blue one."""
        which = jnp.where(state.doors.opened[0], 1, 0) == np.arange(2)
        return Subgoal(self.door_tiles(state, which), jnp.int32(INTERACT))


@dataclasses.dataclass(frozen=True, kw_only=True)
class Unlock(GridWorld):
    """Two rooms with a locked door between them; the key is in the first: open the door."""

    kinds: ClassVar[tuple[int, ...]] = (KEY_KIND,)
    aim_words: ClassVar[str] = "opened the door"

    def lay_out(self, key: jax.Array) -> GridState:
        """Sample the door, its key and the start."""
        sketch = RoomSketch(key, 2, 1)
        colour = sketch.colour()
        sketch.door_in((0, 0), RIGHT, colour, locked=True)
        sketch.put(KEY_KIND, colour, (0, 0))
        return sketch.start_room((0, 0)).state()

    def judge(self, step: Step) -> tuple[jax.Array, jax.Array]:
        """Whether the door is open."""
        return jnp.any(step.after.doors.opened), jnp.bool_(False)

    def subgoal(self, state: GridState) -> Subgoal:
        """The door."""
        return Subgoal(self.door_tiles(state, ~state.doors.opened), jnp.int32(INTERACT))


@dataclasses.dataclass(frozen=True, kw_only=True)
class UnlockPickup(PickUpWorld):
    """Two rooms with a locked door between them; pick up the box in the second.

    Attributes:
        blocked: whether a ball is in front of the door.
    """

    blocked: bool = False

    kinds: ClassVar[tuple[int, ...]] = (KEY_KIND, BALL_KIND, BOX_KIND)

    def lay_out(self, key: jax.Array) -> GridState:
        """Sample the box, the door, its key and the start."""
        sketch = RoomSketch(key, 2, 1)
        asked, colour = sketch.colour(), sketch.colour()
        sketch.put(BOX_KIND, asked, (1, 0))
        before = sketch.door_in((0, 0), RIGHT, colour, locked=True)
        if self.blocked:
            sketch.thing(BALL_KIND, sketch.colour(), before)
        sketch.put(KEY_KIND, colour, (0, 0))
        return sketch.start_room((0, 0)).state(asked=(BOX_KIND, asked))


@dataclasses.dataclass(frozen=True, kw_only=True)
class KeyCorridorBall(PickUpWorld):
    """KeyCorridor as in MiniGrid: pick up the ball in the locked room with empty hands.

    Layouts are those of `KeyCorridor`, with the ball in place of its goal.

    Attributes:
        room_size: tiles from a room's wall to the opposite wall, both included; at least 3.
        room_rows: rows of rooms, 1 to 3.
    """

    room_size: int = number(4, 3, 16)
    room_rows: int = number(3, 1, 3)

    kinds: ClassVar[tuple[int, ...]] = (KEY_KIND, BALL_KIND)
    aim_words: ClassVar[str] = "picked up the ball"

    def lay_out(self, key: jax.Array) -> GridState:
        """Sample a layout, and the colour of the ball."""
        layout_key, start_key = jax.random.split(key)
        sketch, _ = corridor_sketch(layout_key, start_key, self.room_size, self.room_rows)
        # Not 0 or 1, because this key is split into those two.
        bits = jax.random.bits(jax.random.fold_in(key, 2), (), jnp.uint32)
        colour = sample_index(bits, COLOURS)
        state = sketch.state(asked=(BALL_KIND, colour))
        things = state.things.replace(colour=state.things.colour.at[1].set(colour))
        return state.replace(things=things)


@dataclasses.dataclass(frozen=True, kw_only=True)
class ObstructedMaze(PickUpWorld):
    """Two or nine rooms with locked doors; pick up the blue ball behind them.

    With nine rooms, each side room that is open to the middle room has two locked doors to its
    corner rooms, and their keys; the ball is in one of the corner rooms.

    Attributes:
        quarters: side rooms with locked doors, 1 to 4; 0 for two rooms with one door.
        start_aside: whether the agent starts in the eastern side room instead of the middle one.
        hidden: whether the keys are in boxes.
        blocked: whether a ball is in front of each locked door.
    """

    quarters: int = number(0, 0, 4)
    start_aside: bool = False
    hidden: bool = True
    blocked: bool = True

    kinds: ClassVar[tuple[int, ...]] = (KEY_KIND, BALL_KIND, BOX_KIND)
    aim_words: ClassVar[str] = "picked up the blue ball"

    def lay_out(self, key: jax.Array) -> GridState:
        """Sample doors and their colours, obstacles, the keys, the ball and the start."""
        sketch = RoomSketch(key, 3, 3) if self.quarters else RoomSketch(key, 2, 1)
        colours = sketch.shuffled(COLOURS)
        if not self.quarters:
            self._lock(sketch, (0, 0), RIGHT, colours[0])
            self._put_key(sketch, (0, 0), colours[0])
            target, start = (1, 0), (0, 0)
        else:
            sides = ((2, 1), (1, 2), (0, 1), (1, 0))[: self.quarters]
            for side, room in zip((RIGHT, DOWN, LEFT, UP), sides, strict=False):
                sketch.door_in((1, 1), side, colours[side])
                turns = ((side - 1) % 4, (side + 1) % 4)
                shades = (colours[(side - 1) % COLOURS], colours[(side + 1) % COLOURS])
                for turn, shade in zip(turns, shades, strict=True):
                    self._lock(sketch, room, turn, shade)
                for shade in shades:
                    self._put_key(sketch, room, shade)
            corners = jnp.asarray(((2, 0), (2, 2), (0, 2), (0, 0)), jnp.int32)
            column, row = corners[sketch.number(0, self.quarters)]
            target, start = (column, row), (2, 1) if self.start_aside else (1, 1)
        sketch.put(BALL_KIND, BLUE, target)
        return sketch.start_room(start).state(asked=(BALL_KIND, BLUE))

    def _lock(
        self, sketch: RoomSketch, room: tuple[int, int], side: int, colour: jax.Array
    ) -> None:
        before = sketch.door_in(room, side, colour, locked=True)
        if self.blocked:
            sketch.thing(BALL_KIND, GREEN, before)

    def _put_key(self, sketch: RoomSketch, room: tuple[int, int], colour: jax.Array) -> None:
        if self.hidden:
            sketch.hide(KEY_KIND, colour, sketch.put(BOX_KIND, GREY, room))
        else:
            sketch.put(KEY_KIND, colour, room)
