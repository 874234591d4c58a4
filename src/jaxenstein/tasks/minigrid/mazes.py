"""Mazes of rooms: KeyCorridor with MiniGrid's own rule, and ObstructedMaze."""

from __future__ import annotations

import dataclasses
import functools
from typing import ClassVar

import jax
import jax.numpy as jnp

from ...maps.symbols import door_label
from ...params import number
from ..draws import draw_index
from ..goals import NavigationParams
from ..key_corridor import KeyCorridor
from .rooms import DOWN, LEFT, RIGHT, UP, PickUpWorld, RoomSketch
from .sketch import COLOURS
from .state import BALL_KIND, BOX_KIND, KEY_KIND, LYING, Doors, GridState, Things

GREEN, BLUE, GREY = 1, 2, 5


@dataclasses.dataclass(frozen=True, kw_only=True)
class KeyCorridorBall(PickUpWorld):
    """KeyCorridor as it is in MiniGrid: pick up the ball in the locked room with empty hands.

    Layouts are those of `KeyCorridor`, with the ball where that has its goal.

    Attributes:
        room_size: tiles from a room's wall to its opposite one, both included; at least 3.
        room_rows: rows of rooms, 1 to 3.
    """

    room_size: int = number(4, 3, 16)
    room_rows: int = number(3, 1, 3)

    kinds: ClassVar[tuple[int, ...]] = (KEY_KIND, BALL_KIND)
    aim_words: ClassVar[str] = "picked up the ball"

    @functools.cached_property
    def _layout(self) -> KeyCorridor:
        return KeyCorridor(room_size=self.room_size, room_rows=self.room_rows)

    def lay_out(self, key: jax.Array) -> GridState:
        """Draw a layout, and the colour of the ball."""
        drawn = self._layout.init_state(key, NavigationParams())
        # Not 0 or 1, which are the two keys that the layout splits this one into.
        bits = jax.random.bits(jax.random.fold_in(key, 2), (), jnp.uint32)
        colour = draw_index(bits, COLOURS)
        tiles = jnp.floor(jnp.stack([drawn.key, drawn.goal])).astype(jnp.int32)
        columns, rows = drawn.level.doors[:, 0], drawn.level.doors[:, 1]
        labels = jnp.asarray(drawn.level.walls)[0, rows, columns].astype(jnp.int32)
        # An absent door stands on the map's corner, whose label is a wall's.
        shades = jnp.maximum(labels - door_label(0, locked=False), 0) % COLOURS
        things = Things(
            kind=jnp.array([KEY_KIND, BALL_KIND], jnp.int32),
            colour=jnp.stack([drawn.key_colour, colour]),
            tile=tiles,
            place=jnp.full(2, LYING, jnp.int32),
            box=jnp.full(2, -1, jnp.int32),
        )
        asked = jnp.stack([jnp.int32(BALL_KIND), colour])
        return GridState(
            position=drawn.position,
            heading=drawn.heading,
            level=drawn.level,
            things=things,
            doors=Doors(shades, drawn.locked, drawn.opened),
            asked=jnp.stack([asked, jnp.full(2, -1, jnp.int32)]),
        )


@dataclasses.dataclass(frozen=True, kw_only=True)
class ObstructedMaze(PickUpWorld):
    """Two or nine rooms with locked doors; pick up the blue ball behind them.

    With nine rooms each side room that is open to the middle one has two locked doors to its
    corners, and their keys; the ball is in one of the corners.

    Attributes:
        quarters: side rooms with locked doors, 1 to 4; 0 for two rooms with one door.
        start_aside: whether an episode begins in the eastern side room; else in the middle one.
        hidden: whether the keys are in boxes.
        blocked: whether a ball lies before each locked door.
    """

    quarters: int = number(0, 0, 4)
    start_aside: bool = False
    hidden: bool = True
    blocked: bool = True

    kinds: ClassVar[tuple[int, ...]] = (KEY_KIND, BALL_KIND, BOX_KIND)
    aim_words: ClassVar[str] = "picked up the blue ball"

    def lay_out(self, key: jax.Array) -> GridState:
        """Draw doors and their colours, what blocks them, the keys, the ball and the start."""
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
