"""Memory Maze: fetch the requested thing, again and again, in a maze that is new in every episode.

Rules and numbers are those of jurgisp/memory-maze; docs/originals/memory-maze.md lists the
differences.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from ..about import About, Choose, Event, Player
from ..engine.level import Level, level_from_walls
from ..engine.motion import forward, length, walk
from ..engine.scene import Scene, Sprites, Theme
from ..engine.shade import ImageKind
from ..environment import Info, Scalar, State
from ..fields import check_whole, number
from ..maps.symbols import LABEL_NAMES
from ..maps.things import BALL, DETAIL_SHADE, RGB
from ..players.walking import SHORTEST_PATH, flood, mask_of, movement_of, remaining
from ..spaces import Box
from .appearance import build_theme
from .draws import random_order, sample_index, sample_unit
from .first_person import GeneratedTask
from .hud import frame
from .random_maze import MazePlan, sample_in_rooms, sample_maze
from .steering import SteeringParams, go

# The colours of the things, and the brightness of the frame relative to them. The sixth colour of
# the original is a salmon that is hard to tell from its red.
COLOURS: tuple[RGB, ...] = (
    (197, 44, 35),
    (115, 197, 102),
    (45, 162, 252),
    (108, 122, 231),
    (255, 224, 68),
    (176, 178, 184),
)
FRAME = 0.7
_RADIUS = 0.3
FLOOR: tuple[RGB, RGB] = ((62, 84, 150), (84, 110, 184))
SKY: RGB = (24, 30, 48)
# Each ninth of the maze draws one of these eight walls.
_WALLS = tuple(
    LABEL_NAMES.index(f"{name} wall")
    for name in ("blue", "magenta", "lime", "green", "salmon", "red", "yellow", "violet")
)
# Turns to the right and moves forward for each action.
_SPIN = np.array((0, 0, -1, 1, -1, 1), np.float32)
_PACE = np.array((0, 1, 0, 0, 1, 1), np.float32)


class MemoryMazeParams(SteeringParams):
    """The params of the task.

    Attributes:
        touch_radius: distance in tiles at which a thing is touched.
        fetch_reward: reward of touching the requested thing.
    """

    discount: Scalar = 0.999
    turn_angle: Scalar = math.radians(21.5)
    move_distance: Scalar = 0.25
    touch_radius: Scalar = number(0.39, 0)
    fetch_reward: Scalar = 1.0


DEFAULTS = MemoryMazeParams()
# The size of memory-maze-9x9, with the border.
PLAN = MazePlan(11, 6, fewest=3)


class MemoryMazeState(State):
    """The state of the task with N things.

    Attributes:
        level: the walls of this episode.
        things: float32[N, 2], (x, y) of each in tiles.
        wanted: int32[], the requested thing.
    """

    level: Level
    things: jax.Array
    wanted: jax.Array


def fetch(env: MemoryMaze, params: MemoryMazeParams) -> Choose:
    """Walk the shortest path, and walk while turning wherever that makes progress."""
    plain, body = SHORTEST_PATH(env, params), movement_of(env, params)

    def choose(key: jax.Array, state: MemoryMazeState) -> jax.Array:
        action = plain(key, state)
        step = forward(state.heading + jnp.asarray(_SPIN)[action] * body.angle) * body.step
        after = walk(state.level, jnp.zeros(0, bool), state.position, step)
        field = env.distance_field(state)
        gains = remaining(field, state.position) - remaining(field, after) > 0.2 * body.step
        turns = (action == body.left) | (action == body.right)
        return jnp.where(turns & gains, action + 2, action)

    return choose


FETCH = Player("walks the shortest path to the requested thing; sees the whole state", fetch)


@dataclasses.dataclass(frozen=True, kw_only=True)
class MemoryMaze(GeneratedTask[MemoryMazeState, MemoryMazeParams]):
    """Touch the thing in the colour of the frame around the image, then the next one.

    Things are in different rooms and stay there, so an agent that remembers them fetches more.
    Reward: `fetch_reward` for touching the requested thing; then another one is requested. Only
    the time limit ends the episode.

    Attributes:
        plan: the distribution of mazes.
        things: number of things, 2 to 6, at most one per room.
        defaults: the default params.
    """

    plan: MazePlan = PLAN
    things: int = 3
    defaults: MemoryMazeParams = DEFAULTS
    field_of_view: float = 80.0
    # Things are in different rooms.
    sprite_layers: int = 2

    success_event: ClassVar[str] = "fetched"
    action_names: ClassVar[tuple[str, ...]] = (
        "nothing",
        "forward",
        "turn left",
        "turn right",
        "forward and turn left",
        "forward and turn right",
    )

    def __post_init__(self) -> None:
        """Check the settings."""
        super().__post_init__()
        # Each thing has a room and a colour of its own.
        check_whole("things", self.things, 2, min(self.plan.fewest, len(COLOURS)))

    @property
    def default_params(self) -> MemoryMazeParams:
        """The default params."""
        return self.defaults

    @functools.cached_property
    def map_size(self) -> tuple[int, int]:
        """(columns, rows) of the map in tiles."""
        return self.plan.size, self.plan.size

    @functools.cached_property
    def theme(self) -> Theme:
        """The look of the maze."""
        labels = tuple(BALL.labels[: self.things])
        theme = build_theme(labels, doors=False, floor=FLOOR, ceiling=SKY)
        shape = np.array(COLOURS[: self.things], np.float32)
        return theme.replace(
            sprite_colours=np.stack([shape, shape * np.float32(DETAIL_SHADE)], axis=1),
            sprite_radius=np.full(self.things, _RADIUS, np.float32),
            sprite_drop=np.full(self.things, 0.5 - _RADIUS, np.float32),
        )

    def init_state(self, key: jax.Array, params: MemoryMazeParams) -> MemoryMazeState:
        """Sample a maze with its things, then a start and the first request."""
        del params
        level_key, start_key = jax.random.split(key)
        maze_key, things_key = jax.random.split(self.level_key(level_key))
        maze = sample_maze(maze_key, self.plan)
        size, most = self.plan.size, self.plan.rooms
        bits = jax.random.bits(things_key, (size**2 + most + 9,), jnp.uint32)
        cells = sample_in_rooms(bits[: size**2], maze, most, 2)
        own = bits[size**2 : size**2 + most]
        order = random_order(own, maze.rooms)
        start = jax.random.bits(start_key, (3,), jnp.uint32)
        return MemoryMazeState(
            position=cells[sample_index(start[0], maze.rooms), 1].astype(jnp.float32) + 0.5,
            heading=sample_unit(start[1]) * jnp.float32(2 * math.pi),
            level=level_from_walls(self._paint(maze.open, bits[-9:])),
            things=cells[order[: self.things], 0].astype(jnp.float32) + 0.5,
            wanted=sample_index(start[2], self.things),
        )

    def level_parts(self, state: MemoryMazeState) -> tuple[jax.Array, ...]:
        """The walls with their colours, and the tile of each thing."""
        return jnp.asarray(state.level.walls), jnp.floor(state.things).astype(jnp.int32)

    def transition(
        self,
        key: jax.Array,
        state: MemoryMazeState,
        action: jax.Array,
        params: MemoryMazeParams,
    ) -> tuple[MemoryMazeState, jax.Array, jax.Array, Info]:
        """Move, and request another thing once the requested one is touched."""
        spin = jnp.where(action < 0, 0, jnp.asarray(_SPIN)[action])
        pace = jnp.where(action < 0, 0, jnp.asarray(_PACE)[action])
        pose = state.position, state.heading
        position, heading = go(state.level, jnp.zeros(0, bool), *pose, spin, pace, params)
        state = state.replace(position=position, heading=heading)
        fetched = self._distance(state) <= params.touch_radius
        # No other thing can be touched at the same time.
        others = 1 + sample_index(jax.random.bits(key, (), jnp.uint32), self.things - 1)
        following = (state.wanted + others) % self.things
        state = state.replace(wanted=jnp.where(fetched, following, state.wanted))
        reward = jnp.where(fetched, jnp.asarray(params.fetch_reward), 0)
        return state, reward, jnp.bool_(False), {"fetched": fetched}

    def describe(self, state: MemoryMazeState, params: MemoryMazeParams) -> Info:
        """Add the requested thing and the straight-line distance to it."""
        more = {"wanted": state.wanted, "distance_to_wanted": self._distance(state)}
        return super().describe(state, params) | more

    def about(self) -> About:
        """A description of the task."""
        return dataclasses.replace(
            super().about(),
            aim="fetched the requested thing",
            ends="",
            rewards={"fetch_reward": "{:+g} per requested thing"},
            events={"fetched": Event("fetched the requested thing")},
            variables={
                "wanted": "the requested thing: 0 red, 1 green, 2 blue, 3 purple, 4 yellow, 5 grey",
                "distance_to_wanted": "tiles to it, in a straight line",
            },
            captions=("wanted",),
            players={"fetch": FETCH},
            expert="fetch",
            holds={
                "the requested thing exists": lambda s: (s.wanted >= 0) & (s.wanted < self.things)
            },
        )

    def scene(self, state: MemoryMazeState, params: MemoryMazeParams) -> Scene:
        """The maze and its things."""
        del params
        return Scene(
            level=state.level,
            closed=jnp.zeros(0, bool),
            position=state.position,
            heading=state.heading,
            sprites=Sprites(
                position=state.things,
                picture=jnp.arange(self.things, dtype=jnp.int32),
                visible=jnp.ones(self.things, bool),
            ),
            theme=self.theme,
        )

    def draw(self, state: MemoryMazeState, params: MemoryMazeParams, kind: ImageKind) -> jax.Array:
        """Add the frame."""
        image = super().draw(state, params, kind)
        colours = np.round(np.array(COLOURS, np.float32) * FRAME).astype(np.uint8)
        labels = np.array(BALL.labels, np.uint8)
        return frame(
            image, jnp.asarray(colours)[state.wanted], jnp.asarray(labels)[state.wanted], kind
        )

    def variables(self, state: MemoryMazeState) -> dict[str, jax.Array]:
        """`wanted`: float32[N], 1 for the requested thing, else 0."""
        chosen = np.arange(self.things, dtype=np.int32) == state.wanted
        return {"wanted": chosen.astype(jnp.float32)}

    def variable_spaces(self) -> dict[str, Box]:
        """The space of `wanted`."""
        return {"wanted": Box(0.0, 1.0, (self.things,), np.dtype(np.float32))}

    def distance_field(self, state: MemoryMazeState) -> jax.Array:
        """int32[rows, columns]: walking distance in tiles to the requested thing."""
        target = jnp.floor(state.things[state.wanted]).astype(jnp.int32)
        walls = jnp.asarray(state.level.walls)[0] != 0
        return flood(~walls, mask_of(target, walls.shape))

    def _distance(self, state: MemoryMazeState) -> jax.Array:
        return length(state.things[state.wanted] - state.position)

    def _paint(self, paved: jax.Array, bits: jax.Array) -> jax.Array:
        """uint8[N, N]: the walls; each ninth of the maze has its own colour."""
        size = self.plan.size
        ninth = np.searchsorted([size // 3, 2 * size // 3], np.arange(size), side="right")
        colours = jnp.asarray(np.array(_WALLS, np.uint8))[sample_index(bits, len(_WALLS))]
        block = np.array(3 * ninth[:, None] + ninth[None], np.int32)
        return jnp.where(paved, jnp.uint8(0), colours[block])


def maze(size: int, things: int) -> functools.partial[MemoryMaze]:
    """A maze of the original, by its size without the border and its number of things.

    The largest has nine rooms of 3 by 3 tiles.
    """
    rooms, most = (9, 3) if size == 15 else (6, 5)
    plan = MazePlan(size + 2, rooms, most=most, fewest=things)
    return functools.partial(MemoryMaze, plan=plan, things=things)
