"""DeepMind Lab's explore levels: a maze that is new in every episode, with things to find again.

Rules are those of the levels explore_goal_locations, explore_obstructed_goals,
explore_object_locations and explore_object_rewards of google-deepmind/lab;
docs/originals/dmlab-explore.md says where this port differs.
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
from ..maps.things import APPLE, BALL, BOX, COLOUR_NAMES, GOAL, RGB
from ..players.walking import SHORTEST_PATH, flood
from .appearance import build_theme
from .draws import sample_index, sample_unit
from .first_person import GeneratedTask
from .maze_ways import sample_closed
from .random_maze import MazePlan, RandomMaze, beside_rooms, sample_in_rooms, sample_maze
from .steering import ACTION_NAMES, SteeringParams, steer

Kind = Literal["goal", "apples", "objects"]
FLOOR: tuple[RGB, RGB] = ((204, 118, 52), (184, 102, 42))
SKY: RGB = (142, 190, 228)
# What objects look like: balls in six colours, then boxes.
_OBJECTS = (*BALL.labels, *BOX.labels)
_DOOR = door_label(COLOUR_NAMES.index("grey"), locked=True)


class ExploreParams(SteeringParams):
    """The numbers of the task.

    Attributes:
        pickup_radius: tiles from a thing at which it is taken.
        reward: of a thing that pays.
        bad_reward: of one that costs.
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
    """State of the task; M places for things, S starts, N things.

    Attributes:
        level: the walls of this episode.
        starts: float32[S, 2], (x, y) in tiles.
        starting: int32[], how many of them there are.
        places: float32[M, 2].
        things: float32[N, 2].
        there: bool[N], which things there are in a round.
        good: bool[N], which of them pay.
        left: bool[N], which are left in this round.
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
    """State of the task with D doors.

    Attributes:
        closed: bool[D], which doors are closed in this round.
    """

    closed: jax.Array


@dataclasses.dataclass(frozen=True, kw_only=True)
class Explore(GeneratedTask[ExploreState, ExploreParams]):
    """Take what pays in a maze; once all of it is taken, a new round begins at another start.

    Actions are those of all light ports but "interact". Only time ends the episode.

    Attributes:
        kind: what there is: `"goal"`, one; `"apples"` on half of the places; `"objects"` of
            different looks on half of the places, half of which pay while the others cost, and
            which lie elsewhere in each round.
        plan: what mazes are sampled.
        starts: places to start from in each room.
        places: places for things in each room.
        doors: the most doors, which stand where rooms and corridors meet, or 0 for none. In each
            round those on a random way from the goal to the start are open, and half of the others.
        defaults: the params that `params=None` stands for.
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
        most = self.plan.least**2 - 1
        if not (self.starts >= 1 and self.places >= 2 and self.starts + self.places <= most + 1):
            raise SettingError(
                f"starts, at least 1, and places, at least 2, must be {most + 1} at most together, "
                f"the tiles of a room, not {quoted(self.starts)} and {quoted(self.places)}"
            )
        if self.doors and self.kind != "goal":
            raise SettingError("doors, whose ways lead to a goal, need kind='goal'")

    @property
    def default_params(self) -> ExploreParams:
        """The params that `params=None` stands for."""
        return self.defaults

    @property
    def most_things(self) -> int:
        """How many things there may be."""
        return 1 if self.kind == "goal" else self.plan.rooms * self.places // 2

    @functools.cached_property
    def map_size(self) -> tuple[int, int]:
        """(columns, rows) of the map in tiles."""
        return self.plan.size, self.plan.size

    @functools.cached_property
    def theme(self) -> Theme:
        """How the maze looks."""
        labels = {"goal": (GOAL.label,), "apples": (APPLE.label,)}
        pictures = labels.get(self.kind, _OBJECTS[: self.most_things])
        return build_theme(pictures, doors=self.doors > 0, floor=FLOOR, ceiling=SKY)

    def init_state(self, key: jax.Array, params: ExploreParams) -> ExploreState:
        """Sample a maze, what lies where, and what pays; then the first start."""
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
        # Those of rooms that the maze lacks come last.
        lacking = np.arange(most, dtype=np.int32) >= maze.rooms * self.places
        own = bits[cells : cells + most] >> 1
        places = places[jnp.argsort(jnp.where(lacking, jnp.uint32(2**32 - 1), own))]
        index = np.arange(count, dtype=np.int32)
        good = jnp.ones(count, bool)
        if self.kind == "objects":
            good = jnp.argsort(jnp.argsort(bits[-count:])) < count // 2
        start = functools.partial(ObstructedState, closed=jnp.zeros(self.doors, bool))
        state = (start if self.doors else ExploreState)(
            position=jnp.zeros(2, jnp.float32),
            heading=jnp.float32(0),
            level=self._level_of(maze),
            starts=drawn[:, : self.starts].reshape(-1, 2),
            starting=maze.rooms * self.starts,
            places=places,
            things=places[:count],
            there=jnp.bool_(self.kind == "goal") | (index < maze.rooms * self.places // 2),
            good=good,
            left=jnp.zeros(count, bool),
        )
        return self._begin_round(start_key, state)

    def level_parts(self, state: ExploreState) -> tuple[jax.Array, ...]:
        """The walls with the doors, and the tiles of the goal or of the apples.

        Objects lie on other tiles in each round: all tiles that they may lie on count, and which
        objects pay.
        """
        walls = jnp.asarray(state.level.walls)[0]
        objects = self.kind == "objects"
        places = state.places if objects else state.things
        there = jnp.ones(len(places), bool) if objects else state.there
        column, row = jnp.floor(places).astype(jnp.int32).T
        tiles = jnp.zeros(walls.shape, bool).at[row, column].max(there)
        return walls, tiles, state.good

    def _level_of(self, maze: RandomMaze) -> Level:
        """Corridors have the default walls, each room has a colour of its own."""
        painted = DEFAULT_WALL + beside_rooms(maze)
        walls = jnp.where(maze.open, 0, painted)
        if not self.doors:
            return level_from_walls(walls.astype(jnp.uint8))
        # Doors that the maze lacks stand on its corner.
        row, column = jnp.nonzero(maze.doorways, size=self.doors, fill_value=0)
        real = jnp.zeros(walls.shape, bool).at[row, column].set(True) & maze.doorways
        walls = jnp.where(real, _DOOR, walls)
        doors = jnp.stack([column, row], axis=1).astype(jnp.int32)
        return level_from_walls(walls.astype(jnp.uint8), doors)

    def _begin_round(self, key: jax.Array, state: ExploreState) -> ExploreState:
        """Another start, any heading, and all things back; objects lie elsewhere."""
        objects = self.kind == "objects"
        bits = jax.random.bits(key, (2 + objects * len(state.places),), jnp.uint32)
        if objects:
            order = jnp.argsort(bits[2:])[: len(state.things)]
            state = state.replace(things=state.places[order])
        state = state.replace(
            position=state.starts[sample_index(bits[0], state.starting)],
            heading=sample_unit(bits[1]) * jnp.float32(2 * math.pi),
            left=state.there,
        )
        return self._close_doors(key, state) if isinstance(state, ObstructedState) else state

    def _close_doors(self, key: jax.Array, state: ObstructedState) -> ObstructedState:
        """Open the doors on a random way to the start, and half of the others."""
        count = self.plan.size**2 + self.doors
        bits = jax.random.bits(jax.random.fold_in(key, 1), (count,), jnp.uint32)
        ends = (jnp.floor(at).astype(jnp.int32) for at in (state.things[0], state.position))
        floor = _floor(state, jnp.zeros(self.doors, bool))
        return state.replace(closed=sample_closed(bits, floor, state.level.doors, *ends))

    def transition(
        self, key: jax.Array, state: ExploreState, action: jax.Array, params: ExploreParams
    ) -> tuple[ExploreState, jax.Array, jax.Array, Info]:
        """Move, take things, and begin a new round once all that pays is taken."""
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
        # A way through the maze is expensive, so it is sampled only where one is needed.
        few = where_few(self._begin_round) if self.doors else None
        begun = few(over, key, state) if few else self._begin_round(key, state)
        state = select(over, begun, state)
        return state, reward, jnp.bool_(False), events | {"respawned": over}

    def about(self) -> About:
        """What the task says of itself."""
        thing = {"goal": "goal", "apples": "apple", "objects": "good object"}[self.kind]
        rewards = {"reward": f"{{:+g}} a {thing}".replace(" a a", " an a")}
        events = {"took": Event(f"took a {thing}".replace(" a a", " an a"), f"took {{}} {thing}s")}
        if self.kind == "objects":
            rewards["bad_reward"] = "{:+g} a bad one"
            events["took_bad"] = Event("took a bad object", "took {} bad objects")
        events["respawned"] = Event("moved to a new start")
        return dataclasses.replace(
            super().about(),
            aim="reached the goal" if self.kind == "goal" else "took all that pays",
            ends="",
            rewards=rewards,
            events=events,
            players={"shortest_path": SHORTEST_PATH},
            expert="shortest_path",
            holds={"something that pays is left": lambda s: jnp.any(s.left & s.good)},
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
        """int32[rows, columns]: tiles on foot to the nearest thing that pays, around bad ones."""
        row, column = np.indices((self.plan.size, self.plan.size), np.int32)
        cells = jnp.floor(state.things).astype(jnp.int32)
        here = (column[None] == cells[:, :1, None]) & (row[None] == cells[:, 1:, None])
        good, bad = (
            jnp.any(here & (state.left & which)[:, None, None], axis=0)
            for which in (state.good, ~state.good)
        )
        return flood(_floor(state, _closed(state)) & ~bad, good)


def _closed(state: ExploreState) -> jax.Array:
    """bool[D]: which doors are closed; there may be none."""
    return state.closed if isinstance(state, ObstructedState) else jnp.zeros(0, bool)


def _floor(state: ExploreState, closed: jax.Array) -> jax.Array:
    """bool[rows, columns], where one can walk with bool[D] doors closed."""
    walls = jnp.asarray(state.level.walls)[0]
    column, row = jnp.asarray(state.level.doors).T
    shut = jnp.zeros(walls.shape, bool).at[row, column].max(closed)
    return ((walls == 0) | (walls == _DOOR)) & ~shut


def level(
    size: int, rooms: int, *, least: int = 3, most: int = 5, **settings: Any
) -> functools.partial[Explore]:
    """One of the original's levels, by the numbers of its `MazePlan` and other settings."""
    fixed = {"kind": "goal", "places": 4, "doors": 0, **settings}
    return functools.partial(Explore, plan=MazePlan(size, rooms, least, most), **fixed)
