"""Laying out a world inside of a compiled reset: walls, doors, things and the start.

Places are drawn among the tiles that are free, so that no draw is ever rejected. Choosing until a
free tile comes up, as MiniGrid does, has the same distribution.
"""

from __future__ import annotations

from typing import Self

import jax
import jax.numpy as jnp
import numpy as np

from ...engine.level import level_from_walls
from ...maps.symbols import DEFAULT_WALL, door_label
from ...maps.things import COLOUR_NAMES
from ..draws import draw_index
from .state import BOXED, GONE, LYING, Doors, GridState, Things, mask_of

COLOURS = len(COLOUR_NAMES)
Number = int | jax.Array
Tile = tuple[Number, Number] | jax.Array
# Right, down, left, up: (column, row) of a step in each of the four headings.
STEPS = ((1, 0), (0, 1), (-1, 0), (0, -1))


class Sketch:
    """A world that is being laid out; at first an empty room with walls around it.

    Columns and rows may be traced numbers wherever tiles are meant; how many doors and things
    there are may not.

    Attributes:
        walls: bool[rows, columns].
        taken: bool[rows, columns], the tiles of doors and things.
    """

    def __init__(self, key: jax.Array, columns: int, rows: int, draws: int = 128) -> None:
        """Put up the outer walls.

        Args:
            key: of all that is drawn.
            columns: of the world, walls included.
            rows: likewise.
            draws: the most numbers that are drawn.
        """
        self.columns, self.rows = columns, rows
        self._column, self._row = np.indices((columns, rows), np.int32).transpose(0, 2, 1)
        edge = (self._column % (columns - 1) == 0) | (self._row % (rows - 1) == 0)
        self.walls = jnp.asarray(edge)
        self.taken = jnp.zeros((rows, columns), bool)
        self._bits = jax.random.bits(key, (draws,), jnp.uint32)
        self._drawn = 0
        self._doors: list[tuple[jax.Array, Number, bool | jax.Array]] = []
        self._things: list[Things] = []
        self._start: tuple[jax.Array, jax.Array] | None = None

    # Random numbers.

    def bits(self, count: int) -> jax.Array:
        """uint32[count], used by nobody else."""
        self._drawn += count
        assert self._drawn <= self._bits.shape[0], "more draws than were announced"
        return self._bits[self._drawn - count : self._drawn]

    def number(self, low: Number, high: Number) -> jax.Array:
        """int32[], uniform from `low` to `high - 1`."""
        return low + draw_index(self.bits(1)[0], jnp.asarray(high, jnp.int32) - low)

    def colour(self) -> jax.Array:
        """int32[], a colour index."""
        return self.number(0, COLOURS)

    def shuffled(self, count: int) -> jax.Array:
        """int32[count], a random order of 0 to `count - 1`."""
        return jnp.argsort(self.bits(count)).astype(jnp.int32)

    def tile_in(self, mask: jax.Array) -> jax.Array:
        """int32[2], a random tile (column, row) of a mask that has one."""
        rank = jnp.cumsum(mask.reshape(-1).astype(jnp.int32))
        chosen = self.number(0, rank[-1])
        place = jnp.sum(rank <= chosen, dtype=jnp.int32)
        return jnp.stack([place % self.columns, place // self.columns])

    # Parts of the map.

    def area(self, left: Number, top: Number, columns: Number, rows: Number) -> jax.Array:
        """bool[rows, columns], a rectangle of tiles."""
        across = (self._column >= left) & (self._column < left + columns)
        return jnp.asarray(across & (self._row >= top) & (self._row < top + rows))

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
        assert self._start is not None, "nobody said where the agent starts"
        return mask_of(self._start[0][None], jnp.ones(1, bool), self.walls.shape)

    # What is put there.

    def wall(self, mask: jax.Array) -> Self:
        """Put up walls."""
        self.walls = self.walls | mask
        return self

    def clear(self, mask: jax.Array) -> Self:
        """Take walls away."""
        self.walls = self.walls & ~mask
        return self

    def door(
        self, column: Number, row: Number, colour: Number, locked: bool | jax.Array = False
    ) -> int:
        """Put a door into a wall; returns its number."""
        tile = _tile((column, row))
        here = mask_of(tile[None], jnp.ones(1, bool), self.walls.shape)
        self.walls, self.taken = self.walls & ~here, self.taken | here
        self._doors.append((tile, colour, locked))
        return len(self._doors) - 1

    def thing(self, kind: Number, colour: Number, tile: Tile) -> int:
        """Lay a thing down; returns its number."""
        spot = _tile(tile)
        self.taken = self.taken | mask_of(spot[None], jnp.ones(1, bool), self.walls.shape)
        return self._add(kind, colour, spot[None], LYING)

    def spread(self, kind: int, colour: Number, mask: jax.Array, most: int) -> int:
        """Lay one on each tile of a mask, which has `most` of them or fewer."""
        rows, columns = jnp.nonzero(mask, size=most, fill_value=0)
        tiles = jnp.stack([columns, rows], axis=-1).astype(jnp.int32)
        count = jnp.sum(mask, dtype=jnp.int32)
        there = jnp.arange(most, dtype=jnp.int32) < count
        self.taken = self.taken | mask
        return self._add(kind, colour, tiles, jnp.where(there, LYING, GONE))

    def hide(self, kind: Number, colour: Number, box: int) -> int:
        """Put a thing into a box, given by its number; returns its own."""
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
        """Where the agent begins, and in which of the four headings; 0 is east, 1 south."""
        self._start = _tile(tile), jnp.asarray(heading, jnp.int32)
        return self

    def start_in(self, mask: jax.Array, *, facing_free: bool = False) -> Self:
        """Begin on a random free tile of a mask in a random heading.

        Args:
            mask: bool[rows, columns].
            facing_free: whether no door and no thing may be right in front.
        """
        spots = jnp.stack([mask & self.free] * 4)
        if facing_free:
            ahead = [jnp.roll(self.taken, (-dy, -dx), (0, 1)) for dx, dy in STEPS]
            spots = spots & ~jnp.stack(ahead)
        rank = jnp.cumsum(spots.reshape(-1).astype(jnp.int32))
        place = jnp.sum(rank <= self.number(0, rank[-1]), dtype=jnp.int32)
        heading, spot = place // self.walls.size, place % self.walls.size
        tile = jnp.stack([spot % self.columns, spot // self.columns])
        return self.start(tile, heading)

    def state(
        self, asked: tuple[Number, Number] = (-1, -1), near: tuple[Number, Number] = (-1, -1)
    ) -> GridState:
        """The first state of the world.

        Args:
            asked: kind and colour of what the task is about.
            near: of what that is to be put near.
        """
        assert self._start is not None, "nobody said where the agent starts"
        tile, heading = self._start
        spots, colours, locks = _columns(self._doors, 3)
        spots = _stack(spots).reshape(-1, 2)
        colour, locked = _stack(colours), _stack(locks).astype(bool)
        walls = jnp.where(self.walls, DEFAULT_WALL, 0)
        first = jnp.where(locked, door_label(0, locked=True), door_label(0, locked=False))
        if self._doors:
            walls = walls.at[spots[:, 1], spots[:, 0]].set(first + colour)
        nothing = jnp.zeros(0, jnp.int32)
        none = Things(nothing, nothing, jnp.zeros((0, 2), jnp.int32), nothing, nothing)
        things = jax.tree.map(lambda *parts: jnp.concatenate(parts), none, *self._things)
        return GridState(
            position=tile.astype(jnp.float32) + 0.5,
            heading=heading.astype(jnp.float32) * jnp.float32(np.pi / 2),
            level=level_from_walls(walls.astype(jnp.uint8), spots),
            things=things,
            doors=Doors(colour, locked, jnp.zeros(len(self._doors), bool)),
            asked=jnp.stack([_stack(asked), _stack(near)]),
        )


def _tile(tile: Tile) -> jax.Array:
    return tile if isinstance(tile, jax.Array) else _stack(tile)


def _stack(values: object) -> jax.Array:
    """int32, numbers and arrays of them as one array."""
    parts = [jnp.asarray(value, jnp.int32) for value in values]  # type: ignore[attr-defined]
    return jnp.stack(parts) if parts else jnp.zeros(0, jnp.int32)


def _columns(rows: list, count: int) -> list[list]:
    return [[row[i] for row in rows] for i in range(count)]
