"""DeepMind Lab's explore levels: a new maze in every episode, with things to find again.

The rules are those of the levels explore_goal_locations, explore_obstructed_goals,
explore_object_locations and explore_object_rewards of google-deepmind/lab;
docs/originals/dmlab-explore.md lists the differences.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import Any, ClassVar, Literal

import jax
import jax.numpy as jnp
import numpy as np

from .._jax.batching import select, where_few
from ..about import About, Event
from ..engine.level import Level, level_from_walls
from ..engine.scene import Scene, Sprites, Theme
from ..environment import Info, Scalar, State
from ..errors import SettingError, quoted
from ..fields import choice, number
from ..maps.symbols import DEFAULT_WALL, door_label
from ..maps.things import APPLE, BALL, BOX, GOAL, GREY
from ..players.walking import SHORTEST_PATH, flood, mask_of
from .appearance import build_theme
from .draws import random_order, sample_index, sample_unit
from .first_person import GeneratedTask
from .maze import FLOORS, SKY
from .maze_ways import sample_closed
from .random_maze import MazePlan, RandomMaze, beside_rooms, sample_in_rooms, sample_maze
from .steering import ACTION_NAMES, SteeringParams, steer

Kind = Literal["goal", "apples", "objects"]
# The labels of objects: balls in six colours, then boxes.
_OBJECTS = (*BALL.labels, *BOX.labels)
_DOOR = door_label(GREY, locked=True)


class ExploreParams(SteeringParams):
    """The params of the task.

    Attributes:
        pickup_radius: distance in tiles at which a thing is taken.
        reward: reward of a good thing.
        bad_reward: reward of a bad thing.
    """

    discount: Scalar = 0.999
    turn_angle: Scalar = math.radians(8.8)
    move_distance: Scalar = 3.2 / 15
    pickup_radius: Scalar = number(0.4, 0)
    reward: Scalar = 10.0
    bad_reward: Scalar = -1.0


DEFAULTS = ExploreParams()
PLAN = MazePlan(11, 4)


class ExploreState(State):
    """The state of the task; M places for things, S starts, N things.

    Attributes:
        level: the walls of this episode.
        starts: float32[S, 2], (x, y) in tiles.
        starting: int32[], the number of starts.
        places: float32[M, 2], (x, y) in tiles.
        things: float32[N, 2], (x, y) in tiles.
        there: bool[N], which things are present at the beginning of a round.
        good: bool[N], which things are good.
        left: bool[N], which things are left in this round.
    """

    level: Level
    starts: jax.Array
    starting: jax.Array
    places: jax.Array
    things: jax.Array
    there: jax.Array
    good: jax.Array
    left: jax.Array


class ObstructedState(ExploreState):
    """The state of the task with D doors.

    Attributes:
        closed: bool[D], which doors are closed in this round.
    """

    closed: jax.Array


@dataclasses.dataclass(frozen=True, kw_only=True)
class Explore(GeneratedTask[ExploreState, ExploreParams]):
    """Take all good things in a maze; then a new round begins at a random start.

    The actions are turn left, turn right, forward and backward. Only the time limit ends the
    episode.

    Attributes:
        kind: the kind of things: `"goal"`, a single one; `"apples"` on half of the places;
            `"objects"` of different looks on half of the places, which change in each round. Half
            of the objects are good, the others bad.
        plan: the distribution of mazes.
        starts: the number of starts in each room.
        places: the number of places for things in each room.
        doors: the largest number of doors, which are where rooms and corridors meet; 0 for none.
            In each round, the doors on a random path from the goal to the start are open, and half
            of the others.
        defaults: the default params.
    """

    kind: Kind = choice("goal", Kind)
    plan: MazePlan = PLAN
    starts: int = 5
    places: int = 4
    doors: int = number(0, 0, 256)
    defaults: ExploreParams = DEFAULTS
    field_of_view: float = 90.0
    sprite_layers: int = 2

    action_names: ClassVar[tuple[str, ...]] = ACTION_NAMES[:4]
    success_event: ClassVar[str] = "respawned"

    def __post_init__(self) -> None:
        """Check the settings."""
        super().__post_init__()
        most = self.plan.least**2
        if not (self.starts >= 1 and self.places >= 2 and self.starts + self.places <= most):
            raise SettingError(
                f"starts must be at least 1, places at least 2, and their sum at most {most}, "
                f"the tiles of a room, not {quoted(self.starts)} and {quoted(self.places)}"
            )
        if self.doors and self.kind != "goal":
            raise SettingError("doors need kind='goal', because they leave a path to the goal open")

    @property
    def default_params(self) -> ExploreParams:
        """The default params."""
        return self.defaults

    @property
    def most_things(self) -> int:
        """The largest number of things."""
        return 1 if self.kind == "goal" else self.plan.rooms * self.places // 2

    @functools.cached_property
    def map_size(self) -> tuple[int, int]:
        """(columns, rows) of the map in tiles."""
        return self.plan.size, self.plan.size

    @functools.cached_property
    def theme(self) -> Theme:
        """The look of the maze."""
        labels = {"goal": (GOAL.label,), "apples": (APPLE.label,)}
        pictures = labels.get(self.kind, _OBJECTS[: self.most_things])
        return build_theme(pictures, doors=self.doors > 0, floor=FLOORS[0], ceiling=SKY)

    def init_state(self, key: jax.Array, params: ExploreParams) -> ExploreState:
        """Sample a maze, the places of things, the good ones, and the first start."""
        del params
        level_key, start_key = jax.random.split(key)
        maze_key, things_key = jax.random.split(self.level_key(level_key))
        maze = sample_maze(maze_key, self.plan)
        cells, rooms = self.plan.size**2, self.plan.rooms
        most, count = rooms * self.places, self.most_things
        bits = jax.random.bits(things_key, (cells + most + count,), jnp.uint32)
        drawn = sample_in_rooms(bits[:cells], maze, rooms, self.starts + self.places)
        drawn = drawn.astype(jnp.float32) + 0.5
        places = drawn[:, self.starts :].reshape(-1, 2)
        places = places[random_order(bits[cells : cells + most], maze.rooms * self.places)]
        index, real = np.arange(count, dtype=np.int32), maze.rooms * self.places // 2
        good = jnp.ones(count, bool)
        if self.kind == "objects":
            good = jnp.argsort(random_order(bits[-count:], real)) < real // 2
        start = functools.partial(ObstructedState, closed=jnp.zeros(self.doors, bool))
        state = (start if self.doors else ExploreState)(
            position=jnp.zeros(2, jnp.float32),
            heading=jnp.float32(0),
            level=self._level_of(maze),
            starts=drawn[:, : self.starts].reshape(-1, 2),
            starting=maze.rooms * self.starts,
            places=places,
            things=places[:count],
            there=jnp.bool_(self.kind == "goal") | (index < real),
            good=good,
            left=jnp.zeros(count, bool),
        )
        return self._begin_round(start_key, state)

    def level_parts(self, state: ExploreState) -> tuple[jax.Array, ...]:
        """The walls with the doors, and the tiles of the goal or of the apples.

        Objects change their tiles in each round, so for them it is all possible tiles, and which
        objects are good.
        """
        walls = jnp.asarray(state.level.walls)[0]
        objects = self.kind == "objects"
        places = state.places if objects else state.things
        there = jnp.ones(len(places), bool) if objects else state.there
        column, row = jnp.floor(places).astype(jnp.int32).T
        tiles = jnp.zeros(walls.shape, bool).at[row, column].max(there)
        return walls, tiles, state.good

    def _level_of(self, maze: RandomMaze) -> Level:
        """The level of a maze: default walls in corridors, one colour for each room."""
        painted = DEFAULT_WALL + beside_rooms(maze)
        walls = jnp.where(maze.open, 0, painted)
        if not self.doors:
            return level_from_walls(walls.astype(jnp.uint8))
        # Doors that the maze lacks are on its corner.
        row, column = jnp.nonzero(maze.doorways, size=self.doors, fill_value=0)
        real = jnp.zeros(walls.shape, bool).at[row, column].set(True) & maze.doorways
        walls = jnp.where(real, _DOOR, walls)
        doors = jnp.stack([column, row], axis=1).astype(jnp.int32)
        return level_from_walls(walls.astype(jnp.uint8), doors)

    def _begin_round(self, key: jax.Array, state: ExploreState) -> ExploreState:
        """Sample a start and a heading, and put all things back; objects change places."""
        objects = self.kind == "objects"
        bits = jax.random.bits(key, (2 + objects * len(state.places),), jnp.uint32)
        if objects:
            order = random_order(bits[2:], state.starting // self.starts * self.places)
            state = state.replace(things=state.places[order[: len(state.things)]])
        state = state.replace(
            position=state.starts[sample_index(bits[0], state.starting)],
            heading=sample_unit(bits[1]) * jnp.float32(2 * math.pi),
            left=state.there,
        )
        return self._close_doors(key, state) if isinstance(state, ObstructedState) else state

    def _close_doors(self, key: jax.Array, state: ObstructedState) -> ObstructedState:
        """Open the doors on a random path to the start, and half of the others."""
        count = self.plan.size**2 + self.doors
        bits = jax.random.bits(jax.random.fold_in(key, 1), (count,), jnp.uint32)
        ends = (jnp.floor(at).astype(jnp.int32) for at in (state.things[0], state.position))
        floor = _floor(state, jnp.zeros(self.doors, bool))
        return state.replace(closed=sample_closed(bits, floor, state.level.doors, *ends))

    def transition(
        self, key: jax.Array, state: ExploreState, action: jax.Array, params: ExploreParams
    ) -> tuple[ExploreState, jax.Array, jax.Array, Info]:
        """Move, take things, and start a new round when all good things are taken."""
        pose = state.position, state.heading
        position, heading = steer(state.level, _closed(state), *pose, action, params)
        offset = state.things - position[None]
        taken = state.left & (jnp.sqrt(jnp.sum(offset**2, axis=-1)) <= params.pickup_radius)
        good, bad = (jnp.sum(taken & w, dtype=jnp.int32) for w in (state.good, ~state.good))
        reward = params.reward * good.astype(jnp.float32)
        events: Info = {"took": good}
        if self.kind == "objects":
            reward = reward + params.bad_reward * bad.astype(jnp.float32)
            events["took_bad"] = bad
        state = state.replace(position=position, heading=heading, left=state.left & ~taken)
        over = ~jnp.any(state.left & state.good)
        # Sampling a path through the maze is expensive, so it only happens when needed.
        few = where_few(self._begin_round) if self.doors else None
        begun = few(over, key, state) if few else self._begin_round(key, state)
        state = select(over, begun, state)
        return state, reward, jnp.bool_(False), events | {"respawned": over}

    def about(self) -> About:
        """A description of the task."""
        thing = {"goal": "goal", "apples": "apple", "objects": "good object"}[self.kind]
        rewards = {"reward": f"{{:+g}} per {thing}"}
        events = {"took": Event(f"took a {thing}".replace(" a a", " an a"), f"took {{}} {thing}s")}
        if self.kind == "objects":
            rewards["bad_reward"] = "{:+g} per bad object"
            events["took_bad"] = Event("took a bad object", "took {} bad objects")
        events["respawned"] = Event("moved to a new start")
        return dataclasses.replace(
            super().about(),
            aim="reached the goal" if self.kind == "goal" else "took all good things",
            ends="",
            rewards=rewards,
            events=events,
            players={"shortest_path": SHORTEST_PATH},
            expert="shortest_path",
            holds={"a good thing is left": lambda s: jnp.any(s.left & s.good)},
        )

    def scene(self, state: ExploreState, params: ExploreParams) -> Scene:
        """The maze and the things that are left."""
        del params
        pictures = np.arange(self.most_things, dtype=np.int32) * (self.kind == "objects")
        return Scene(
            level=state.level,
            closed=_closed(state),
            position=state.position,
            heading=state.heading,
            sprites=Sprites(state.things, jnp.asarray(pictures, jnp.int32), state.left),
            theme=self.theme,
        )

    def distance_field(self, state: ExploreState) -> jax.Array:
        """int32[rows, columns]: walking distance to the nearest good thing, around bad ones."""
        cells, shape = jnp.floor(state.things).astype(jnp.int32), (self.plan.size, self.plan.size)
        good, bad = (
            mask_of(cells, shape, state.left & which) for which in (state.good, ~state.good)
        )
        return flood(_floor(state, _closed(state)) & ~bad, good)


def _closed(state: ExploreState) -> jax.Array:
    """bool[D]: which doors are closed; there may be none."""
    return state.closed if isinstance(state, ObstructedState) else jnp.zeros(0, bool)


def _floor(state: ExploreState, closed: jax.Array) -> jax.Array:
    """bool[rows, columns], the walkable tiles with bool[D] doors closed."""
    walls = jnp.asarray(state.level.walls)[0]
    column, row = jnp.asarray(state.level.doors).T
    shut = jnp.zeros(walls.shape, bool).at[row, column].max(closed)
    return ((walls == 0) | (walls == _DOOR)) & ~shut


def level(
    size: int, rooms: int, *, least: int = 3, most: int = 5, **settings: Any
) -> functools.partial[Explore]:
    """One of the original levels, by the arguments of its `MazePlan` and other settings."""
    fixed = {"kind": "goal", "places": 4, "doors": 0, **settings}
    return functools.partial(Explore, plan=MazePlan(size, rooms, least, most), **fixed)
