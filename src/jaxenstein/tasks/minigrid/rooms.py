"""Worlds on a grid of rooms of one size, which share their walls."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import jax
import jax.numpy as jnp

from ..steering import INTERACT
from .aims import PICK_UP, Aim
from .sketch import STEPS, Number, Sketch
from .state import BALL_KIND, BOX_KIND, KEY_KIND, GridState
from .world import GridParams, GridWorld

RIGHT, DOWN, LEFT, UP = range(4)
SIZE = 6
"""Tiles of a room's side, walls included, in the worlds here."""


class RoomSketch(Sketch):
    """A grid of rooms that is being laid out; rooms are named by (column, row) of the grid.

    Each inner wall has one place for a door, drawn uniformly along it.
    """

    def __init__(self, key: jax.Array, across: int, down: int, size: int = SIZE) -> None:
        """Put up all walls, and draw the places of doors.

        Args:
            key: of all that is drawn.
            across: rooms from west to east.
            down: rooms from north to south.
            size: tiles of a room's side, walls included.
        """
        step = size - 1
        super().__init__(key, across * step + 1, down * step + 1)
        self._step = step
        self.wall(jnp.asarray((self._column % step == 0) | (self._row % step == 0)))
        # MiniGrid keeps things away from this tile, wherever the agent starts.
        middle = (across // 2) * step + size // 2, (down // 2) * step + size // 2
        near = abs(self._column - middle[0]) + abs(self._row - middle[1]) < 2
        self._kept_free = jnp.asarray(near)
        self._places: dict[tuple[int, int, int], tuple[Number, Number]] = {}
        for row in range(down):
            for column in range(across):
                self._draw_places(column, row, column < across - 1, row < down - 1)

    def _draw_places(self, column: int, row: int, east: bool, south: bool) -> None:
        left, top, step = column * self._step, row * self._step, self._step
        if east:
            place = left + step, self.number(top + 1, top + step)
            self._places[column, row, RIGHT] = self._places[column + 1, row, LEFT] = place
        if south:
            place = self.number(left + 1, left + step), top + step
            self._places[column, row, DOWN] = self._places[column, row + 1, UP] = place

    def room(self, column: Number, row: Number) -> jax.Array:
        """bool[rows, columns], a room with its walls."""
        step = self._step
        return self.area(column * step, row * step, step + 1, step + 1)

    def door_in(
        self, room: tuple[int, int], side: int, colour: Number, *, locked: bool = False
    ) -> tuple[Number, Number]:
        """Put a door into a room's wall; returns the tile in front of it, inside of the room."""
        column, row = self._places[(*room, side)]
        self.door(column, row, colour, locked)
        return column - STEPS[side][0], row - STEPS[side][1]

    def put(self, kind: Number, colour: Number, room: tuple[Number, Number]) -> int:
        """Lay a thing down in a room; returns its number."""
        spots = self.room(*room) & self.free & ~self._kept_free
        return self.thing(kind, colour, self.tile_in(spots))

    def start_room(self, room: tuple[int, int]) -> RoomSketch:
        """Begin anywhere in a room, not right before a thing or a door."""
        self.start_in(self.room(*room), facing_free=True)
        return self


@dataclasses.dataclass(frozen=True, kw_only=True)
class PickUpWorld(GridWorld):
    """Base of worlds that are solved by picking up what is asked for."""

    aim_words: ClassVar[str] = "picked up what was asked for"

    def judge(
        self, before: GridState, after: GridState, action: jax.Array, params: GridParams
    ) -> tuple[jax.Array, jax.Array]:
        """Whether it is in the hand."""
        del before, action, params
        return jnp.any(after.things.held & self.asked_for(after)), jnp.bool_(False)

    def aim(self, state: GridState) -> Aim:
        """To pick it up."""
        return Aim(self.tiles_of(state, self.asked_for(state)), jnp.int32(PICK_UP))


@dataclasses.dataclass(frozen=True, kw_only=True)
class Unlock(GridWorld):
    """Two rooms with a locked door between them; its key lies in the first: open the door."""

    kinds: ClassVar[tuple[int, ...]] = (KEY_KIND,)
    aim_words: ClassVar[str] = "opened the door"

    def lay_out(self, key: jax.Array) -> GridState:
        """Draw the door, its key and the start."""
        sketch = RoomSketch(key, 2, 1)
        colour = sketch.colour()
        sketch.door_in((0, 0), RIGHT, colour, locked=True)
        sketch.put(KEY_KIND, colour, (0, 0))
        return sketch.start_room((0, 0)).state()

    def judge(
        self, before: GridState, after: GridState, action: jax.Array, params: GridParams
    ) -> tuple[jax.Array, jax.Array]:
        """Whether the door is open."""
        del before, action, params
        return jnp.any(after.doors.opened), jnp.bool_(False)

    def aim(self, state: GridState) -> Aim:
        """The door."""
        return Aim(self.door_tiles(state, ~state.doors.opened), jnp.int32(INTERACT))


@dataclasses.dataclass(frozen=True, kw_only=True)
class UnlockPickup(PickUpWorld):
    """Two rooms with a locked door between them; pick up the box in the second.

    Attributes:
        blocked: whether a ball lies before the door.
    """

    blocked: bool = False

    kinds: ClassVar[tuple[int, ...]] = (KEY_KIND, BALL_KIND, BOX_KIND)

    def lay_out(self, key: jax.Array) -> GridState:
        """Draw the box, the door, its key and the start."""
        sketch = RoomSketch(key, 2, 1)
        asked, colour = sketch.colour(), sketch.colour()
        sketch.put(BOX_KIND, asked, (1, 0))
        before = sketch.door_in((0, 0), RIGHT, colour, locked=True)
        if self.blocked:
            sketch.thing(BALL_KIND, sketch.colour(), before)
        sketch.put(KEY_KIND, colour, (0, 0))
        return sketch.start_room((0, 0)).state(asked=(BOX_KIND, asked))
