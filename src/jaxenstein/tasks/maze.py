"""DeepMind Lab's navigation mazes: a goal to find again and again, and apples on the way.

The rules are those of the levels nav_maze_static_0x and nav_maze_random_goal_0x of
google-deepmind/lab; docs/originals/dmlab.md lists the differences.
"""

from __future__ import annotations

import dataclasses
import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .._jax.batching import varying
from ..about import About, Event
from ..engine.scene import Scene
from ..environment import Info, Scalar
from ..errors import SettingError, quoted
from ..maps.ascii import load_layout
from ..maps.reach import open_tiles, walking_distances
from ..maps.things import APPLE
from ..maps.tilemap import Cell, TileMap
from .draws import sample_index
from .goals import NavigationParams, add_sprites
from .navigation import Navigation, NavigationState
from .steering import centres, sample_heading


class MazeParams(NavigationParams):
    """The params of the task.

    Attributes:
        apple_reward: reward of each apple.
    """

    goal_reward: Scalar = 10.0
    apple_reward: Scalar = 1.0


DEFAULTS = MazeParams()


class MazeState(NavigationState):
    """The state of a maze with A apples.

    Attributes:
        apples: int32[A], the cell of each: an index into `Maze.apple_cells`.
        eaten: bool[A].
    """

    apples: jax.Array
    eaten: jax.Array


@dataclasses.dataclass(frozen=True, kw_only=True)
class Maze(Navigation):
    """Find the goal in a maze, from a start that is far enough away.

    Without `respawn` the goal ends the episode. With it, the agent gets the goal's reward and
    moves to a new start in the same step, apples reappear, and only the time limit ends the
    episode.

    Attributes:
        start_distance: the least walking distance in tiles from a start to the goal.
        respawn: whether the goal moves the agent to a new start instead of ending the episode.
        drawn_apples: number of apples on random other goal cells at each reset; 0 uses the apples
            of the map.
    """

    defaults: MazeParams = DEFAULTS
    start_distance: int = 0
    respawn: bool = False
    drawn_apples: int = 0
    # Apples are few and far apart; more layers take up to three times as long to render.
    sprite_layers: int = 2

    def __post_init__(self) -> None:
        """Check the settings."""
        super().__post_init__()
        if not 0 <= self.drawn_apples < max(len(self.tilemap.goals), 1):
            raise SettingError(
                f"drawn_apples must be 0 to {len(self.tilemap.goals) - 1}, less than the number of "
                f"goal cells, not {quoted(self.drawn_apples)}"
            )
        far_starts(self.tilemap, self.start_distance)

    @property
    def apple_cells(self) -> tuple[Cell, ...]:
        """(column, row) of the possible cells of apples."""
        return self.tilemap.goals if self.drawn_apples else self.tilemap.apples

    @functools.cached_property
    def sprite_labels(self) -> tuple[int, ...]:
        """The labels of the goal and the keys, then of apples if there are any."""
        return (*super().sprite_labels, *((APPLE.label,) if self.apple_cells else ()))

    def init_state(self, key: jax.Array, params: NavigationParams) -> MazeState:
        """Sample the goal, the start, the heading and the apples."""
        del params
        bits = jax.random.bits(key, (3 + self.drawn_apples,), jnp.uint32)
        goal = sample_index(bits[0], len(self.tilemap.goals))
        if self.drawn_apples:
            apples = _subset(bits[3:], len(self.tilemap.goals) - 1)
            # Skip the goal's own cell.
            apples = apples + (apples >= goal).astype(jnp.int32)
        else:
            apples = jnp.arange(len(self.apple_cells), dtype=jnp.int32)
        return MazeState(
            position=self._sample_start(bits[1], goal),
            heading=sample_heading(bits[2], self.heading),
            goal=goal,
            apples=apples,
            eaten=jnp.zeros(apples.shape, bool),
            **self.untouched(),
        )

    def transition(
        self, key: jax.Array, state: Any, action: jax.Array, params: Any
    ) -> tuple[Any, jax.Array, jax.Array, Info]:
        """Navigate, eat apples, and restart at the goal if the maze respawns."""
        state, reward, reached, events = super().transition(key, state, action, params)
        if self.apple_cells:
            offset = centres(self.apple_cells)[state.apples] - state.position[None]
            near = jnp.sqrt(jnp.sum(offset**2, axis=-1)) <= params.pickup_radius
            near = near & ~state.eaten
            count = jnp.sum(near, dtype=jnp.int32)
            reward = reward + params.apple_reward * count.astype(jnp.float32)
            state = state.replace(eaten=state.eaten | near)
            events["ate_apple"] = count
        if not self.respawn:
            return state, reward, reached, events
        bits = jax.random.bits(key, (2,), jnp.uint32)
        anew = state.replace(
            position=self._sample_start(bits[0], state.goal),
            heading=sample_heading(bits[1], self.heading),
            eaten=jnp.zeros_like(state.eaten),
            **self.untouched(),
        )
        state = jax.tree.map(lambda a, b: jnp.where(reached, a, b), anew, state)
        return state, reward, jnp.zeros_like(reached), events | {"respawned": reached}

    def about(self) -> About:
        """A description of the task, with apples and respawns if it has them."""
        about = super().about()
        events, rewards, ends = dict(about.events), dict(about.rewards), about.ends
        reached = events.pop("reached_goal")
        if self.apple_cells:
            events["ate_apple"] = Event("ate an apple", "ate {} apples")
            rewards["apple_reward"] = "{:+g} per apple"
        events["reached_goal"] = reached
        if self.respawn:
            events["respawned"] = Event("moved to a new start")
            ends = ""
        return dataclasses.replace(
            about,
            events=events,
            rewards=rewards,
            ends=ends,
            lasting=(*about.lasting, "eaten"),
            holds={
                **about.holds,
                "apples are in different, existing cells": self._apples_are_valid,
            },
        )

    def _apples_are_valid(self, state: MazeState) -> jax.Array:
        cells = jnp.sort(state.apples)
        inside = (cells >= 0) & (cells < len(self.apple_cells))
        return jnp.all(inside) & jnp.all(cells[1:] != cells[:-1])

    def scene(self, state: Any, params: Any) -> Scene:
        """Add the apples that are left."""
        scene = super().scene(state, params)
        if not self.apple_cells:
            return scene
        picture = jnp.full(state.apples.shape, self.sprite_labels.index(APPLE.label), jnp.int32)
        return add_sprites(scene, centres(self.apple_cells)[state.apples], picture, ~state.eaten)

    def _sample_start(self, bits: jax.Array, goal: jax.Array) -> jax.Array:
        """float32[2]: the centre of a start far enough from the goal, drawn uniformly."""
        starts, counts = far_starts(self.tilemap, self.start_distance)
        index = sample_index(bits, jnp.asarray(counts)[goal])
        return centres(self.tilemap.spawns)[jnp.asarray(starts)[goal, index]]


def _subset(bits: jax.Array, count: int) -> jax.Array:
    """int32[n]: n different numbers below `count`; all subsets are equally likely (R. W. Floyd).

    Args:
        bits: uint32[n].
        count: at least n.
    """
    size = bits.shape[0]

    def choose(i: jax.Array, chosen: jax.Array) -> jax.Array:
        last = count - size + i
        drawn = sample_index(bits[i], last + 1)
        return chosen.at[i].set(jnp.where(jnp.any(chosen == drawn), last, drawn))

    start = varying(jnp.full(size, -1, jnp.int32), bits)
    return jax.lax.fori_loop(0, size, choose, start)


@functools.cache
def far_starts(tilemap: TileMap, distance: int) -> tuple[np.ndarray, np.ndarray]:
    """The spawns far enough from each goal: int32[goals, spawns], left-aligned, and their counts.

    Args:
        tilemap: the map; all its doors count as open.
        distance: the least walking distance in tiles; 0 allows all spawns.

    Raises:
        SettingError: no spawn is that far from a goal.
    """
    spawns = np.array(tilemap.spawns).reshape(-1, 2)
    if distance <= 0:
        allowed = np.ones((len(tilemap.goals), len(spawns)), bool)
    else:
        steps = walking_distances(open_tiles(tilemap), tilemap.goals)
        allowed = steps[:, spawns[:, 1], spawns[:, 0]] >= distance
    counts = allowed.sum(axis=1).astype(np.int32)
    if (counts == 0).any():
        column, row = tilemap.goals[int(np.argmin(counts))]
        raise SettingError(
            f"start_distance {distance}: no start is that far from the goal at column {column}, "
            f"row {row} (from 0)"
        )
    return np.argsort(~allowed, axis=1, kind="stable").astype(np.int32), counts


# The floor (two colours of a checker) of the mazes 01, 02 and 03 of DeepMind Lab, after the names
# of their textures, and the sky above them.
FLOORS = (
    ((204, 118, 52), (184, 102, 42)),
    ((70, 112, 188), (60, 98, 170)),
    ((78, 150, 84), (66, 126, 150)),
)
SKY = (142, 190, 228)
# Five cells of two tiles.
_START_DISTANCE = 10


def dmlab(kind: str, number: int, respawn: bool) -> functools.partial[Maze]:
    """A maze of DeepMind Lab, number 1 to 3; `kind` is "static" or "random-goal"."""
    tilemap = load_layout(f"dmlab-{kind}-{number:02}", goal_required=False)
    cells = tilemap.apples
    if kind == "random-goal":
        tilemap = dataclasses.replace(tilemap, spawns=cells, goals=cells, apples=())
    elif not respawn:
        tilemap = dataclasses.replace(tilemap, apples=())
    return functools.partial(
        Maze,
        tilemap=tilemap,
        start_distance=_START_DISTANCE,
        respawn=respawn,
        drawn_apples=len(cells) // 10 if kind == "random-goal" and respawn else 0,
        floor=FLOORS[number - 1],
        ceiling=SKY,
    )
