"""A room in which obstacles wander."""

from __future__ import annotations

import dataclasses
from typing import ClassVar, cast

import jax
import jax.numpy as jnp

from ...engine.motion import forward, touched_door
from ...environment import Scalar
from ...fields import check_whole
from ...params import number
from ..draws import draw_index
from ..steering import BACKWARD, FORWARD
from .open_worlds import Empty
from .state import BALL_KIND, GOAL_KIND, GridState, around, mask_of, solid_level
from .world import GridParams

BLUE = 2


class WandererParams(GridParams):
    """The numbers of the task.

    Attributes:
        fail_reward: reward of walking into an obstacle.
        wander_period: steps of the world from one move of the obstacles to the next.
    """

    fail_reward: Scalar = -1.0
    wander_period: Scalar = number(7, 1)


WANDERING = WandererParams()


@dataclasses.dataclass(frozen=True, kw_only=True)
class DynamicObstacles(Empty):
    """An empty room in which balls wander; walking into one ends the episode.

    Every `wander_period` steps each ball, one after another, moves to a random free tile of the
    eight around it.

    Attributes:
        obstacles: how many balls there are.
    """

    obstacles: int = 4
    defaults: GridParams = WANDERING

    kinds: ClassVar[tuple[int, ...]] = (BALL_KIND, GOAL_KIND)
    hands: ClassVar[bool] = False
    fail_words: ClassVar[str] = "walked into an obstacle"

    def __post_init__(self) -> None:
        """Check the settings."""
        super().__post_init__()
        check_whole("obstacles", self.obstacles, 1, self.size // 2 + 1)

    def lay_out(self, key: jax.Array) -> GridState:
        """The room with its balls."""
        sketch = self.room(key)
        for _ in range(self.obstacles):
            tile = sketch.tile_in(sketch.free & ~sketch.start_tile)
            sketch.thing(BALL_KIND, BLUE, tile)
        return sketch.state()

    def judge(
        self, before: GridState, after: GridState, action: jax.Array, params: GridParams
    ) -> tuple[jax.Array, jax.Array]:
        """The goal, and whether the agent walked into a ball."""
        solved, _ = super().judge(before, after, action, params)
        pace = jnp.where(action == FORWARD, 1.0, jnp.where(action == BACKWARD, -1.0, 0.0))
        step = forward(after.heading) * (pace * params.move_distance)
        touched = touched_door(*solid_level(before), before.position, step)
        return solved, (pace != 0) & jnp.any(touched)

    def drift(self, key: jax.Array, state: GridState, params: GridParams) -> GridState:
        """Move the balls, one after another, if it is time."""
        things, walls = state.things, jnp.asarray(state.level.walls)[0] != 0
        count = things.kind.shape[0]
        period = jnp.asarray(cast(WandererParams, params).wander_period)
        due = (state.time + 1) % jnp.maximum(period, 1) == 0
        own = mask_of(state.cell[None], jnp.ones(1, bool), walls.shape)

        def move(tiles: jax.Array, turn: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, None]:
            index, bits = turn
            taken = walls | own | mask_of(tiles, jnp.ones(count, bool), walls.shape)
            rank = jnp.cumsum((around(tiles[index], walls.shape) & ~taken).reshape(-1))
            place = jnp.sum(rank <= draw_index(bits, rank[-1]), dtype=jnp.int32)
            tile = jnp.stack([place % walls.shape[1], place // walls.shape[1]])
            moves = (things.kind[index] == BALL_KIND) & (rank[-1] > 0) & due
            return tiles.at[index].set(jnp.where(moves, tile, tiles[index])), None

        turns = jnp.arange(count, dtype=jnp.int32), jax.random.bits(key, (count,), jnp.uint32)
        tiles, _ = jax.lax.scan(move, things.tile, turns)
        return state.replace(things=things.replace(tile=tiles))
