"""A chain of rooms joined by doors, laid out one after another."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..._jax.batching import varying
from ...params import number
from ..draws import sample_index
from .sketch import COLOURS, Sketch
from .state import GOAL_KIND, GridState
from .world import GridWorld

# Tiles along the world's side; the least along a room's.
SIDE, LEAST = 25, 4
# How often a room is tried, as in MiniGrid, and the most rooms that are laid out for a reset,
# including those of rejected chains.
_TRIES, _ROUNDS = 8, 2**14
# Random numbers per try.
_DRAWS = 5
# Stands for the wall with the entry of the first room, which has none.
_WEST = 2


class Chain(NamedTuple):
    """The rooms of a chain, at most R.

    Attributes:
        top: int32[R, 2], (column, row) of each room's upper left corner, walls included.
        size: int32[R, 2], its columns and rows, walls included.
        entry: int32[R, 2], (column, row) of the door into it; for the first room, not a door.
        length: int32[], the number of rooms.
    """

    top: jax.Array
    size: jax.Array
    entry: jax.Array
    length: jax.Array


@dataclasses.dataclass(frozen=True, kw_only=True)
class MultiRoom(GridWorld):
    """A chain of rooms joined by closed doors, the start in the first, the goal in the last.

    Attributes:
        rooms: the number of rooms, 2 to 6.
        room_size: the largest number of tiles along a room's side, walls included, 4 to 10.
    """

    rooms: int = number(6, 2, 6)
    room_size: int = number(10, LEAST, 10)

    def lay_out(self, key: jax.Array) -> GridState:
        """Sample chains until one has all its rooms; then doors, start and goal.

        If no chain does after 2**14 rooms, which is extremely unlikely, the last incomplete chain
        is used: its goal is reached through fewer doors.
        """
        chain_key, key = jax.random.split(key)
        chain = self._chain(chain_key)
        sketch = Sketch(key, SIDE, SIDE)
        sketch.wall(jnp.ones((SIDE, SIDE), bool))
        for i in range(self.rooms):
            inside = sketch.area(*(chain.top[i] + 1), *(chain.size[i] - 2))
            sketch.clear(inside & (i < chain.length))
        colour = sketch.colour()
        for i in range(1, self.rooms):
            there = i < chain.length
            column, row = jnp.where(there, chain.entry[i], 0)
            sketch.door(column, row, colour)
            # Any colour except that of the previous door.
            colour = (colour + sketch.number(1, COLOURS)) % COLOURS
        last = chain.length - 1
        sketch.start_in(sketch.area(*chain.top[0], *chain.size[0]))
        free = sketch.area(*chain.top[last], *chain.size[last]) & sketch.free
        sketch.thing(GOAL_KIND, 0, sketch.tile_in(free & ~sketch.start_tile))
        return sketch.state()

    def _chain(self, key: jax.Array) -> Chain:
        """The first chain that has all its rooms.

        If no try for a room fits, another chain starts at once. So a batch waits for the member
        that needs most rooms, not for the longest chain in each round.
        """

        def short(carry: tuple[jax.Array, Chain, jax.Array]) -> jax.Array:
            number, chain, _ = carry
            going = (number < _ROUNDS) | (chain.length == 0)
            return (chain.length < self.rooms) & going

        def lengthen(
            carry: tuple[jax.Array, Chain, jax.Array],
        ) -> tuple[jax.Array, Chain, jax.Array]:
            number, chain, wall = carry
            bits = jax.random.bits(jax.random.fold_in(key, number), (_TRIES, _DRAWS), jnp.uint32)
            return number + 1, *self._with_room(bits, chain, wall)

        nothing = jnp.zeros((self.rooms, 2), jnp.int32)
        empty = Chain(nothing, nothing, nothing, jnp.int32(0))
        start = varying((jnp.int32(0), empty, jnp.int32(_WEST)), key)
        return jax.lax.while_loop(short, lengthen, start)[1]

    def _with_room(self, bits: jax.Array, chain: Chain, wall: jax.Array) -> tuple[Chain, jax.Array]:
        """Add the first try that fits, or reset to an empty chain; also returns its entry's wall.

        Args:
            bits: uint32[tries, 5].
            chain: an incomplete chain.
            wall: int32[], the wall of the last room that has its entry.
        """
        last = jnp.maximum(chain.length - 1, 0)
        tries = jax.vmap(lambda b: self._try(b, chain.top[last], chain.size[last], wall))
        tops, sizes, entries, walls = tries(bits)
        first = chain.length == 0
        start = jnp.stack([sample_index(bits[0, 3], SIDE - 2), sample_index(bits[0, 4], SIDE - 2)])
        entries = jnp.where(first, start[None], entries)
        tops = jnp.where(first, start[None], tops)
        # The first room has a single try.
        fits = self._fits(chain, tops, sizes) & (~first | (np.arange(_TRIES) == 0))
        chosen, added = jnp.argmax(fits), jnp.any(fits)
        here = (np.arange(self.rooms, dtype=np.int32) == chain.length)[:, None] & added
        grown = Chain(
            jnp.where(here, tops[chosen][None], chain.top),
            jnp.where(here, sizes[chosen][None], chain.size),
            jnp.where(here, entries[chosen][None], chain.entry),
            jnp.where(added, chain.length + 1, 0),
        )
        return grown, jnp.where(first | ~added, _WEST, walls[chosen])

    def _try(
        self, bits: jax.Array, top: jax.Array, size: jax.Array, entered: jax.Array
    ) -> tuple[jax.Array, jax.Array, jax.Array, jax.Array]:
        """Propose a next room: its corner, its size, its entry, and the wall of its entry.

        Args:
            bits: uint32[5].
            top: int32[2], the corner of the previous room.
            size: int32[2], its size.
            entered: int32[], the wall with its entry: 0 east, 1 south, 2 west, 3 north.
        """
        span = self.room_size - LEAST + 1
        new = LEAST + jnp.stack([sample_index(bits[0], span), sample_index(bits[1] << 8, span)])
        # One of the other three walls of the previous room, in order.
        way = sample_index(bits[2], 3)
        way = way + jnp.where(way >= entered, 1, 0)
        along = jnp.where(way % 2 == 0, 1, 0)
        # Positions of the door along the wall, without its two corners.
        place = 1 + sample_index(bits[3], size[along] - 2)
        far = jnp.where(way < 2, size - 1, 0)
        axis = np.arange(2, dtype=np.int32)
        entry = top + jnp.where(axis == along, place, far)
        # The new room has the door in the opposite wall, anywhere except in its corners.
        shift = sample_index(bits[4], new[along] - 2) - new[along] + 2
        beyond = jnp.where(way < 2, 0, 1 - new)
        corner = entry + jnp.where(axis == along, shift, beyond)
        return corner, new, entry, (way + 2) % 4

    def _fits(self, chain: Chain, tops: jax.Array, sizes: jax.Array) -> jax.Array:
        """bool[tries]: whether rooms are on the map and apart from all but the previous room."""
        ends = tops + sizes
        on_map = jnp.all(tops >= 0, axis=-1) & (ends[:, 0] <= SIDE) & (ends[:, 1] < SIDE)
        before = ends[:, None] < chain.top[None]
        after = (chain.top + chain.size)[None] <= tops[:, None]
        apart = jnp.any(before | after, axis=-1)
        others = np.arange(self.rooms, dtype=np.int32) < chain.length - 1
        return on_map & jnp.all(apart | ~others[None], axis=-1)
