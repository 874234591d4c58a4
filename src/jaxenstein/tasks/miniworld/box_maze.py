"""MiniWorld's mazes with a red box to reach, new in every episode."""

from __future__ import annotations

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np

from ...engine.level import Level, level_from_walls
from ...params import number
from ..draws import sample_index, sample_unit
from ..first_person import GeneratedTask
from ..goals import NavigationParams
from ..random_maze import carve
from ..steering import sample_heading
from .rooms import BRICK, BoxState, ReachBox

# Tiles along a cell's side, and from one cell to the next: walls are a tile thick.
_CELL = 3
_PITCH = _CELL + 1
# The distance of a start and a box from the edges of their cell; how many starts are drawn.
_BODY, _BOX, _TRIES = 0.4, 0.566, 16


class BoxMazeState(BoxState):
    """The state of the task.

    Attributes:
        level: the walls of this episode.
    """

    level: Level


@dataclasses.dataclass(frozen=True, kw_only=True)
class BoxMaze(GeneratedTask[BoxMazeState, NavigationParams], ReachBox[BoxMazeState]):
    """A red box to reach in a maze of wide cells; actions and reward are those of `ReachBox`.

    Attributes:
        cells: cells per row and per column, 1 to 15.
    """

    cells: int = number(8, 1, 15)

    def init_state(self, key: jax.Array, params: NavigationParams) -> BoxMazeState:
        """Sample the maze, the position of its box, and a start."""
        level_key, start_key = jax.random.split(key)
        count = self.cells
        bits = jax.random.bits(self.level_key(level_key), (count**2 + 3,), jnp.uint32)
        goal = self._place(bits[-3:], _BOX)
        starts = jax.random.bits(start_key, (_TRIES + 1, 3), jnp.uint32)
        places = jax.vmap(functools.partial(self._place, margin=_BODY))(starts[:-1])
        near = jnp.sum((places - goal[None]) ** 2, axis=-1) <= jnp.square(params.goal_radius)
        return BoxMazeState(
            position=places[jnp.argmin(near)],
            heading=sample_heading(starts[-1, 0], None),
            level=level_from_walls(jnp.where(self._floor(bits[:-3]), 0, BRICK).astype(jnp.uint8)),
            goal=goal,
        )

    def level_parts(self, state: BoxMazeState) -> tuple[jax.Array, ...]:
        """The walls, and the cell of the box, whatever the box's position in it."""
        cell = jnp.floor((state.goal - 1) / _PITCH).astype(jnp.int32)
        return jnp.asarray(state.level.walls), cell

    def level_of(self, state: BoxMazeState) -> Level:
        """The level of the maze."""
        return state.level

    def _place(self, bits: jax.Array, margin: float) -> jax.Array:
        """float32[2]: a position in any cell, at a distance from its edges, from uint32[3]."""
        cell = sample_index(bits[0], self.cells**2)
        corner = 1 + _PITCH * jnp.stack([cell % self.cells, cell // self.cells])
        inside = margin + sample_unit(bits[1:]) * jnp.float32(_CELL - 2 * margin)
        return corner.astype(jnp.float32) + inside

    def _floor(self, bits: jax.Array) -> jax.Array:
        """bool[rows, columns], the floor of a maze of cells, by recursive backtracking."""
        _, links = carve(bits, jnp.zeros((self.cells, self.cells), jnp.int32))
        tile = np.arange(_PITCH * self.cells)
        cell, between = tile // _PITCH, tile % _PITCH == _CELL
        east, south = (link[cell][:, cell] for link in links)
        across, down = between[None], between[:, None]
        inside = jnp.where(across, east & ~down, jnp.where(down, south, True))
        return jnp.pad(inside, ((1, 0), (1, 0)))
