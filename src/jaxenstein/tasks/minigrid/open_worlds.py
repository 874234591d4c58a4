"""Worlds with a goal to walk to: open floor, walls with gaps, lava."""

from __future__ import annotations

import dataclasses
from typing import ClassVar, Literal

import jax
import jax.numpy as jnp
import numpy as np

from ...fields import check_whole, choice
from ...params import number
from .sketch import Sketch
from .state import GOAL_KIND, LAVA_KIND, GridState
from .world import GridWorld

Obstacle = Literal["wall", "lava"]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Empty(GridWorld):
    """An empty room with the goal in its south-eastern corner.

    Attributes:
        size: tiles of the room's side, walls included.
        random_start: whether the start is drawn; else it is the north-western corner, facing east.
    """

    size: int = number(8, 4, 64)
    random_start: bool = False

    def lay_out(self, key: jax.Array) -> GridState:
        """The room."""
        return self.room(key).state()

    def room(self, key: jax.Array) -> Sketch:
        """The room with its goal and the start."""
        sketch = Sketch(key, self.size, self.size)
        sketch.thing(GOAL_KIND, 0, (self.size - 2, self.size - 2))
        return sketch.start_in(sketch.free) if self.random_start else sketch.start((1, 1))


@dataclasses.dataclass(frozen=True, kw_only=True)
class FourRooms(GridWorld):
    """Four rooms, each open to two others by a gap; goal and start are anywhere.

    Attributes:
        size: tiles of the world's side, walls included; odd.
    """

    size: int = number(19, 7, 63)

    def lay_out(self, key: jax.Array) -> GridState:
        """Walls, gaps, start and goal."""
        sketch, half = Sketch(key, self.size, self.size), self.size // 2
        middle = sketch.area(half, 0, 1, self.size) | sketch.area(0, half, self.size, 1)
        sketch.wall(middle)
        for first in (0, half):
            gap = sketch.number(first + 1, first + half)
            sketch.clear(sketch.tile(half, gap))
            gap = sketch.number(first + 1, first + half)
            sketch.clear(sketch.tile(gap, half))
        sketch.start_in(sketch.free)
        sketch.thing(GOAL_KIND, 0, sketch.tile_in(sketch.free & ~sketch.start_tile))
        return sketch.state()


@dataclasses.dataclass(frozen=True, kw_only=True)
class Crossing(GridWorld):
    """Walls or streams of lava from side to side, each with one gap on a way to the goal.

    The start is in the north-western corner, the goal in the south-eastern one.

    Attributes:
        size: tiles of the world's side, walls included; odd.
        crossings: how many walls or streams.
        obstacle: `"wall"` or `"lava"`.
    """

    size: int = number(9, 5, 63)
    crossings: int = 1
    obstacle: Obstacle = choice("lava", Obstacle)

    kinds: ClassVar[tuple[int, ...]] = (GOAL_KIND, LAVA_KIND)

    def __post_init__(self) -> None:
        """Check the settings."""
        super().__post_init__()
        check_whole("crossings", self.crossings, 1, self.size - 3)

    def lay_out(self, key: jax.Array) -> GridState:
        """Draw which lines are crossed, an order in which to cross them, and the gaps."""
        size, count = self.size, self.crossings
        sketch = Sketch(key, size, size)
        places = np.arange(2, size - 2, 2, dtype=np.int32)
        chosen = sketch.shuffled(2 * len(places)) < count
        across, down = jnp.split(chosen, 2)
        # Lines that run from north to south, by their columns, and from west to east, by rows.
        lines = [
            jnp.any(np.arange(size)[None] == jnp.where(c, places, 0)[:, None], 0)
            & (np.arange(size) > 0)
            for c in (across, down)
        ]
        inside = sketch.area(1, 1, size - 2, size - 2)
        streams = (lines[0][None, :] | lines[1][:, None]) & inside
        limits = [_limits(c, places, size - 1) for c in (across, down)]
        east = sketch.shuffled(count) < jnp.sum(across, dtype=jnp.int32)
        room = [jnp.int32(0), jnp.int32(0)]
        for to_east in east:
            low = [limits[i][room[i]] for i in (0, 1)]
            high = [limits[i][room[i] + 1] for i in (0, 1)]
            column = jnp.where(to_east, high[0], sketch.number(low[0] + 1, high[0]))
            row = jnp.where(to_east, sketch.number(low[1] + 1, high[1]), high[1])
            streams = streams & ~sketch.tile(column, row)
            room = [room[0] + jnp.where(to_east, 1, 0), room[1] + jnp.where(to_east, 0, 1)]
        return self._flow(sketch, streams)

    def _flow(self, sketch: Sketch, streams: jax.Array) -> GridState:
        size = self.size
        sketch.thing(GOAL_KIND, 0, (size - 2, size - 2))
        if self.obstacle == "wall":
            sketch.wall(streams)
        else:
            sketch.spread(LAVA_KIND, 0, streams, self.crossings * (size - 3))
        return sketch.start((1, 1)).state()


def _limits(chosen: jax.Array, places: np.ndarray, last: int) -> jax.Array:
    """int32[n + 2]: 0, the chosen ones of n places in order, and the last place."""
    inner = jnp.sort(jnp.where(chosen, places, last))
    ends = jnp.zeros(1, jnp.int32), jnp.full(1, last, jnp.int32)
    return jnp.concatenate([ends[0], inner, ends[1]])


@dataclasses.dataclass(frozen=True, kw_only=True)
class LavaGap(GridWorld):
    """A stream of lava with one gap between the start and the goal.

    Attributes:
        size: tiles of the world's side, walls included.
    """

    size: int = number(7, 5, 64)

    kinds: ClassVar[tuple[int, ...]] = (GOAL_KIND, LAVA_KIND)

    def lay_out(self, key: jax.Array) -> GridState:
        """Draw the gap."""
        size = self.size
        sketch = Sketch(key, size, size)
        column, row = sketch.number(2, size - 2), sketch.number(1, size - 1)
        stream = sketch.area(column, 1, 1, size - 2) & ~sketch.tile(column, row)
        sketch.thing(GOAL_KIND, 0, (size - 2, size - 2))
        sketch.spread(LAVA_KIND, 0, stream, size - 3)
        return sketch.start((1, 1)).state()


@dataclasses.dataclass(frozen=True, kw_only=True)
class DistShift(GridWorld):
    """Two strips of lava between start and goal; where the second one lies is a setting.

    Attributes:
        strip_row: row of the second strip, 2 to 5.
    """

    strip_row: int = number(2, 2, 5)

    kinds: ClassVar[tuple[int, ...]] = (GOAL_KIND, LAVA_KIND)

    def lay_out(self, key: jax.Array) -> GridState:
        """The one layout."""
        sketch = Sketch(key, 9, 7)
        sketch.thing(GOAL_KIND, 0, (7, 1))
        strips = sketch.area(3, 1, 3, 1) | sketch.area(3, self.strip_row, 3, 1)
        sketch.spread(LAVA_KIND, 0, strips, 6)
        return sketch.start((1, 1)).state()
