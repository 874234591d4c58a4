"""A T-maze: a cue at the start tells which way to turn at the end."""

from __future__ import annotations

import dataclasses
import functools
from typing import ClassVar, cast

import jax
import jax.numpy as jnp

from ..about import About, Event
from ..engine.motion import length
from ..engine.scene import Scene, Sprites
from ..environment import Info, Scalar
from ..maps.ascii import load_layout
from ..maps.things import KEY
from ..params import number
from ..players.walking import distance_tables
from .goals import NavigationParams
from .navigation import MapGoalState, MapGoalTask
from .steering import ACTION_NAMES, centres

# Tiles from the start to the cue.
CUE_AHEAD = 2


class TMazeParams(NavigationParams):
    """The params of the task.

    Attributes:
        cue_steps: the number of world steps for which the cue is visible.
        wrong_reward: reward of the wrong end.
    """

    max_steps_in_episode: Scalar = number(200, 1)
    cue_steps: Scalar = number(10, 0)
    wrong_reward: Scalar = -1.0


DEFAULTS = TMazeParams()


@dataclasses.dataclass(frozen=True, kw_only=True)
class TMaze(MapGoalTask[MapGoalState]):
    """Walk to the end of the arm that a key indicates: a red one the west, a blue one the east.

    The key is in front of the agent for the first steps of an episode and then disappears; the
    ends look alike. Reward: `goal_reward` at the correct end and `wrong_reward` at the other one;
    both terminate the episode. The mean return of an agent without memory is 0.
    """

    defaults: TMazeParams = DEFAULTS
    heading: float | tuple[float, float] | None = 270.0

    action_names: ClassVar[tuple[str, ...]] = ACTION_NAMES[:3]

    @functools.cached_property
    def sprite_labels(self) -> tuple[int, ...]:
        """The labels of the cues for the western and the eastern arm: a red and a blue key."""
        return KEY.labels[0], KEY.labels[2]

    def init_state(self, key: jax.Array, params: NavigationParams) -> MapGoalState:
        """Sample the correct arm, which is the goal."""
        del params
        return MapGoalState(**self.sample_start(key))

    def transition(
        self, key: jax.Array, state: MapGoalState, action: jax.Array, params: NavigationParams
    ) -> tuple[MapGoalState, jax.Array, jax.Array, Info]:
        """Move, and check whether one of the ends is reached."""
        state, reward, reached, events = super().transition(key, state, action, params)
        offset = centres(self.tilemap.goals) - state.position[None]
        # As for the goal, bit by bit: else the correct end could count as the wrong one.
        ends = length(offset) <= params.goal_radius
        wrong = jnp.any(ends) & ~reached
        reward = reward + jnp.where(wrong, cast(TMazeParams, params).wrong_reward, 0)
        return state, reward, reached | wrong, events | {"reached_wrong_end": wrong}

    def about(self) -> About:
        """A description of the task."""
        return dataclasses.replace(
            super().about(),
            aim="reached the correct end",
            ends="at both ends",
            rewards={
                "goal_reward": "{:+g} at the correct end",
                "wrong_reward": "{:+g} at the wrong end",
                "living_reward": "{:+g} per step",
            },
            events={
                "reached_goal": Event("reached the correct end"),
                "reached_wrong_end": Event("reached the wrong end"),
            },
            variables={"distance_to_goal": "tiles to the correct end, in a straight line"},
        )

    def scene(self, state: MapGoalState, params: NavigationParams) -> Scene:
        """The maze, and the cue while it is visible."""
        column, row = self.tilemap.spawns[0]
        cue = centres([(column, row - CUE_AHEAD)])
        shown = (state.time < cast(TMazeParams, params).cue_steps)[None]
        return super().scene(state, params).replace(sprites=Sprites(cue, state.goal[None], shown))

    def distance_field(self, state: MapGoalState) -> jax.Array:
        """int32[rows, columns]: walking distance in tiles to the correct end."""
        return jnp.asarray(distance_tables(self.tilemap))[0, state.goal].astype(jnp.int32)


def t_maze() -> functools.partial[TMaze]:
    """The T-maze on its map."""
    return functools.partial(TMaze, tilemap=load_layout("t-maze"))
