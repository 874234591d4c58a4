"""A red box to reach: what MiniWorld's rooms and mazes have in common, and its rooms."""

from __future__ import annotations

import dataclasses
import functools
from typing import Any, ClassVar, TypeVar, cast

import jax
import jax.numpy as jnp
import numpy as np

from ...about import About, Event
from ...engine.level import Level, compile_level
from ...engine.scene import Scene, Sprites, Theme
from ...environment import Info, Scalar, State
from ...maps.symbols import LABEL_NAMES
from ...maps.things import BOX, CONE, RGB
from ...maps.tilemap import TileMap
from ...params import number
from ...players.walking import flood
from ...spaces import Box
from ..appearance import build_theme
from ..draws import draw_unit
from ..first_person import FirstPerson
from ..goals import GoalTask, NavigationParams
from ..steering import ACTION_NAMES, centres, draw_heading, heading_range

Area = tuple[float, float, float, float]
"""Where something may be: least x, least y, most x, most y in tiles."""
FLOOR: tuple[RGB, RGB] = ((150, 150, 154), (134, 134, 140))
CEILING: RGB = (196, 198, 204)
ASPHALT: tuple[RGB, RGB] = ((92, 92, 96), (86, 86, 90))
SKY: RGB = (64, 209, 255)
BRICK = LABEL_NAMES.index("brick wall")
# Half the side of the box; how many starts are drawn to find one that is not at the box.
_HALF, _TRIES = 0.4, 16


class BoxParams(NavigationParams):
    """The numbers of the task.

    Attributes:
        time_cost: share of `goal_reward` that is lost by the time limit, in proportion to the
            steps taken.
    """

    max_steps_in_episode: Scalar = number(250, 1)
    goal_radius: Scalar = 1.153
    time_cost: Scalar = number(0.2, 0, 1)


DEFAULTS = BoxParams()


class BoxState(State):
    """State of the task.

    Attributes:
        goal: float32[2], (x, y) of the box in tiles.
        opened: bool[0], no doors.
        taken: bool[0], no keys.
    """

    goal: jax.Array
    opened: jax.Array
    taken: jax.Array


S = TypeVar("S", bound=Any)


@dataclasses.dataclass(frozen=True, kw_only=True)
class ReachBox(GoalTask[S]):
    """Base of tasks that are to reach a red box; the sooner, the more it pays.

    Actions: turn left, turn right, forward. Reward: 1 - 0.2 t / T at the box, which terminates,
    where t counts the steps and T is their limit.
    """

    defaults: NavigationParams = DEFAULTS

    # pyright takes a tuple of another length for another type.
    action_names: ClassVar[tuple[str, ...]] = ACTION_NAMES[:3]

    @functools.cached_property
    def theme(self) -> Theme:
        """How the rooms look."""
        return self._theme(FLOOR, CEILING)

    def _theme(self, floor: tuple[RGB, RGB], ceiling: RGB, *more: int) -> Theme:
        """That of the box, and of things that stand on the floor besides, by their labels."""
        theme = build_theme((BOX.label, *more), doors=False, floor=floor, ceiling=ceiling)
        radius = np.array([_HALF, *np.asarray(theme.sprite_radius)[1:]], np.float32)
        return theme.replace(sprite_radius=radius, sprite_drop=np.float32(0.5) - radius)

    def transition(
        self, key: jax.Array, state: S, action: jax.Array, params: NavigationParams
    ) -> tuple[S, jax.Array, jax.Array, Info]:
        """Move, and look whether the box is reached."""
        time = state.time + 1
        state, reward, reached, events = super().transition(key, state, action, params)
        late = time.astype(jnp.float32) / jnp.asarray(params.max_steps_in_episode, jnp.float32)
        lost = params.goal_reward * cast(BoxParams, params).time_cost * late
        events = {"reached_goal": events["reached_goal"]}
        return state, reward - jnp.where(reached, lost, 0), reached, events

    def about(self) -> About:
        """What the task says of itself."""
        return dataclasses.replace(
            super().about(),
            aim="reached the box",
            ends="at the box",
            rewards={
                "goal_reward": "{:+g} at the box, less what the time takes",
                "living_reward": "{:+g} a step",
            },
            events={"reached_goal": Event("reached the box")},
            variables={"distance_to_goal": "tiles to the box, in a straight line"},
            lasting=(),
        )

    def goal_of(self, state: S) -> jax.Array:
        """float32[2]: the place of the box in tiles."""
        return state.goal

    def keys_of(self, state: S) -> tuple[jax.Array, jax.Array, jax.Array]:
        """None."""
        del state
        return jnp.zeros((0, 2), jnp.float32), jnp.zeros(0, jnp.int32), jnp.zeros(0, jnp.int32)

    def locks_of(self, state: S) -> tuple[jax.Array, jax.Array]:
        """None."""
        del state
        return jnp.zeros(0, bool), jnp.zeros(0, jnp.int32)

    def distance_field(self, state: S) -> jax.Array:
        """int32[rows, columns]: tiles on foot to the box."""
        level = self.level_of(state)
        walls = jnp.asarray(level.walls)[0] != 0
        row, column = np.indices(walls.shape, np.int32)
        cell = jnp.floor(state.goal).astype(jnp.int32)
        return flood(~walls & self._allowed(walls.shape), (column == cell[0]) & (row == cell[1]))

    def _allowed(self, shape: tuple[int, ...]) -> np.ndarray:
        """bool[rows, columns], where a player may walk."""
        return np.ones(shape, bool)

    def variables(self, state: S) -> dict[str, jax.Array]:
        """None: there are no keys to carry."""
        return FirstPerson.variables(self, state)

    def variable_spaces(self) -> dict[str, Box]:
        """None."""
        return FirstPerson.variable_spaces(self)


def draw_away(
    bits: jax.Array, areas: tuple[Area, ...], goal: jax.Array, radius: Scalar
) -> jax.Array:
    """float32[2]: a place in one of the areas that is not within a radius of the goal.

    Args:
        bits: uint32[n, 3]; only if all of n places are too near, the first one is taken.
        areas: where.
        goal: float32[2].
        radius: tiles.
    """
    places = jax.vmap(functools.partial(draw_place, areas=areas))(bits)
    near = jnp.sum((places - goal[None]) ** 2, axis=-1) <= jnp.square(radius)
    return places[jnp.argmin(near)]


def draw_place(bits: jax.Array, areas: tuple[Area, ...]) -> jax.Array:
    """float32[2]: a place in one of the areas, uniform over all, from uint32[3]."""
    table = np.array(areas, np.float32).reshape(-1, 2, 2)
    # An area may be a single place.
    sizes = np.maximum(np.prod(table[:, 1] - table[:, 0], axis=1), 1e-6)
    upto = (np.cumsum(sizes) / np.sum(sizes)).astype(np.float32)[:-1]
    chosen = jnp.sum(draw_unit(bits[0]) >= upto, dtype=jnp.int32)
    low, high = jnp.asarray(table)[chosen]
    return low + (high - low) * draw_unit(bits[1:])


@dataclasses.dataclass(frozen=True, kw_only=True)
class BoxRooms(ReachBox[BoxState]):
    """A red box to reach in rooms that stay as they are.

    Attributes:
        tilemap: the rooms.
        starts: areas to start from, any place of which is equally likely.
        boxes: areas for the box.
        heading: degrees of the first heading: None for any, a number, or (lowest, highest).
        street: an area that ends the episode, without a reward.
        cones: places of cones, which warn of it.
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
    def level(self) -> Level:
        """The map compiled for the renderer."""
        return compile_level(self.tilemap.walls, self.tilemap.door_tiles)

    @functools.cached_property
    def theme(self) -> Theme:
        """How the rooms look."""
        look = (ASPHALT, SKY) if self.outside else (FLOOR, CEILING)
        return self._theme(*look, *([CONE.label] if self.cones else []))

    def init_state(self, key: jax.Array, params: NavigationParams) -> BoxState:
        """Draw the box, and a start from which it is not reached yet."""
        bits = jax.random.bits(key, (_TRIES + 2, 3), jnp.uint32)
        goal = draw_place(bits[0], self.boxes)
        return BoxState(
            position=draw_away(bits[1:-1], self.starts, goal, params.goal_radius),
            heading=draw_heading(bits[-1, 0], self.heading),
            goal=goal,
            opened=jnp.zeros(0, bool),
            taken=jnp.zeros(0, bool),
        )

    def transition(
        self, key: jax.Array, state: BoxState, action: jax.Array, params: NavigationParams
    ) -> tuple[BoxState, jax.Array, jax.Array, Info]:
        """Move, and look whether the box is reached, or the street."""
        state, reward, over, events = super().transition(key, state, action, params)
        if self.street is not None:
            low, high = np.array(self.street, np.float32).reshape(2, 2)
            inside = jnp.all((state.position >= low) & (state.position < high))
            events["stepped_off"] = inside & ~over
            over = over | inside
        return state, reward, over, events

    def about(self) -> About:
        """What the task says of itself."""
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
        old = scene.sprites
        sprites = Sprites(
            position=jnp.concatenate([old.position, places]),
            look=jnp.concatenate([old.look, jnp.ones(count, jnp.int32)]),
            visible=jnp.concatenate([old.visible, jnp.ones(count, bool)]),
        )
        return scene.replace(sprites=sprites)

    def tilemap_of(self, state: BoxState) -> TileMap:
        """The rooms."""
        del state
        return self.tilemap

    def level_of(self, state: BoxState) -> Level:
        """The level of the rooms."""
        del state
        return self.level

    def _allowed(self, shape: tuple[int, ...]) -> np.ndarray:
        """All but the street."""
        if self.street is None:
            return super()._allowed(shape)
        row, column = np.indices(shape)
        left, top, right, bottom = self.street
        return ~((column >= left) & (column < right) & (row >= top) & (row < bottom))
