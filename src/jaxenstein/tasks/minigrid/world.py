"""Worlds of things and doors: MiniGrid's rules, in first person.

The rules are those of minigrid/minigrid_env.py and core/world_object.py of
Farama-Foundation/Minigrid. Only the motion differs, which is that of all tasks here: "in front" is
the first tile that an arm of `interact_distance` tiles meets.
"""

from __future__ import annotations

import abc
import dataclasses
import functools
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from ...about import About, Event
from ...engine.scene import Scene, Theme
from ...environment import Info, Scalar
from ...maps.things import COLOUR_NAMES
from ...params import number
from ...players.walking import mask_of
from ...spaces import Box
from ..first_person import GeneratedTask
from ..steering import ACTION_NAMES, SteeringParams, steer
from .planner import PLANNER
from .state import (
    DOOR_KIND,
    GOAL_KIND,
    GONE,
    KINDS,
    LAVA_KIND,
    NOWHERE,
    PICK_UP,
    PORTABLE,
    GridState,
    Step,
    Subgoal,
    beside,
    handle,
    solid_level,
    things_map,
    tile_in_front,
)
from .view import scene_of, theme_of

_NAMES = (*(thing.name for thing in KINDS), "door")


class GridParams(SteeringParams):
    """The params of the task.

    Attributes:
        interact_distance: reach of the hand in tiles; below 1.
        goal_reward: reward of success.
        fail_reward: reward of an end without success.
        time_cost: fraction of `goal_reward` that is lost at the time limit; the loss is
            proportional to the steps taken. MiniGrid uses 0.9.
        living_reward: reward of every step.
    """

    interact_distance: Scalar = number(0.9, 0, below=1)
    goal_reward: Scalar = 1.0
    fail_reward: Scalar = 0.0
    time_cost: Scalar = number(0.0, 0, 1)
    living_reward: Scalar = 0.0


DEFAULTS = GridParams()


@dataclasses.dataclass(frozen=True, kw_only=True)
class GridWorld(GeneratedTask[GridState, GridParams]):
    """Base of worlds of things and doors; subclasses define layouts and success.

    Actions: turn left, turn right, move forward, move backward, interact, pick up, drop, done. A
    move into anything solid is cancelled; keys, balls and boxes are solid. Interact opens or
    closes the door in front; a locked door needs its key in the hand, which stays there. Interact
    also opens a box, which disappears and leaves its content. The hand holds one thing, and drops
    it on the tile in front if that is empty. Lava ends the episode.

    Reward: `goal_reward` for success, reduced by `time_cost`; `fail_reward` for other ends.

    Attributes:
        defaults: the default params.
    """

    defaults: GridParams = DEFAULTS

    action_names: ClassVar[tuple[str, ...]] = (*ACTION_NAMES, "pick up", "drop", "done")
    success_event: ClassVar[str] = "solved"
    kinds: ClassVar[tuple[int, ...]] = (GOAL_KIND,)
    """The kinds of things that the world may have."""
    asks: ClassVar[bool] = False
    """Whether each episode has its own instruction, which must be visible."""
    hands: ClassVar[bool] = True
    """Whether things can be picked up."""
    starts_on_grid: ClassVar[bool] = True
    """Whether starts are tile centres and quarter turns; other starts are not part of a level."""
    aim_words: ClassVar[str] = "reached the goal"
    fail_words: ClassVar[str] = "stepped into lava"

    @property
    def default_params(self) -> GridParams:
        """The default params."""
        return self.defaults

    @functools.cached_property
    def theme(self) -> Theme:
        """The look of the world."""
        return theme_of(self.kinds, self.camera, asks=self.asks)

    def init_state(self, key: jax.Array, params: GridParams) -> GridState:
        """Lay out a world with its start; with `levels`, one of those."""
        del params
        return self.lay_out(self.level_key(key))

    def level_parts(self, state: GridState) -> tuple[jax.Array, ...]:
        """The walls with the doors, the things, the instruction, and a start on the grid."""
        walls = jnp.asarray(state.level.walls)[0]
        parts = walls, things_map(state.things, walls.shape), state.asked
        if not self.starts_on_grid:
            return parts
        quarters = jnp.round(state.heading / jnp.float32(np.pi / 2)).astype(jnp.int32)
        return *parts, state.cell, quarters

    @abc.abstractmethod
    def lay_out(self, key: jax.Array) -> GridState:
        """Sample walls, doors and things, the start and the instruction, only from the key."""

    def judge(self, step: Step) -> tuple[jax.Array, jax.Array]:
        """bool[], bool[]: whether a step solved the world, and whether it failed.

        By default, standing on the goal's tile solves it.
        """
        here = step.after.things.at(step.after.cell)
        return jnp.any(here & step.after.things.of(GOAL_KIND)), jnp.bool_(False)

    def subgoal(self, state: GridState) -> Subgoal:
        """What solves the world from here, ignoring obstacles; by default the goal."""
        return Subgoal(self.tiles_of(state, state.things.of(GOAL_KIND)), jnp.int32(NOWHERE))

    def transition(
        self, key: jax.Array, state: GridState, action: jax.Array, params: GridParams
    ) -> tuple[GridState, jax.Array, jax.Array, Info]:
        """Move, use the hand, let the world move, and judge the result."""
        before = state
        pose = state.position, state.heading
        position, heading = steer(*solid_level(state), *pose, action, params)
        state = state.replace(position=position, heading=heading)
        state = handle(state, action, params.interact_distance, hands=self.hands)
        solved, failed = self.judge(Step(before, state, action, params))
        burnt = jnp.any(state.things.at(state.cell) & state.things.of(LAVA_KIND))
        solved, failed = solved & ~burnt, (failed | burnt) & ~(solved & ~burnt)
        state = self.drift(key, state, params)
        reward = params.living_reward + jnp.where(solved, self.full_reward(state, params), 0)
        reward = reward + jnp.where(failed, params.fail_reward, 0)
        events = {"solved": solved, "failed": failed, **_events(before, state)}
        return state, reward, solved | failed, events

    def full_reward(self, state: GridState, params: GridParams) -> jax.Array:
        """float32[]: `goal_reward` less its `time_cost`, for the step after a state."""
        limit = jnp.asarray(params.max_steps_in_episode, jnp.float32)
        lost = params.time_cost * (state.time + 1).astype(jnp.float32) / limit
        return params.goal_reward * (1 - lost)

    def drift(self, key: jax.Array, state: GridState, params: GridParams) -> GridState:
        """Move what moves by itself; by default nothing does."""
        del key, params
        return state

    def about(self) -> About:
        """A description of the task."""
        return About(
            aim=self.aim_words,
            ends="on success or failure",
            rewards={
                "goal_reward": "{:+g} if solved",
                "fail_reward": "{:+g} if failed",
                "living_reward": "{:+g} per step",
            },
            events={
                "opened_door": Event("opened a door"),
                "closed_door": Event("closed a door"),
                "opened_box": Event("opened a box"),
                "picked_up": Event("picked something up"),
                "dropped": Event("dropped it"),
                "solved": Event(self.aim_words),
                "failed": Event(self.fail_words),
            },
            variables={"carried": "label of the thing in the hand, 0 for nothing"},
            players={"planner": PLANNER},
            expert="planner",
            generated=super().about().generated,
            holds={
                "the hand holds at most one thing": lambda state: (
                    jnp.sum(state.things.held, dtype=jnp.int32) <= 1
                )
            },
        )

    def describe(self, state: GridState, params: GridParams) -> Info:
        """Add the thing in the hand."""
        labels = jnp.asarray([thing.label for thing in KINDS], jnp.int32)
        things = state.things
        label = labels[things.kind] + things.colour
        carried = jnp.sum(jnp.where(things.held, label, 0), dtype=jnp.int32)
        return super().describe(state, params) | {"carried": carried}

    def scene(self, state: GridState, params: GridParams) -> Scene:
        """The world, the thing in the hand, and the instruction."""
        del params
        return scene_of(
            state, self.theme, self.kinds, self.camera, hands=self.hands, asks=self.asks
        )

    def variables(self, state: GridState) -> dict[str, jax.Array]:
        """`carried`: float32[9], the colour and the kind of the thing in the hand, one-hot each.

        With an instruction also `asked`: float32[20], the same for the requested thing and for the
        thing to put it near, including doors; all zeros for nothing.
        """
        held = state.things.held
        colour = jnp.any(held[:, None] & _one_hot(state.things.colour, len(COLOUR_NAMES)), axis=0)
        kind = jnp.any(held[:, None] & _one_hot(state.things.kind, PORTABLE), axis=0)
        found = {"carried": jnp.concatenate([colour, kind]).astype(jnp.float32)}
        if self.asks:
            colour = _one_hot(state.asked[:, 1], len(COLOUR_NAMES))
            kinds = jnp.asarray([0, 1, 2, DOOR_KIND], jnp.int32)
            kind = state.asked[:, :1] == kinds[None]
            found["asked"] = jnp.concatenate([colour, kind], axis=1).reshape(-1).astype(jnp.float32)
        return found

    def variable_spaces(self) -> dict[str, Box]:
        """The spaces of the variables."""
        sizes = {"carried": 9, "asked": 20} if self.asks else {"carried": 9}
        kind = np.dtype(np.float32)
        return {name: Box(0.0, 1.0, (size,), kind) for name, size in sizes.items()}

    def instruction(self, state: GridState) -> str:
        """The instruction of a state, such as "asked for: green key"; "" without instructions."""
        if not self.asks:
            return ""
        rows = [(int(kind), int(colour)) for kind, colour in np.asarray(state.asked) if kind >= 0]
        words = [f"{COLOUR_NAMES[colour]} {_NAMES[kind]}" for kind, colour in rows]
        return f"asked for: {' near '.join(words)}"

    def front(self, state: GridState, params: GridParams) -> jax.Array:
        """int32[2]: the tile in front of the agent, or its own if the arm reaches no other."""
        return tile_in_front(state, params.interact_distance)

    # For families and players.

    def asked_for(self, state: GridState, which: int = 0) -> jax.Array:
        """bool[N], the things that match the requested one, or the one to put it near."""
        kind, colour = state.asked[which, 0], state.asked[which, 1]
        return (state.things.kind == kind) & (state.things.colour == colour)

    def tiles_of(self, state: GridState, which: jax.Array) -> jax.Array:
        """bool[rows, columns], the tiles of those of bool[N] things that are on tiles."""
        shape = state.level.walls.shape[-2:]
        return mask_of(state.things.tile, shape, which & state.things.lying)

    def door_tiles(self, state: GridState, which: jax.Array) -> jax.Array:
        """bool[rows, columns], the tiles of bool[D] doors."""
        return mask_of(jnp.asarray(state.level.doors), state.level.walls.shape[-2:], which)

    def stands_beside(self, state: GridState, tiles: jax.Array) -> jax.Array:
        """bool[]: whether the agent's tile shares an edge with one of bool[rows, columns]."""
        column, row = state.cell
        return beside(tiles)[row, column]


@dataclasses.dataclass(frozen=True, kw_only=True)
class PickUpWorld(GridWorld):
    """Base of worlds that are solved by picking up the requested thing."""

    aim_words: ClassVar[str] = "picked up the requested thing"

    def judge(self, step: Step) -> tuple[jax.Array, jax.Array]:
        """Whether it is in the hand."""
        return jnp.any(step.after.things.held & self.asked_for(step.after)), jnp.bool_(False)

    def subgoal(self, state: GridState) -> Subgoal:
        """To pick it up."""
        return Subgoal(self.tiles_of(state, self.asked_for(state)), jnp.int32(PICK_UP))


def _events(before: GridState, after: GridState) -> Info:
    old, new = before.doors.opened, after.doors.opened
    held, holds = before.things.held, after.things.held
    return {
        "opened_door": jnp.any(new & ~old),
        "closed_door": jnp.any(old & ~new),
        "opened_box": jnp.any((after.things.place == GONE) & (before.things.place != GONE)),
        "picked_up": jnp.any(holds & ~held),
        "dropped": jnp.any(held & ~holds),
    }


def _one_hot(index: jax.Array, count: int) -> jax.Array:
    """bool[n, count]; all false for indices out of range."""
    return index[:, None] == np.arange(count, dtype=np.int32)[None]
