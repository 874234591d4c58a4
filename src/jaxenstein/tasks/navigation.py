"""Finding a goal in a fixed map: walls, keys, doors."""

from __future__ import annotations

import dataclasses
import functools
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from ..engine.level import Level, compile_level
from ..engine.motion import forward, touched_door
from ..engine.scene import Scene, Sprites, Theme
from ..environment import Info, State
from ..maps.things import COLOUR_NAMES, GOAL, KEY, RGB
from ..maps.tilemap import TileMap
from ..spaces import Box
from .appearance import CEILING, FLOOR, build_theme, check_rgb
from .draws import draw_index
from .first_person import FirstPerson
from .steering import (
    ACTION_NAMES,
    INTERACT,
    SteeringParams,
    centres,
    draw_heading,
    heading_range,
    steer,
)


class NavigationParams(SteeringParams):
    """The numbers of the task.

    Attributes:
        goal_radius: tiles from the goal at which it is reached.
        pickup_radius: tiles from a key at which it is picked up.
        interact_distance: reach of the interact action in tiles; below 1.
        goal_reward: reward of reaching the goal.
        living_reward: reward of every step, that one included.
    """

    goal_radius: Any = 0.35
    pickup_radius: Any = 0.35
    interact_distance: Any = 0.9
    goal_reward: Any = 1.0
    living_reward: Any = 0.0


DEFAULTS = NavigationParams()


class NavigationState(State):
    """State of a navigation task; D doors and K keys on the map.

    Attributes:
        goal: int32[], index into the map's goals.
        opened: bool[D], which doors are open.
        taken: bool[K], which keys have been picked up.
    """

    goal: jax.Array
    opened: jax.Array
    taken: jax.Array


@dataclasses.dataclass(frozen=True, kw_only=True)
class Navigation(FirstPerson[NavigationState, NavigationParams]):
    """Reach the goal.

    Actions: turn left, turn right, move forward, move backward, interact. A move into anything
    solid is cancelled. Keys are picked up by walking over them and kept; interact opens the door
    in front, a locked one if a key of its colour is carried. Doors stay open.

    Reward: `goal_reward` on reaching the goal, which terminates, and `living_reward` each step.

    Attributes:
        tilemap: the map. At each reset one of its spawns and one of its goals is drawn.
        heading: degrees of the first heading: None for any, a number, or (lowest, highest).
        floor: RGB of the two tiles of the floor's checker.
        ceiling: RGB of the ceiling.
        defaults: the params that `params=None` stands for.
    """

    tilemap: TileMap
    heading: float | tuple[float, float] | None = None
    floor: tuple[RGB, RGB] = FLOOR
    ceiling: RGB = CEILING
    defaults: NavigationParams = DEFAULTS

    action_names: ClassVar[tuple[str, ...]] = ACTION_NAMES

    def __post_init__(self) -> None:
        """Check the settings."""
        super().__post_init__()
        heading_range(self.heading)
        check_rgb("floor", self.floor, (2, 3))
        check_rgb("ceiling", self.ceiling, (3,))

    @property
    def default_params(self) -> NavigationParams:
        """The params that `params=None` stands for."""
        return self.defaults

    @functools.cached_property
    def level(self) -> Level:
        """The map compiled for the renderer: constants of every program."""
        return compile_level(self.tilemap.walls, self.tilemap.door_tiles)

    @functools.cached_property
    def theme(self) -> Theme:
        """How the map looks."""
        doors = bool(self.tilemap.doors)
        return build_theme(self._looks, doors=doors, floor=self.floor, ceiling=self.ceiling)

    @functools.cached_property
    def _looks(self) -> tuple[int, ...]:
        """Labels of the sprites' looks: the goal's, then one for each key colour of the map."""
        return GOAL.label, *sorted({KEY.labels[key.colour] for key in self.tilemap.keys})

    def init_state(self, key: jax.Array, params: NavigationParams) -> NavigationState:
        """Draw start, heading and goal, each uniformly."""
        del params
        bits = jax.random.bits(key, (3,), jnp.uint32)
        spawn = draw_index(bits[0], len(self.tilemap.spawns))
        return NavigationState(
            position=centres(self.tilemap.spawns)[spawn],
            heading=draw_heading(bits[1], self.heading),
            time=jnp.int32(0),
            episode_return=jnp.float32(0),
            done=jnp.bool_(False),
            goal=draw_index(bits[2], len(self.tilemap.goals)),
            opened=jnp.zeros(len(self.tilemap.doors), bool),
            taken=jnp.zeros(len(self.tilemap.keys), bool),
        )

    def transition(
        self,
        key: jax.Array,
        state: NavigationState,
        action: jax.Array,
        params: NavigationParams,
    ) -> tuple[NavigationState, jax.Array, jax.Array, Info]:
        """Move, open a door, pick up keys, look whether the goal is reached."""
        del key
        before = state
        state = self._open(self._move(state, action, params), action, params)
        state = self._pick_up(state, params)
        reached = self._distance(state) <= params.goal_radius
        reward = params.living_reward + jnp.where(reached, params.goal_reward, 0)
        events = {
            "reached_goal": reached,
            "picked_key": jnp.any(state.taken & ~before.taken),
            "opened_door": jnp.any(state.opened & ~before.opened),
        }
        return state, reward, reached, events

    def describe(self, state: NavigationState, params: NavigationParams) -> Info:
        """Add the straight-line distance to the goal, in tiles."""
        return super().describe(state, params) | {"distance_to_goal": self._distance(state)}

    def succeeded(
        self,
        state: NavigationState,
        reward: jax.Array,
        terminated: jax.Array,
        events: Info,
        params: NavigationParams,
    ) -> jax.Array:
        """Whether the goal was reached, also where it does not end the episode."""
        del state, reward, terminated, params
        return events["reached_goal"]

    def scene(self, state: NavigationState, params: NavigationParams) -> Scene:
        """The map with its closed doors, the keys left and the goal."""
        del params
        goal = centres(self.tilemap.goals)[state.goal]
        keys = centres([(key.column, key.row) for key in self.tilemap.keys])
        looks = [0, *(self._looks.index(KEY.labels[key.colour]) for key in self.tilemap.keys)]
        sprites = Sprites(
            position=jnp.concatenate([goal[None], keys]),
            look=jnp.array(looks, jnp.int32),
            visible=jnp.concatenate([jnp.ones(1, bool), ~state.taken]),
        )
        return Scene(
            level=self.level,
            closed=~state.opened,
            position=state.position,
            heading=state.heading,
            sprites=sprites,
            theme=self.theme,
        )

    def tilemap_of(self, state: NavigationState) -> TileMap:
        """The map."""
        del state
        return self.tilemap

    def variables(self, state: NavigationState) -> dict[str, jax.Array]:
        """`keys`: float32[6], which key colours are carried (red, green, blue, ... )."""
        return {"keys": self._carried(state).astype(jnp.float32)}

    def variable_spaces(self) -> dict[str, Box]:
        """The space of `keys`."""
        return {"keys": Box(0.0, 1.0, (len(COLOUR_NAMES),), np.dtype(np.float32))}

    def _move(
        self, state: NavigationState, action: jax.Array, params: NavigationParams
    ) -> NavigationState:
        pose = state.position, state.heading
        position, heading = steer(self.level, ~state.opened, *pose, action, params)
        return state.replace(position=position, heading=heading)

    def _open(
        self, state: NavigationState, action: jax.Array, params: NavigationParams
    ) -> NavigationState:
        doors = self.tilemap.doors
        if not doors:
            return state
        arm = forward(state.heading) * params.interact_distance
        touched = touched_door(self.level, ~state.opened, state.position, arm)
        locked = np.array([door.locked for door in doors])
        colours = np.array([door.colour for door in doors])
        allowed = ~locked | self._carried(state)[colours]
        return state.replace(opened=state.opened | (touched & allowed & (action == INTERACT)))

    def _pick_up(self, state: NavigationState, params: NavigationParams) -> NavigationState:
        keys = self.tilemap.keys
        if not keys:
            return state
        offset = centres([(key.column, key.row) for key in keys]) - state.position[None]
        near = jnp.sqrt(jnp.sum(offset**2, axis=-1)) <= params.pickup_radius
        return state.replace(taken=state.taken | near)

    def _carried(self, state: NavigationState) -> jax.Array:
        """bool[6]: which key colours are carried."""
        colours = np.array([key.colour for key in self.tilemap.keys], np.int32)
        same = colours[:, None] == np.arange(len(COLOUR_NAMES))[None]
        return jnp.any(same & state.taken[:, None], axis=0)

    def _distance(self, state: NavigationState) -> jax.Array:
        offset = centres(self.tilemap.goals)[state.goal] - state.position
        return jnp.sqrt(jnp.sum(offset**2))
