"""Worlds with a goal to walk to: open floor, walls with gaps, lava, moving balls."""

from __future__ import annotations

import dataclasses
from typing import ClassVar, Literal, cast

import jax
import jax.numpy as jnp
import numpy as np

from ...engine.motion import forward, touched_door
from ...environment import Scalar
from ...errors import SettingError
from ...fields import check_whole, choice
from ...maps.things import BLUE
from ...params import number
from ...players.walking import mask_of
from ..draws import sample_index
from ..steering import BACKWARD, FORWARD
from .sketch import Sketch
from .state import (
    BALL_KIND,
    GOAL_KIND,
    LAVA_KIND,
    GridState,
    Step,
    around,
    place_of,
    solid_level,
)
from .world import GridParams, GridWorld

Obstacle = Literal["wall", "lava"]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Empty(GridWorld):
    """An empty room with the goal in its south-eastern corner.

    Attributes:
        size: tiles along the room's side, walls included.
        random_start: whether the start is random; else in the north-western corner, facing east.
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
        size: tiles along the world's side, walls included; odd.
    """

    size: int = number(19, 7, 63)

    def __post_init__(self) -> None:
        """Check the settings."""
        super().__post_init__()
        _check_odd(self.size)

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
    """Walls or streams of lava from side to side, each with one gap on a path to the goal.

    The start is in the north-western corner, the goal in the south-eastern one.

    Attributes:
        size: tiles along the world's side, walls included; odd.
        crossings: the number of walls or streams.
        obstacle: `"wall"` or `"lava"`.
    """

    size: int = number(9, 5, 63)
    crossings: int = 1
    obstacle: Obstacle = choice("lava", Obstacle)

    kinds: ClassVar[tuple[int, ...]] = (GOAL_KIND, LAVA_KIND)

    def __post_init__(self) -> None:
        """Check the settings."""
        super().__post_init__()
        _check_odd(self.size)
        check_whole("crossings", self.crossings, 1, self.size - 3)

    def lay_out(self, key: jax.Array) -> GridState:
        """Sample the lines of obstacles, an order in which to cross them, and the gaps."""
        size, count = self.size, self.crossings
        places = np.arange(2, size - 2, 2, dtype=np.int32)
        sketch = Sketch(key, size, size, draws=max(128, 2 * len(places) + 3 * count))
        chosen = sketch.shuffled(2 * len(places)) < count
        across, down = jnp.split(chosen, 2)
        # First the lines from north to south, by column, then those from west to east, by row.
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


def _check_odd(size: int) -> None:
    if size % 2 == 0:
        raise SettingError(f"size must be odd, not {size}")


def _limits(chosen: jax.Array, places: np.ndarray, last: int) -> jax.Array:
    """int32[n + 2]: 0, the chosen ones of n places in order, and the last place."""
    inner = jnp.sort(jnp.where(chosen, places, last))
    ends = jnp.zeros(1, jnp.int32), jnp.full(1, last, jnp.int32)
    return jnp.concatenate([ends[0], inner, ends[1]])


@dataclasses.dataclass(frozen=True, kw_only=True)
class LavaGap(GridWorld):
    """A stream of lava with one gap between the start and the goal.

    Attributes:
        size: tiles along the world's side, walls included.
    """

    size: int = number(7, 5, 64)

    kinds: ClassVar[tuple[int, ...]] = (GOAL_KIND, LAVA_KIND)

    def lay_out(self, key: jax.Array) -> GridState:
        """Sample the gap."""
        size = self.size
        sketch = Sketch(key, size, size)
        column, row = sketch.number(2, size - 2), sketch.number(1, size - 1)
        stream = sketch.area(column, 1, 1, size - 2) & ~sketch.tile(column, row)
        sketch.thing(GOAL_KIND, 0, (size - 2, size - 2))
        sketch.spread(LAVA_KIND, 0, stream, size - 3)
        return sketch.start((1, 1)).state()


@dataclasses.dataclass(frozen=True, kw_only=True)
class DistShift(GridWorld):
    """Two strips of lava between start and goal; the position of the second is a setting.

    Attributes:
        strip_row: row of the second strip, 2 to 5.
    """

    strip_row: int = number(2, 2, 5)

    kinds: ClassVar[tuple[int, ...]] = (GOAL_KIND, LAVA_KIND)

    def lay_out(self, key: jax.Array) -> GridState:
        """The only layout."""
        sketch = Sketch(key, 9, 7)
        sketch.thing(GOAL_KIND, 0, (7, 1))
        strips = sketch.area(3, 1, 3, 1) | sketch.area(3, self.strip_row, 3, 1)
        sketch.spread(LAVA_KIND, 0, strips, 6)
        return sketch.start((1, 1)).state()


class WandererParams(GridParams):
    """The params of the task.

    Attributes:
        fail_reward: reward of walking into an obstacle.
        wander_period: world steps from one move of the obstacles to the next.
    """

    fail_reward: Scalar = -1.0
    wander_period: Scalar = number(7, 1)


WANDERING = WandererParams()


@dataclasses.dataclass(frozen=True, kw_only=True)
class DynamicObstacles(Empty):
    """An empty room with moving balls; walking into a ball ends the episode.

    Every `wander_period` steps the balls move, one after another, each to a random free tile of
    the eight around it.

    Attributes:
        obstacles: the number of balls.
    """

    obstacles: int = 4
    defaults: GridParams = WANDERING

    kinds: ClassVar[tuple[int, ...]] = (BALL_KIND, GOAL_KIND)
    hands: ClassVar[bool] = False
    fail_words: ClassVar[str] = "walked into an obstacle"

    def __post_init__(self) -> None:
        """Check the settings."""
        super().__post_init__()
        inside = (self.size - 2) ** 2 - 2  # without the start and the goal
        check_whole("obstacles", self.obstacles, 1, min(self.size // 2 + 1, inside))

    def lay_out(self, key: jax.Array) -> GridState:
        """The room with its balls."""
        sketch = self.room(key)
        for _ in range(self.obstacles):
            tile = sketch.tile_in(sketch.free & ~sketch.start_tile)
            sketch.thing(BALL_KIND, BLUE, tile)
        return sketch.state()

    def judge(self, step: Step) -> tuple[jax.Array, jax.Array]:
        """Whether the agent reached the goal, and whether it walked into a ball."""
        solved, _ = super().judge(step)
        pace = jnp.where(step.action == FORWARD, 1.0, jnp.where(step.action == BACKWARD, -1.0, 0.0))
        stride = forward(step.after.heading) * (pace * step.params.move_distance)
        touched = touched_door(*solid_level(step.before), step.before.position, stride)
        return solved, (pace != 0) & jnp.any(touched)

    def drift(self, key: jax.Array, state: GridState, params: GridParams) -> GridState:
        """Move the balls, one after another, if it is time."""
        things, walls = state.things, jnp.asarray(state.level.walls)[0] != 0
        count = things.kind.shape[0]
        period = jnp.asarray(cast(WandererParams, params).wander_period)
        due = (state.time + 1) % jnp.maximum(period, 1) == 0
        own = mask_of(state.cell, walls.shape)

        def move(tiles: jax.Array, turn: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, None]:
            index, bits = turn
            taken = walls | own | mask_of(tiles, walls.shape)
            free = around(tiles[index], walls.shape) & ~taken
            count_free = jnp.sum(free, dtype=jnp.int32)
            place = place_of(free, sample_index(bits, count_free))
            tile = jnp.stack([place % walls.shape[1], place // walls.shape[1]])
            moves = (things.kind[index] == BALL_KIND) & (count_free > 0) & due
            return tiles.at[index].set(jnp.where(moves, tile, tiles[index])), None

        turns = jnp.arange(count, dtype=jnp.int32), jax.random.bits(key, (count,), jnp.uint32)
        tiles, _ = jax.lax.scan(move, things.tile, turns)
        return state.replace(things=things.replace(tile=tiles))
