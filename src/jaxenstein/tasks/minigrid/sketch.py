"""Lay out a world in a compiled reset: walls, doors, things and the start.

Positions are sampled from the free tiles, so that no sample is ever rejected. MiniGrid tries until
it finds a free tile, which has the same distribution.
"""

from __future__ import annotations

from typing import Self

import jax
import jax.numpy as jnp
import numpy as np

from ...engine.level import level_from_walls
from ...maps.symbols import DEFAULT_WALL, door_label
from ...maps.things import COLOUR_NAMES
from ...players.walking import mask_of
from ..draws import sample_index
from .state import BOXED, GONE, LYING, Doors, GridState, Things, place_of

COLOURS = len(COLOUR_NAMES)
Number = int | jax.Array
Tile = tuple[Number, Number] | jax.Array
# Right, down, left, up: the (column, row) of a step in each of the four headings.
STEPS = ((1, 0), (0, 1), (-1, 0), (0, -1))
RIGHT, DOWN, LEFT, UP = range(4)
ROOM_SIZE = 6
"""Tiles along a room's side, walls included, by default."""


class Sketch:
    """A world under construction; at first an empty room with walls around it.

    Columns and rows of tiles may be traced numbers; the numbers of doors and things may not.

    Attributes:
        walls: bool[rows, columns].
        taken: bool[rows, columns], the tiles of doors and things.
    """

    def __init__(self, key: jax.Array, columns: int, rows: int, draws: int = 128) -> None:
        """Build the outer walls.

        Args:
            key: the random key of all samples.
            columns: columns of the world, walls included.
            rows: rows of the world, walls included.
            draws: the most numbers that are sampled.
        """
        self.columns, self.rows = columns, rows
        self._column, self._row = np.indices((columns, rows), np.int32).transpose(0, 2, 1)
        edge = (self._column % (columns - 1) == 0) | (self._row % (rows - 1) == 0)
        self.walls = jnp.asarray(edge)
        self.taken = jnp.zeros((rows, columns), bool)
        self._bits = jax.random.bits(key, (draws,), jnp.uint32)
        self._drawn = 0
        self._doors: list[tuple[jax.Array, jax.Array, jax.Array]] = []
        self._things: list[Things] = []
        self._start: tuple[jax.Array, jax.Array] | None = None

    # Random numbers.

    def bits(self, count: int) -> jax.Array:
        """uint32[count], unused random bits."""
        self._drawn += count
        assert self._drawn <= self._bits.shape[0], "more draws than announced"
        return self._bits[self._drawn - count : self._drawn]

    def number(self, low: Number, high: Number) -> jax.Array:
        """int32[], uniform from `low` to `high - 1`."""
        return low + sample_index(self.bits(1)[0], jnp.asarray(high, jnp.int32) - low)

    def colour(self) -> jax.Array:
        """int32[], a colour index."""
        return self.number(0, COLOURS)

    def shuffled(self, count: int) -> jax.Array:
        """int32[count], a random order of 0 to `count - 1`."""
        return jnp.argsort(self.bits(count)).astype(jnp.int32)

    def tile_in(self, mask: jax.Array) -> jax.Array:
        """int32[2], a random tile (column, row) of a mask that has one."""
        place = place_of(mask, self.number(0, jnp.sum(mask, dtype=jnp.int32)))
        return jnp.stack([place % self.columns, place // self.columns])

    # Parts of the map.

    def area(self, left: Number, top: Number, columns: Number, rows: Number) -> jax.Array:
        """bool[rows, columns], a rectangle of tiles."""
        across = (self._column >= left) & (self._column < left + columns)
        return jnp.asarray(across & (self._row >= top) & (self._row < top + rows))

    def lattice(self, step: int) -> jax.Array:
        """bool[rows, columns], every `step`-th column and row: the walls of a grid of rooms."""
        return jnp.asarray((self._column % step == 0) | (self._row % step == 0))

    def tile(self, column: Number, row: Number) -> jax.Array:
        """bool[rows, columns], one tile."""
        return self.area(column, row, 1, 1)

    @property
    def free(self) -> jax.Array:
        """bool[rows, columns], the tiles without wall, door or thing."""
        return ~(self.walls | self.taken)

    @property
    def start_tile(self) -> jax.Array:
        """bool[rows, columns], the tile where the agent starts."""
        assert self._start is not None, "the world has no start yet"
        return mask_of(self._start[0], self.walls.shape)

    # Placing things.

    def wall(self, mask: jax.Array) -> Self:
        """Build walls."""
        self.walls = self.walls | mask
        return self

    def clear(self, mask: jax.Array) -> Self:
        """Remove walls."""
        self.walls = self.walls & ~mask
        return self

    def door(
        self, column: Number, row: Number, colour: Number, locked: bool | jax.Array = False
    ) -> int:
        """Put a door into a wall, or an absent door at (0, 0); returns its number."""
        self.doors(_tile((column, row))[None], _stack([colour]), _stack([locked]).astype(bool))
        return self._door_count - 1

    def doors(self, tiles: jax.Array, colours: jax.Array, locked: jax.Array) -> Self:
        """Put doors int32[D, 2] into walls, with int32[D] colours and bool[D] locks."""
        here = mask_of(tiles, self.walls.shape)
        self.walls, self.taken = self.walls & ~here, self.taken | here
        self._doors.append((tiles, colours, locked))
        return self

    @property
    def _door_count(self) -> int:
        return sum(len(tiles) for tiles, _, _ in self._doors)

    def thing(self, kind: Number, colour: Number, tile: Tile) -> int:
        """Put a thing on a tile; returns its number."""
        spot = _tile(tile)
        self.taken = self.taken | mask_of(spot, self.walls.shape)
        return self._add(kind, colour, spot[None], LYING)

    def spread(self, kind: int, colour: Number, mask: jax.Array, most: int) -> int:
        """Put a thing on each tile of a mask, which has at most `most` tiles."""
        rows, columns = jnp.nonzero(mask, size=most, fill_value=0)
        tiles = jnp.stack([columns, rows], axis=-1).astype(jnp.int32)
        count = jnp.sum(mask, dtype=jnp.int32)
        there = jnp.arange(most, dtype=jnp.int32) < count
        self.taken = self.taken | mask
        return self._add(kind, colour, tiles, jnp.where(there, LYING, GONE))

    def hide(self, kind: Number, colour: Number, box: int) -> int:
        """Put a thing into a box, given by its number; returns the thing's number."""
        tiles = jnp.concatenate([things.tile for things in self._things])
        return self._add(kind, colour, tiles[box : box + 1], BOXED, box)

    def _add(
        self, kind: Number, colour: Number, tiles: jax.Array, place: Number, box: int = -1
    ) -> int:
        count = tiles.shape[0]
        first = sum(things.kind.shape[0] for things in self._things)

        def each(number: Number) -> jax.Array:
            return jnp.broadcast_to(jnp.asarray(number, jnp.int32), (count,))

        self._things.append(Things(each(kind), each(colour), tiles, each(place), each(box)))
        return first

    def start(self, tile: Tile, heading: Number = 0) -> Self:
        """Set the agent's start and one of the four headings; 0 is east, 1 south."""
        self._start = _tile(tile), jnp.asarray(heading, jnp.int32)
        return self

    def start_in(self, mask: jax.Array, *, facing_free: bool = False) -> Self:
        """Start on a random free tile of a mask with a random heading.

        Args:
            mask: bool[rows, columns].
            facing_free: whether the tile in front must be without door and thing.
        """
        spots = jnp.stack([mask & self.free] * 4)
        if facing_free:
            ahead = [jnp.roll(self.taken, (-dy, -dx), (0, 1)) for dx, dy in STEPS]
            spots = spots & ~jnp.stack(ahead)
        place = place_of(spots, self.number(0, jnp.sum(spots, dtype=jnp.int32)))
        heading, spot = place // self.walls.size, place % self.walls.size
        tile = jnp.stack([spot % self.columns, spot // self.columns])
        return self.start(tile, heading)

    def state(
        self, asked: tuple[Number, Number] = (-1, -1), near: tuple[Number, Number] = (-1, -1)
    ) -> GridState:
        """The first state of the world.

        Args:
            asked: kind and colour of the requested thing.
            near: kind and colour of the thing to put it near.
        """
        assert self._start is not None, "the world has no start yet"
        tile, heading = self._start
        no_doors = jnp.zeros((0, 2), jnp.int32), jnp.zeros(0, jnp.int32), jnp.zeros(0, bool)
        spots, colour, locked = map(jnp.concatenate, zip(no_doors, *self._doors, strict=True))
        walls = jnp.where(self.walls, DEFAULT_WALL, 0)
        first = jnp.where(locked, door_label(0, locked=True), door_label(0, locked=False))
        if self._doors:
            walls = walls.at[spots[:, 1], spots[:, 0]].set(first + colour)
            # The tile of doors that the layout does not have.
            walls = walls.at[0, 0].set(DEFAULT_WALL)
        nothing = jnp.zeros(0, jnp.int32)
        none = Things(nothing, nothing, jnp.zeros((0, 2), jnp.int32), nothing, nothing)
        things = jax.tree.map(lambda *parts: jnp.concatenate(parts), none, *self._things)
        return GridState(
            position=tile.astype(jnp.float32) + 0.5,
            heading=heading.astype(jnp.float32) * jnp.float32(np.pi / 2),
            level=level_from_walls(walls.astype(jnp.uint8), spots),
            things=things,
            doors=Doors(colour, locked, jnp.zeros(self._door_count, bool)),
            asked=jnp.stack([_stack(asked), _stack(near)]),
        )


class RoomSketch(Sketch):
    """A grid of rooms under construction; rooms are named by (column, row) of the grid.

    Each inner wall has one place for a door, drawn uniformly along it.
    """

    def __init__(self, key: jax.Array, across: int, down: int, size: int = ROOM_SIZE) -> None:
        """Build all walls, and draw the places for doors.

        Args:
            key: the random key of all samples.
            across: rooms from west to east.
            down: rooms from north to south.
            size: tiles along a room's side, walls included.
        """
        step = size - 1
        super().__init__(key, across * step + 1, down * step + 1)
        self._step = step
        self.wall(self.lattice(step))
        # MiniGrid keeps things away from this tile, wherever the agent starts.
        middle = (across // 2) * step + size // 2, (down // 2) * step + size // 2
        near = abs(self._column - middle[0]) + abs(self._row - middle[1]) < 2
        self._kept_free = jnp.asarray(near)
        self._places: dict[tuple[int, int, int], tuple[Number, Number]] = {}
        for row in range(down):
            for column in range(across):
                self._sample_places(column, row, column < across - 1, row < down - 1)

    def _sample_places(self, column: int, row: int, east: bool, south: bool) -> None:
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
        """Put a door into a room's wall; returns the tile in front of it, inside the room."""
        column, row = self._places[(*room, side)]
        self.door(column, row, colour, locked)
        return column - STEPS[side][0], row - STEPS[side][1]

    def put(self, kind: Number, colour: Number, room: tuple[Number, Number]) -> int:
        """Put a thing into a room; returns its number."""
        spots = self.room(*room) & self.free & ~self._kept_free
        return self.thing(kind, colour, self.tile_in(spots))

    def start_room(self, room: tuple[int, int]) -> RoomSketch:
        """Start anywhere in a room, but not facing a thing or a door."""
        self.start_in(self.room(*room), facing_free=True)
        return self


def _tile(tile: Tile) -> jax.Array:
    return tile if isinstance(tile, jax.Array) else _stack(tile)


def _stack(values: object) -> jax.Array:
    """int32, numbers and arrays of them as one array."""
    parts = [jnp.asarray(value, jnp.int32) for value in values]  # type: ignore[attr-defined]
    return jnp.stack(parts) if parts else jnp.zeros(0, jnp.int32)
