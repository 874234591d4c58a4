"""Tasks that end at a goal, with or without keys and doors on the way.

Their map is fixed or sampled at reset.
"""

from __future__ import annotations

import abc
import dataclasses
import functools
from typing import Any, ClassVar, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from ..about import About, Event
from ..engine.level import Level
from ..engine.motion import forward, length, touched_door
from ..engine.scene import Scene, Sprites, Theme
from ..environment import Info, Scalar
from ..maps.things import COLOUR_NAMES
from ..params import number
from ..players.walking import SHORTEST_PATH
from ..spaces import Box
from .first_person import FirstPerson
from .steering import ACTION_NAMES, INTERACT, SteeringParams, steer


class NavigationParams(SteeringParams):
    """The params of the task.

    Attributes:
        goal_radius: distance in tiles at which the goal is reached; below 0, never.
        pickup_radius: distance in tiles at which a key is picked up; below 0, never.
        interact_distance: reach of the interact action in tiles; below 1.
        goal_reward: reward of reaching the goal.
        living_reward: reward of every step, including the last one.
    """

    goal_radius: Scalar = 0.35
    pickup_radius: Scalar = 0.35
    interact_distance: Scalar = number(0.9, 0, below=1)
    goal_reward: Scalar = 1.0
    living_reward: Scalar = 0.0


DEFAULTS = NavigationParams()
S = TypeVar("S", bound=Any)


def add_sprites(scene: Scene, position: jax.Array, picture: jax.Array, visible: jax.Array) -> Scene:
    """Add sprites to a scene, after its own.

    Args:
        scene: the scene.
        position: float32[N, 2], (x, y) in tiles.
        picture: int32[N], rows of the theme's sprite tables.
        visible: bool[N].
    """
    more = Sprites(position, picture, visible)
    joined = jax.tree.map(lambda own, new: jnp.concatenate([own, new]), scene.sprites, more)
    return scene.replace(sprites=joined)


@dataclasses.dataclass(frozen=True, kw_only=True)
class GoalTask(FirstPerson[S, NavigationParams]):
    """Base of tasks that end at a goal.

    A move into anything solid is cancelled. Reward: `goal_reward` for reaching the goal, which
    terminates the episode, and `living_reward` for each step.

    Attributes:
        defaults: the default params.
    """

    defaults: NavigationParams = DEFAULTS

    # Even if it does not end the episode.
    success_event: ClassVar[str] = "reached_goal"

    @property
    def default_params(self) -> NavigationParams:
        """The default params."""
        return self.defaults

    @functools.cached_property
    @abc.abstractmethod
    def theme(self) -> Theme:
        """The look of the map; the first sprite picture is the goal's."""

    @abc.abstractmethod
    def level_of(self, state: S) -> Level:
        """The walls and doors of a state."""

    def closed_of(self, state: S) -> jax.Array:
        """bool[D]: which doors are closed; by default there are none."""
        del state
        return jnp.zeros(0, bool)

    @abc.abstractmethod
    def goal_of(self, state: S) -> jax.Array:
        """float32[2]: the position of the goal in tiles."""

    @abc.abstractmethod
    def distance_field(self, state: S) -> jax.Array:
        """int32[rows, columns]: walking distance to the next target of `shortest_path`."""

    def transition(
        self, key: jax.Array, state: S, action: jax.Array, params: NavigationParams
    ) -> tuple[S, jax.Array, jax.Array, Info]:
        """Move, and check whether the goal is reached."""
        del key
        pose = state.position, state.heading
        position, heading = steer(
            self.level_of(state), self.closed_of(state), *pose, action, params
        )
        state = state.replace(position=position, heading=heading)
        reached = self._distance(state) <= params.goal_radius
        reward = params.living_reward + jnp.where(reached, params.goal_reward, 0)
        return state, reward, reached, {"reached_goal": reached}

    def describe(self, state: S, params: NavigationParams) -> Info:
        """Add the straight-line distance to the goal, in tiles."""
        return super().describe(state, params) | {"distance_to_goal": self._distance(state)}

    def about(self) -> About:
        """A description of the task."""
        return About(
            aim="reached the goal",
            ends="at the goal",
            rewards={"goal_reward": "{:+g} at the goal", "living_reward": "{:+g} per step"},
            events={"reached_goal": Event("reached the goal")},
            variables={"distance_to_goal": "tiles to the goal, in a straight line"},
            players={"shortest_path": SHORTEST_PATH},
            expert="shortest_path",
        )

    def scene(self, state: S, params: NavigationParams) -> Scene:
        """The map with its closed doors, and the goal."""
        del params
        return Scene(
            level=self.level_of(state),
            closed=self.closed_of(state),
            position=state.position,
            heading=state.heading,
            sprites=Sprites(self.goal_of(state)[None], jnp.zeros(1, jnp.int32), jnp.ones(1, bool)),
            theme=self.theme,
        )

    def _distance(self, state: S) -> jax.Array:
        return length(self.goal_of(state) - state.position)


@dataclasses.dataclass(frozen=True, kw_only=True)
class KeysAndDoorsTask(GoalTask[S]):
    """Base of tasks that end at a goal behind doors, some of which need keys.

    Actions: turn left, turn right, move forward, move backward, interact. The agent picks up keys
    by walking over them, and keeps them. Interact opens the door in front; a locked door needs a
    key of its colour. Doors stay open.

    States have `opened`, bool[D], and `taken`, bool[K] (or bool[] for a single key).
    """

    action_names: ClassVar[tuple[str, ...]] = ACTION_NAMES

    @abc.abstractmethod
    def keys_of(self, state: S) -> tuple[jax.Array, jax.Array, jax.Array]:
        """The keys: float32[K, 2] positions, int32[K] sprite pictures, int32[K] colour indices."""

    @abc.abstractmethod
    def locks_of(self, state: S) -> tuple[jax.Array, jax.Array]:
        """The doors: bool[D], which ones are locked; int32[D], the colour of the key of each."""

    def closed_of(self, state: S) -> jax.Array:
        """bool[D]: the doors that have not been opened."""
        return ~state.opened

    def transition(
        self, key: jax.Array, state: S, action: jax.Array, params: NavigationParams
    ) -> tuple[S, jax.Array, jax.Array, Info]:
        """Move, open a door, pick up keys, and check whether the goal is reached."""
        before = state
        state, reward, reached, events = super().transition(key, state, action, params)
        state = self._pick_up(self._open(state, action, params), params)
        events["picked_key"] = jnp.any(state.taken & ~before.taken)
        events["opened_door"] = jnp.any(state.opened & ~before.opened)
        return state, reward, reached, events

    def about(self) -> About:
        """A description of the task."""
        about = super().about()
        events = {"picked_key": Event("picked up a key"), "opened_door": Event("opened a door")}
        events |= about.events
        return dataclasses.replace(about, events=events, lasting=("opened", "taken"))

    def scene(self, state: S, params: NavigationParams) -> Scene:
        """Add the keys that are left."""
        scene = super().scene(state, params)
        places, pictures, _ = self.keys_of(state)
        return add_sprites(scene, places, pictures, ~state.taken.reshape(-1))

    def variables(self, state: S) -> dict[str, jax.Array]:
        """`carried_keys`: float32[6], which key colours the agent has (red, green, blue, ...)."""
        return {"carried_keys": self._carried(state).astype(jnp.float32)}

    def variable_spaces(self) -> dict[str, Box]:
        """The space of `carried_keys`."""
        return {"carried_keys": Box(0.0, 1.0, (len(COLOUR_NAMES),), np.dtype(np.float32))}

    def _open(self, state: S, action: jax.Array, params: NavigationParams) -> S:
        if not state.opened.shape[0]:
            return state
        arm = forward(state.heading) * params.interact_distance
        touched = touched_door(self.level_of(state), ~state.opened, state.position, arm)
        locked, colours = self.locks_of(state)
        allowed = ~locked | self._carried(state)[colours]
        return state.replace(opened=state.opened | (touched & allowed & (action == INTERACT)))

    def _pick_up(self, state: S, params: NavigationParams) -> S:
        if not state.taken.size:
            return state
        offset = self.keys_of(state)[0] - state.position[None]
        near = jnp.sqrt(jnp.sum(offset**2, axis=-1)) <= params.pickup_radius
        return state.replace(taken=state.taken | near.reshape(state.taken.shape))

    def _carried(self, state: S) -> jax.Array:
        """bool[6]: which key colours the agent has."""
        same = self.keys_of(state)[2][:, None] == np.arange(len(COLOUR_NAMES), dtype=np.int32)[None]
        return jnp.any(same & state.taken.reshape(-1)[:, None], axis=0)
