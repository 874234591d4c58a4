"""Worlds of things and doors: MiniGrid's rules, in first person.

Rules: minigrid/minigrid_env.py and core/world_object.py of Farama-Foundation/Minigrid. What
differs is the motion, which is that of all tasks here, so that "in front" is the tile that an arm
of `interact_distance` tiles meets first.
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
    mask_of,
    solid_level,
    things_map,
    tile_in_front,
)
from .view import scene_of, theme_of

_NAMES = (*(thing.name for thing in KINDS), "door")


class GridParams(SteeringParams):
    """The numbers of the task.

    Attributes:
        interact_distance: reach of the hand in tiles; below 1.
        goal_reward: reward of the task's aim.
        fail_reward: reward of an end without it.
        time_cost: share of `goal_reward` that is lost by the time limit, in proportion to the
            steps taken; MiniGrid's is 0.9.
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
    """Base of worlds of things and doors; subclasses lay them out and say what solves them.

    Actions: turn left, turn right, move forward, move backward, interact, pick up, drop, done. A
    move into anything solid is cancelled; keys, balls and boxes are solid where they lie. Interact
    opens the door in front, or closes it; a locked one needs its key in the hand, which stays
    there. A box that is interacted with is gone, and what was in it lies there. The hand holds one
    thing, and drops it on the tile in front if nothing is there. Lava ends the episode.

    Reward: `goal_reward` for the aim, less what `time_cost` takes; `fail_reward` for other ends.

    Attributes:
        defaults: the params that `params=None` stands for.
    """

    defaults: GridParams = DEFAULTS

    action_names: ClassVar[tuple[str, ...]] = (*ACTION_NAMES, "pick up", "drop", "done")
    success_event: ClassVar[str] = "solved"
    kinds: ClassVar[tuple[int, ...]] = (GOAL_KIND,)
    """The kinds of things that the world may hold."""
    asks: ClassVar[bool] = False
    """Whether each episode has an instruction of its own, which has to be seen."""
    hands: ClassVar[bool] = True
    """Whether things can be picked up."""
    starts_on_grid: ClassVar[bool] = True
    """Whether starts are tile centres and quarter turns; other starts are not part of a level."""
    aim_words: ClassVar[str] = "reached the goal"
    fail_words: ClassVar[str] = "stepped into lava"

    @property
    def default_params(self) -> GridParams:
        """The params that `params=None` stands for."""
        return self.defaults

    @functools.cached_property
    def theme(self) -> Theme:
        """How the world looks."""
        return theme_of(self.kinds, self.camera, asks=self.asks)

    def init_state(self, key: jax.Array, params: GridParams) -> GridState:
        """Lay a world out, its start included; with `levels`, one of those."""
        del params
        return self.lay_out(self.level_key(key))

    def level_parts(self, state: GridState) -> tuple[jax.Array, ...]:
        """The walls with the doors, what lies where, the instruction, and a start on the grid."""
        walls = jnp.asarray(state.level.walls)[0]
        parts = walls, things_map(state.things, walls.shape), state.asked
        if not self.starts_on_grid:
            return parts
        quarters = jnp.round(state.heading / jnp.float32(np.pi / 2)).astype(jnp.int32)
        return *parts, state.cell, quarters

    @abc.abstractmethod
    def lay_out(self, key: jax.Array) -> GridState:
        """Sample the walls, doors and things, the start and the instruction, from a key alone."""

    def judge(self, step: Step) -> tuple[jax.Array, jax.Array]:
        """bool[], bool[]: whether a step solved the world, and whether it failed.

        Here the goal is reached by standing on its tile.
        """
        here = step.after.things.at(step.after.cell)
        return jnp.any(here & step.after.things.of(GOAL_KIND)), jnp.bool_(False)

    def subgoal(self, state: GridState) -> Subgoal:
        """What solves the world from here, whatever may be in the way; here the goal."""
        return Subgoal(self.tiles_of(state, state.things.of(GOAL_KIND)), jnp.int32(NOWHERE))

    def transition(
        self, key: jax.Array, state: GridState, action: jax.Array, params: GridParams
    ) -> tuple[GridState, jax.Array, jax.Array, Info]:
        """Move, use the hand, let the world move, and judge what came of it."""
        before = state
        pose = state.position, state.heading
        position, heading = steer(*solid_level(state), *pose, action, params)
        state = state.replace(position=position, heading=heading)
        state = handle(state, action, params.interact_distance, hands=self.hands)
        solved, failed = self.judge(Step(before, state, action, params))
        burnt = jnp.any(state.things.at(state.cell) & state.things.of(LAVA_KIND))
        solved, failed = solved & ~burnt, (failed | burnt) & ~(solved & ~burnt)
        state = self.drift(key, state, params)
        limit = jnp.asarray(params.max_steps_in_episode, jnp.float32)
        lost = params.time_cost * (state.time + 1).astype(jnp.float32) / limit
        reward = params.living_reward + jnp.where(solved, params.goal_reward * (1 - lost), 0)
        reward = reward + jnp.where(failed, params.fail_reward, 0)
        events = {"solved": solved, "failed": failed, **_events(before, state)}
        return state, reward, solved | failed, events

    def drift(self, key: jax.Array, state: GridState, params: GridParams) -> GridState:
        """What moves by itself; here nothing does."""
        del key, params
        return state

    def about(self) -> About:
        """What the task says of itself."""
        return About(
            aim=self.aim_words,
            ends="where it is solved or failed",
            rewards={
                "goal_reward": "{:+g} if solved",
                "fail_reward": "{:+g} if failed",
                "living_reward": "{:+g} a step",
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
            variables={"carried": "label of what is carried, 0 for nothing"},
            players={"planner": PLANNER},
            expert="planner",
            generated=super().about().generated,
            holds={
                "no more than one thing is carried": lambda state: (
                    jnp.sum(state.things.held, dtype=jnp.int32) <= 1
                )
            },
        )

    def describe(self, state: GridState, params: GridParams) -> Info:
        """Add what is carried."""
        labels = jnp.asarray([thing.label for thing in KINDS], jnp.int32)
        things = state.things
        label = labels[things.kind] + things.colour
        carried = jnp.sum(jnp.where(things.held, label, 0), dtype=jnp.int32)
        return super().describe(state, params) | {"carried": carried}

    def scene(self, state: GridState, params: GridParams) -> Scene:
        """The world, what is carried, and what was asked for."""
        del params
        return scene_of(
            state, self.theme, self.kinds, self.camera, hands=self.hands, asks=self.asks
        )

    def variables(self, state: GridState) -> dict[str, jax.Array]:
        """`carried`: float32[9], the colour and the kind of what is carried, one-hot each.

        With an instruction also `asked`: float32[20], likewise of what it names and of what that
        is to be put near, with doors and a kind for nothing that is zero here.
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
        """Their spaces."""
        sizes = {"carried": 9, "asked": 20} if self.asks else {"carried": 9}
        kind = np.dtype(np.float32)
        return {name: Box(0.0, 1.0, (size,), kind) for name, size in sizes.items()}

    def instruction(self, state: GridState) -> str:
        """What one state asks for, such as "asked for: green key"; "" without an instruction."""
        if not self.asks:
            return ""
        rows = [(int(kind), int(colour)) for kind, colour in np.asarray(state.asked) if kind >= 0]
        words = [f"{COLOUR_NAMES[colour]} {_NAMES[kind]}" for kind, colour in rows]
        return f"asked for: {' near '.join(words)}"

    def front(self, state: GridState, params: GridParams) -> jax.Array:
        """int32[2]: the tile in front of the agent; its own if the arm reaches no other."""
        return tile_in_front(state, params.interact_distance)

    # For families and players.

    def asked_for(self, state: GridState, which: int = 0) -> jax.Array:
        """bool[N], the things that are what is asked for, or what that is to be put near."""
        kind, colour = state.asked[which, 0], state.asked[which, 1]
        return (state.things.kind == kind) & (state.things.colour == colour)

    def tiles_of(self, state: GridState, which: jax.Array) -> jax.Array:
        """bool[rows, columns], the tiles of those of bool[N] things that lie there."""
        shape = state.level.walls.shape[-2:]
        return mask_of(state.things.tile, which & state.things.lying, shape)

    def door_tiles(self, state: GridState, which: jax.Array) -> jax.Array:
        """bool[rows, columns], the tiles of bool[D] doors."""
        return mask_of(jnp.asarray(state.level.doors), which, state.level.walls.shape[-2:])

    def stands_beside(self, state: GridState, tiles: jax.Array) -> jax.Array:
        """bool[]: whether the agent's tile shares an edge with one of bool[rows, columns]."""
        column, row = state.cell
        return beside(tiles)[row, column]


@dataclasses.dataclass(frozen=True, kw_only=True)
class PickUpWorld(GridWorld):
    """Base of worlds that are solved by picking up what is asked for."""

    aim_words: ClassVar[str] = "picked up what was asked for"

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
    """bool[n, count]; no entry for indices beyond."""
    return index[:, None] == np.arange(count, dtype=np.int32)[None]
