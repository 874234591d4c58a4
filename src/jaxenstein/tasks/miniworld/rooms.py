"""MiniWorld's rooms with a red box to reach: the rules, and the layouts.

In MiniWorld, bodies keep 0.4 m from walls, and boxes half their diagonal, 0.57 m.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import Any, ClassVar, NamedTuple, TypeVar, cast

import jax
import jax.numpy as jnp
import numpy as np

from ...about import About, Event
from ...engine.scene import Scene, Theme
from ...environment import Info, Scalar, State
from ...maps.symbols import DEFAULT_WALL, LABEL_NAMES
from ...maps.things import BOX, CONE, RGB
from ...maps.tilemap import TileMap
from ...params import number
from ...players.walking import flood, mask_of
from ..appearance import build_theme
from ..draws import sample_unit
from ..goals import GoalTask, NavigationParams, add_sprites
from ..navigation import FixedMap
from ..steering import ACTION_NAMES, centres, heading_range, sample_heading

Area = tuple[float, float, float, float]
"""An area: least x, least y, most x, most y in tiles."""
FLOOR: tuple[RGB, RGB] = ((150, 150, 154), (134, 134, 140))
CEILING: RGB = (196, 198, 204)
ASPHALT: tuple[RGB, RGB] = ((92, 92, 96), (86, 86, 90))
SKY: RGB = (64, 209, 255)
BRICK = LABEL_NAMES.index("brick wall")
# Half the side of the box; how many starts are drawn to find one that is not at the box.
_HALF, _TRIES = 0.4, 16
_BODY, _BOX = 0.4, 0.8 * math.sqrt(0.5)


class BoxParams(NavigationParams):
    """The params of the task.

    Attributes:
        time_cost: fraction of `goal_reward` that is lost at the time limit; the loss is
            proportional to the steps taken.
    """

    max_steps_in_episode: Scalar = number(250, 1)
    goal_radius: Scalar = 1.153
    time_cost: Scalar = number(0.2, 0, 1)


DEFAULTS = BoxParams()


class BoxState(State):
    """The state of the task.

    Attributes:
        goal: float32[2], (x, y) of the box in tiles.
    """

    goal: jax.Array


S = TypeVar("S", bound=Any)


@dataclasses.dataclass(frozen=True, kw_only=True)
class ReachBox(GoalTask[S]):
    """Base of tasks to reach a red box; the earlier, the higher the reward.

    Actions: turn left, turn right, forward. Reward: 1 - 0.2 t / T at the box, which terminates the
    episode, where t is the number of steps and T their limit.
    """

    defaults: NavigationParams = DEFAULTS

    action_names: ClassVar[tuple[str, ...]] = ACTION_NAMES[:3]

    @functools.cached_property
    def theme(self) -> Theme:
        """The look of the rooms."""
        return self._theme(FLOOR, CEILING)

    def _theme(self, floor: tuple[RGB, RGB], ceiling: RGB, *more: int) -> Theme:
        """A theme with the box and with other things on the floor, by their labels."""
        theme = build_theme((BOX.label, *more), doors=False, floor=floor, ceiling=ceiling)
        radius = np.array([_HALF, *np.asarray(theme.sprite_radius)[1:]], np.float32)
        return theme.replace(sprite_radius=radius, sprite_drop=np.float32(0.5) - radius)

    def transition(
        self, key: jax.Array, state: S, action: jax.Array, params: NavigationParams
    ) -> tuple[S, jax.Array, jax.Array, Info]:
        """Move, and check whether the box is reached."""
        time = state.time + 1
        state, reward, reached, events = super().transition(key, state, action, params)
        late = time.astype(jnp.float32) / jnp.asarray(params.max_steps_in_episode, jnp.float32)
        lost = params.goal_reward * cast(BoxParams, params).time_cost * late
        return state, reward - jnp.where(reached, lost, 0), reached, events

    def about(self) -> About:
        """A description of the task."""
        return dataclasses.replace(
            super().about(),
            aim="reached the box",
            ends="at the box",
            rewards={
                "goal_reward": "{:+g} at the box, less the time cost",
                "living_reward": "{:+g} per step",
            },
            events={"reached_goal": Event("reached the box")},
            variables={"distance_to_goal": "tiles to the box, in a straight line"},
        )

    def goal_of(self, state: S) -> jax.Array:
        """float32[2]: the position of the box in tiles."""
        return state.goal

    def distance_field(self, state: S) -> jax.Array:
        """int32[rows, columns]: walking distance in tiles to the box."""
        level = self.level_of(state)
        walls = jnp.asarray(level.walls)[0] != 0
        cell = jnp.floor(state.goal).astype(jnp.int32)
        return flood(~walls & self._allowed(walls.shape), mask_of(cell, walls.shape))

    def _allowed(self, shape: tuple[int, ...]) -> np.ndarray:
        """bool[rows, columns], the tiles on which a player may walk."""
        return np.ones(shape, bool)


def sample_away(
    bits: jax.Array, areas: tuple[Area, ...], goal: jax.Array, radius: Scalar
) -> jax.Array:
    """float32[2]: a position in one of the areas, outside a radius around the goal.

    Args:
        bits: uint32[n, 3]; if all n positions are too close, the first one is used.
        areas: the areas.
        goal: float32[2].
        radius: in tiles.
    """
    places = jax.vmap(functools.partial(sample_place, areas=areas))(bits)
    near = jnp.sum((places - goal[None]) ** 2, axis=-1) <= jnp.square(radius)
    return places[jnp.argmin(near)]


def sample_place(bits: jax.Array, areas: tuple[Area, ...]) -> jax.Array:
    """float32[2]: a position drawn uniformly from the union of the areas, from uint32[3]."""
    table = np.array(areas, np.float32).reshape(-1, 2, 2)
    # An area may be a single point.
    sizes = np.maximum(np.prod(table[:, 1] - table[:, 0], axis=1), 1e-6)
    upto = (np.cumsum(sizes) / np.sum(sizes)).astype(np.float32)[:-1]
    chosen = jnp.sum(sample_unit(bits[0]) >= upto, dtype=jnp.int32)
    low, high = jnp.asarray(table)[chosen]
    return low + (high - low) * sample_unit(bits[1:])


@dataclasses.dataclass(frozen=True, kw_only=True)
class BoxRooms(FixedMap[BoxState, NavigationParams], ReachBox[BoxState]):
    """A red box to reach in fixed rooms.

    Attributes:
        tilemap: the rooms.
        starts: areas of starts, which are uniform over all of them.
        boxes: areas for the box.
        heading: degrees of the first heading: None for any, a number, or (lowest, highest).
        street: an area that ends the episode without a reward.
        cones: positions of cones, which warn of the street.
        outside: whether there is a sky above.
    """

    tilemap: TileMap
    starts: tuple[Area, ...]
    boxes: tuple[Area, ...]
    heading: float | tuple[float, float] | None = None
    street: Area | None = None
    cones: tuple[tuple[float, float], ...] = ()
    outside: bool = False

    def __post_init__(self) -> None:
        """Check the settings."""
        super().__post_init__()
        heading_range(self.heading)

    @functools.cached_property
    def theme(self) -> Theme:
        """The look of the rooms."""
        look = (ASPHALT, SKY) if self.outside else (FLOOR, CEILING)
        return self._theme(*look, *([CONE.label] if self.cones else []))

    def init_state(self, key: jax.Array, params: NavigationParams) -> BoxState:
        """Sample the box, and a start that does not reach it."""
        bits = jax.random.bits(key, (_TRIES + 2, 3), jnp.uint32)
        goal = sample_place(bits[0], self.boxes)
        return BoxState(
            position=sample_away(bits[1:-1], self.starts, goal, params.goal_radius),
            heading=sample_heading(bits[-1, 0], self.heading),
            goal=goal,
        )

    def transition(
        self, key: jax.Array, state: BoxState, action: jax.Array, params: NavigationParams
    ) -> tuple[BoxState, jax.Array, jax.Array, Info]:
        """Move, and check whether the agent reached the box or the street."""
        state, reward, over, events = super().transition(key, state, action, params)
        if self.street is not None:
            low, high = np.array(self.street, np.float32).reshape(2, 2)
            inside = jnp.all((state.position >= low) & (state.position < high))
            events["stepped_off"] = inside & ~over
            over = over | inside
        return state, reward, over, events

    def about(self) -> About:
        """A description of the task."""
        about = super().about()
        if self.street is None:
            return about
        events = {**about.events, "stepped_off": Event("stepped onto the street")}
        return dataclasses.replace(about, ends="at the box, and on the street", events=events)

    def scene(self, state: BoxState, params: NavigationParams) -> Scene:
        """The rooms, the box and the cones."""
        scene = super().scene(state, params)
        count = len(self.cones)
        places = centres(np.array(self.cones, np.float32) - np.float32(0.5))
        return add_sprites(scene, places, jnp.ones(count, jnp.int32), jnp.ones(count, bool))

    def _allowed(self, shape: tuple[int, ...]) -> np.ndarray:
        """Everything except the street."""
        if self.street is None:
            return super()._allowed(shape)
        row, column = np.indices(shape)
        left, top, right, bottom = self.street
        return ~((column >= left) & (column < right) & (row >= top) & (row < bottom))


class Rooms(NamedTuple):
    """A layout.

    Attributes:
        floors: rectangles of floor: column, row, columns, rows.
        starts: areas of starts.
        boxes: areas for the box.
        settings: settings of `BoxRooms`.
        wall: label of the walls.
    """

    floors: tuple[tuple[int, int, int, int], ...]
    starts: tuple[Area, ...]
    boxes: tuple[Area, ...]
    settings: dict[str, Any] = {}  # noqa: RUF012, a tuple's default
    wall: int = DEFAULT_WALL


def _square(side: int) -> Rooms:
    def within(margin: float) -> Area:
        return 1 + margin, 1 + margin, 1 + side - margin, 1 + side - margin

    return Rooms(((1, 1, side, side),), (within(_BODY),), (within(_BOX),))


def _hallway() -> Rooms:
    # MiniWorld's bounds for box and start refer to their edges.
    starts = (1 + _BODY, 1 + _BODY, 11 + _BODY, 5 - _BODY)
    boxes = (11 - _BOX, 1 + _BOX, 13 - _BOX, 5 - _BOX)
    return Rooms(((1, 1, 12, 4),), (starts,), (boxes,), {"heading": (-45.0, 45.0)})


def _four_rooms() -> Rooms:
    corners = (1, 1), (9, 1), (1, 9), (9, 9)
    # Corridors of two by two metres between the upper and lower rooms, and the left and right ones.
    doors = (7, 3), (7, 11), (3, 7), (11, 7)

    def within(margin: float) -> tuple[Area, ...]:
        rooms = ((x + margin, y + margin, x + 6 - margin, y + 6 - margin) for x, y in corners)
        beside = ((x - margin, y + margin, x + 2 + margin, y + 2 - margin) for x, y in doors[:2])
        above = ((x + margin, y - margin, x + 2 - margin, y + 2 + margin) for x, y in doors[2:])
        return *rooms, *beside, *above

    floors = *((x, y, 6, 6) for x, y in corners), *((x, y, 2, 2) for x, y in doors)
    return Rooms(floors, within(_BODY), within(_BOX))


def _t_maze(*boxes: Area) -> Rooms:
    north = (10 + _BOX, 1 + _BOX, 14 - _BOX, 3 + _BOX)
    south = (10 + _BOX, 15 - _BOX, 14 - _BOX, 17 - _BOX)
    start = (1 + _BODY, 7 + _BODY, 10, 11 - _BODY)
    floors = (10, 1, 4, 16), (1, 7, 9, 4)
    return Rooms(floors, (start,), boxes or (north, south), {"heading": (-45.0, 45.0)})


def _wall_gap() -> Rooms:
    floors = (1, 1, 14, 8), (7, 9, 3, 1), (1, 10, 14, 8)
    starts = (1 + _BODY, 10 + _BODY, 15 - _BODY, 18 - _BODY)
    boxes = (1 + _BOX, 1 + _BOX, 15 - _BOX, 9 - _BOX)
    return Rooms(floors, (starts,), (boxes,), {"outside": True}, BRICK)


def _sidewalk() -> Rooms:
    starts = (1 + _BODY, 10 + _BODY, 4, 11.5 + _BODY)
    boxes = (1 + _BOX, 20 - _BOX, 4, 22 - _BOX)
    settings = {
        "street": (4, 1, 10, 31),
        "cones": tuple((5, 10 + 2 * i) for i in range(1, 6)),
        "outside": True,
    }
    return Rooms(((1, 10, 3, 12), (4, 1, 6, 30)), (starts,), (boxes,), settings, BRICK)


ROOMS = {
    "hallway": _hallway(),
    "one-room": _square(10),
    "one-room-s6": _square(6),
    "one-room-s6-fast": _square(6),
    "four-rooms": _four_rooms(),
    "t-maze": _t_maze(),
    "t-maze-left": _t_maze((12, 3, 12, 3)),
    "t-maze-right": _t_maze((12, 15, 12, 15)),
    "wall-gap": _wall_gap(),
    "sidewalk": _sidewalk(),
}
"""The layouts by the ids of their environments, without the prefix."""


def room(name: str) -> functools.partial[BoxRooms]:
    """One of the rooms, by the name of its environment."""
    rooms = ROOMS[name]
    return functools.partial(
        BoxRooms,
        tilemap=_map_of(name, rooms),
        starts=rooms.starts,
        boxes=rooms.boxes,
        **rooms.settings,
    )


def _map_of(name: str, rooms: Rooms) -> TileMap:
    last = np.max([(c + columns, r + rows) for c, r, columns, rows in rooms.floors], axis=0)
    walls = np.full((last[1] + 1, last[0] + 1), rooms.wall, np.uint8)
    for column, row, columns, rows in rooms.floors:
        walls[row : row + rows, column : column + columns] = 0
    return TileMap(name, tuple(bytes(line) for line in walls))
