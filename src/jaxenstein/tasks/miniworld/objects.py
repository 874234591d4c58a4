"""MiniWorld's rooms with things to pick up and carry, with the rules of MiniGrid's worlds.

Things are at the centres of tiles, and "in front" is the first tile that an arm meets.
"""

from __future__ import annotations

import dataclasses
import functools
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from ..._jax.batching import select
from ...about import About, Choose, Player
from ...engine.scene import Scene, Theme
from ...environment import Info
from ...fields import check_whole
from ...maps.things import RED, YELLOW
from ...params import number
from ...players.walking import FAR, Movement, mask_of, towards, walk_down
from ..minigrid.planner import planner
from ..minigrid.sketch import COLOURS, Sketch
from ..minigrid.state import (
    BALL_KIND,
    BOX_KIND,
    DROP,
    GONE,
    KEY_KIND,
    PICK_UP,
    GridState,
    Step,
    Subgoal,
    beside,
)
from ..minigrid.world import GridParams, GridWorld
from ..steering import ACTION_NAMES, sample_heading
from .rooms import ASPHALT, CEILING, FLOOR, SKY

# Tiles from a path to the centres of solid tiles: half a tile's diagonal and a little.
_KEPT_OFF = 0.8
# How many turns a heading may be off.
_TURNS_OFF = 0.75


def walk_straight(
    body: Movement, scene: Scene, field: jax.Array, key: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """As `walk_down`, but straight ahead over open ground.

    Of the tiles in open view that are closer to the target, it goes to the one with the shortest
    path overall; around corners it goes from tile to tile.
    """
    stepwise, target = walk_down(body, scene, field, key)
    row, column = np.indices(field.shape, np.float32)
    tiles = jnp.asarray(np.stack([column.reshape(-1), row.reshape(-1)], axis=-1) + np.float32(0.5))
    offsets, left = tiles - scene.position[None], field.reshape(-1)
    cell = jnp.floor(scene.position).astype(jnp.int32)
    lies_open = _path_is_clear(offsets, left >= FAR) & (left < field[cell[1], cell[0]])
    ways = jnp.sqrt(jnp.sum(offsets**2, axis=-1)) + left.astype(jnp.float32)
    best = jnp.argmin(jnp.where(lies_open, ways, jnp.inf))
    straight = towards(body, scene, offsets[best], _TURNS_OFF)
    return jnp.where(jnp.any(lies_open), straight, stepwise), target


def _path_is_clear(offsets: jax.Array, solid: jax.Array) -> jax.Array:
    """bool[n]: whether a straight path to each of n tiles stays away from all solid tiles.

    Args:
        offsets: float32[n, 2], from the player to the centre of each.
        solid: bool[n].
    """
    length = jnp.maximum(jnp.sum(offsets**2, axis=-1), 1e-6)
    # How far along each path (rows) the centre of each tile (columns) is passed.
    along = jnp.sum(offsets[:, None] * offsets[None], axis=-1) / length[:, None]
    past = offsets[None] - jnp.clip(along, 0, 1)[..., None] * offsets[:, None]
    # Tiles behind the player only get farther away.
    near = (along > 0) & (jnp.sum(past**2, axis=-1) < _KEPT_OFF**2)
    return ~jnp.any(near & solid[None], axis=1)


def plan(env: ThingsRoom, params: GridParams) -> Choose:
    """As `planner`, with the actions of these rooms."""
    choose = planner(env, params, walk_straight)
    deeds = np.array(env.deeds, np.int32)

    def act(key: jax.Array, state: GridState) -> jax.Array:
        return jnp.argmax(jnp.asarray(deeds) == choose(key, state)).astype(jnp.int32)

    return act


PLAN = Player("plans what to pick up and where to put it; sees the whole state", plan)


@dataclasses.dataclass(frozen=True, kw_only=True)
class ThingsRoom(GridWorld):
    """Base of rooms with things and MiniWorld's actions.

    Attributes:
        size: tiles along the room's side, without its walls.
    """

    size: int = number(12, 4, 60)

    deeds: ClassVar[tuple[int, ...]] = (0, 1, 2, 3, PICK_UP, DROP)
    """The MiniGrid action for each action."""
    event_names: ClassVar[tuple[str, ...]] = ("picked_up", "dropped", "solved")
    """The possible events."""
    kinds: ClassVar[tuple[int, ...]] = (KEY_KIND, BALL_KIND, BOX_KIND)
    outside: ClassVar[bool] = False
    starts_on_grid: ClassVar[bool] = False
    action_names: ClassVar[tuple[str, ...]] = (*ACTION_NAMES[:4], "pick up", "drop")

    @functools.cached_property
    def theme(self) -> Theme:
        """The look of the room."""
        floor, ceiling = (ASPHALT, SKY) if self.outside else (FLOOR, CEILING)
        return super().theme.replace(
            floor=np.array(floor, np.float32), ceiling=np.array(ceiling, np.float32)
        )

    def transition(
        self, key: jax.Array, state: GridState, action: jax.Array, params: GridParams
    ) -> tuple[GridState, jax.Array, jax.Array, Info]:
        """Take the matching MiniGrid action."""
        known = (action >= 0) & (action < len(self.deeds))
        deed = jnp.asarray(np.array(self.deeds, np.int32))[jnp.clip(action, 0, len(self.deeds) - 1)]
        state, reward, over, events = super().transition(
            key, state, jnp.where(known, deed, -1), params
        )
        return state, reward, over, {name: events[name] for name in self.event_names}

    def about(self) -> About:
        """A description of the task."""
        about = super().about()
        return dataclasses.replace(
            about,
            ends="on success",
            rewards={name: about.rewards[name] for name in ("goal_reward", "living_reward")},
            events={name: about.events[name] for name in self.event_names},
            players={"planner": PLAN},
        )


def _any_heading(sketch: Sketch, state: GridState) -> GridState:
    return state.replace(heading=sample_heading(sketch.bits(1)[0], None))


@dataclasses.dataclass(frozen=True, kw_only=True)
class PickupObjects(ThingsRoom):
    """A room with things to pick up: each gives a reward and disappears; the last ends the episode.

    Attributes:
        objects: the number of things.
    """

    objects: int = 5

    deeds: ClassVar[tuple[int, ...]] = (0, 1, 2, 3, PICK_UP)
    event_names: ClassVar[tuple[str, ...]] = ("picked_up", "solved")
    outside: ClassVar[bool] = True
    action_names: ClassVar[tuple[str, ...]] = (*ACTION_NAMES[:4], "pick up")
    aim_words: ClassVar[str] = "picked everything up"

    def __post_init__(self) -> None:
        """Check the settings."""
        super().__post_init__()
        check_whole("objects", self.objects, 1, min(30, self.size**2 // 2))

    def lay_out(self, key: jax.Array) -> GridState:
        """Sample the things and the start."""
        sketch = Sketch(key, self.size + 2, self.size + 2)
        for _ in range(self.objects):
            kind = sketch.number(KEY_KIND, BOX_KIND + 1)
            sketch.thing(kind, sketch.colour(), sketch.tile_in(sketch.free))
        sketch.start_in(sketch.free & beside(sketch.free))
        return _any_heading(sketch, sketch.state())

    def judge(self, step: Step) -> tuple[jax.Array, jax.Array]:
        """Whether all things are picked up."""
        return ~jnp.any(step.after.things.lying), jnp.bool_(False)

    def subgoal(self, state: GridState) -> Subgoal:
        """To pick up any thing."""
        return Subgoal(self.tiles_of(state, state.things.lying), jnp.int32(PICK_UP))

    def transition(
        self, key: jax.Array, state: GridState, action: jax.Array, params: GridParams
    ) -> tuple[GridState, jax.Array, jax.Array, Info]:
        """Reward and remove what is picked up."""
        state, _, over, events = super().transition(key, state, action, params)
        held = state.things.held
        place = jnp.where(held, GONE, state.things.place)
        state = state.replace(things=state.things.replace(place=place))
        count = jnp.sum(held, dtype=jnp.int32).astype(jnp.float32)
        paid = self.full_reward(state, params) * count
        return state, params.living_reward + paid, over, events

    def about(self) -> About:
        """A description of the task."""
        about = super().about()
        rewards = {**about.rewards, "goal_reward": "{:+g} per thing picked up"}
        return dataclasses.replace(about, ends="at the last thing", rewards=rewards)


@dataclasses.dataclass(frozen=True, kw_only=True)
class PutNext(ThingsRoom):
    """A room with a box in each colour: put the red one beside the yellow one.

    Putting the yellow one beside the red one counts too; beside means on one of the four
    neighbouring tiles.
    """

    kinds: ClassVar[tuple[int, ...]] = (BOX_KIND,)
    aim_words: ClassVar[str] = "put the red box beside the yellow one"

    def lay_out(self, key: jax.Array) -> GridState:
        """Sample the boxes, the red one not beside the yellow one, and the start."""
        sketch = Sketch(key, self.size + 2, self.size + 2)
        yellow = sketch.tile_in(sketch.free)
        sketch.thing(BOX_KIND, YELLOW, yellow)
        sketch.thing(BOX_KIND, RED, sketch.tile_in(sketch.free & ~beside(sketch.taken)))
        for colour in set(range(COLOURS)) - {RED, YELLOW}:
            sketch.thing(BOX_KIND, colour, sketch.tile_in(sketch.free))
        sketch.start_in(sketch.free & beside(sketch.free))
        return _any_heading(sketch, sketch.state())

    def judge(self, step: Step) -> tuple[jax.Array, jax.Array]:
        """Whether the two boxes are beside each other."""
        red, yellow = (self._box(step.after, colour) for colour in (RED, YELLOW))
        return jnp.any(red & beside(yellow)), jnp.bool_(False)

    def subgoal(self, state: GridState) -> Subgoal:
        """To pick up the nearer one of the two, then to drop it beside the other.

        If there is no room beside one of them, that is the one to pick up.
        """
        taken = self.tiles_of(state, state.things.lying) | (jnp.asarray(state.level.walls)[0] != 0)
        own = mask_of(state.cell, taken.shape)
        boxes = [self._box(state, colour) for colour in (RED, YELLOW)]
        spots = [beside(box) & ~taken & ~own for box in boxes]
        shut = [~jnp.any(beside(box) & ~taken) for box in boxes]
        nearer = boxes[0] & (shut[0] | ~shut[1]) | boxes[1] & (shut[1] | ~shut[0])
        held = [
            jnp.any(state.things.held & (state.things.colour == colour)) for colour in (RED, YELLOW)
        ]
        tiles = select(held[0], spots[1], select(held[1], spots[0], nearer))
        return Subgoal(tiles, jnp.where(held[0] | held[1], DROP, PICK_UP).astype(jnp.int32))

    def _box(self, state: GridState, colour: int) -> jax.Array:
        return self.tiles_of(state, state.things.colour == colour)
