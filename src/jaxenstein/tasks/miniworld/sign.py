"""MiniWorld's Sign: a sign behind a wall tells which of six things to touch.

This is the task of Liu et al., "Decoupling exploration and exploitation for meta-reinforcement
learning without sacrifices", 2020.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any, ClassVar, NamedTuple, cast

import jax
import jax.numpy as jnp
import numpy as np

from ..._jax.batching import varying
from ...about import About, Choose, Player
from ...engine.level import Level
from ...engine.motion import forward, walk
from ...environment import Info, Scalar
from ...fields import check_whole
from ...maps.symbols import LABEL_NAMES
from ...maps.things import COLOUR_NAMES, GREY
from ...params import number
from ...players.walking import SHORTEST_PATH, Movement, flood, movement_of, shortest_path
from ..draws import sample_unit
from ..minigrid.sketch import Sketch
from ..minigrid.state import (
    BOX_KIND,
    DONE,
    KEY_KIND,
    NOWHERE,
    GridState,
    Step,
    Subgoal,
    solid_level,
)
from ..minigrid.world import GridParams
from ..steering import ACTION_NAMES, sample_heading
from .objects import ThingsRoom

# (column, row) of the things: red, green and blue of each kind.
_COLOURS = ("red", "green", "blue")
_TILES = {
    BOX_KIND: ((10, 1), (10, 5), (1, 1)),
    KEY_KIND: ((1, 5), (1, 10), (5, 1)),
}
# The sign on the eastern wall, and the labels of its colours.
_COLUMN, _ROWS = 11, slice(10, 13)
_SIGNS = np.array([LABEL_NAMES.index(f"{name} wall") for name in _COLOURS], np.int32)
# The area of starts: least (x, y), and most.
_START = np.array(((4.6, 4.6), (6.4, 7.4)), np.float32)
# The most turns before either leg, either way, and the most strides of a leg.
_FIRST, _SECOND, _STRIDES = 4, 2, 14
_NEVER = 2**14
# How many tiles the player stays away from wrong things.
_AWAY = 2.2


class SignParams(GridParams):
    """The params of the task.

    Attributes:
        fail_reward: reward of touching a wrong thing.
        touch_radius: tiles from the centre of a thing at which it is touched.
    """

    max_steps_in_episode: Scalar = number(20, 1)
    move_distance: Scalar = number(0.7, 0, below=1)
    turn_angle: Scalar = number(math.radians(45), 0, 2 * math.pi)
    fail_reward: Scalar = -1.0
    touch_radius: Scalar = number(1.736, 0)


DEFAULTS = SignParams()


class Surroundings(NamedTuple):
    """The room in which a leg is walked, and the things to touch.

    Attributes:
        level: walls and things.
        closed: bool[D], which of them are present.
        things: float32[N, 2], (x, y) in tiles.
        right: bool[N], which of them is the target; the others end the episode.
        radius: float32[], distance in tiles at which one is touched.
    """

    level: Level
    closed: jax.Array
    things: jax.Array
    right: jax.Array
    radius: Any


class Leg(NamedTuple):
    """Positions after 0, 1, 2, ... strides; S is the largest number of strides, plus 1.

    Attributes:
        position: float32[S, 2].
        open: bool[S], whether no stride so far was blocked or touched a wrong thing.
        there: bool[S], whether the target is touched.
    """

    position: jax.Array
    open: jax.Array
    there: jax.Array


def two_legs(env: Any, params: Any) -> Choose:
    """A player for steps so long and limits so short that walking from tile to tile is too slow.

    It searches all paths of two straight legs: turns, strides, turns, strides. It takes the first
    action of the shortest one. If there is none, it walks from tile to tile.
    """
    body, otherwise = movement_of(env, params), shortest_path(env, params)
    numbers = [np.arange(-most, most + 1, dtype=np.float32) for most in (_FIRST, _SECOND)]

    def choose(key: jax.Array, state: GridState) -> jax.Array:
        level, closed = solid_level(state)
        middle = state.things.tile.astype(jnp.float32) + 0.5
        room = Surroundings(level, closed, middle, env.target(state), params.touch_radius)

        def second(position: jax.Array, heading: jax.Array, turns: jax.Array) -> Leg:
            return _leg(body, room, position, heading + turns * body.angle)

        def first(turns: jax.Array) -> tuple[Leg, Leg]:
            heading = state.heading + turns * body.angle
            leg = _leg(body, room, state.position, heading)
            ends = jax.vmap(second, (None, None, 0))
            return leg, jax.vmap(ends, (0, None, None))(
                leg.position, heading, jnp.asarray(numbers[1])
            )

        legs = jax.vmap(first)(jnp.asarray(numbers[0]))
        action, found = _first_action(body, *legs, *numbers)
        return jnp.where(found, action, otherwise(key, state))

    return choose


def _first_action(
    body: Movement, leg: Leg, then: Leg, first: np.ndarray, second: np.ndarray
) -> tuple[jax.Array, jax.Array]:
    """int32[], the first action of the shortest path to the target; bool[], whether one exists.

    Args:
        body: the movement of the agent.
        leg: the first legs, [F, S].
        then: the second legs from each of their positions, [F, S, T, S].
        first: float32[F], turns to the right before the first legs.
        second: float32[T], turns to the right before the second legs.
    """
    strides = np.arange(_STRIDES + 1, dtype=np.int32)
    turns = np.abs(first).astype(np.int32)[:, None, None, None]
    more = np.abs(second).astype(np.int32)[:, None] + strides
    ends = leg.open[:, :, None, None] & then.open & then.there
    actions = jnp.where(ends, turns + strides[:, None, None] + more, np.int32(_NEVER))
    chosen = jnp.argmin(actions)
    spin, stride, again, _ = jnp.unravel_index(chosen, actions.shape)
    # Without a first leg, the turns of both legs can be combined.
    turn = jnp.asarray(first)[spin]
    turn = jnp.where((turn == 0) & (stride == 0), jnp.asarray(second)[again], turn)
    turned = jnp.where(turn > 0, jnp.int32(body.right), jnp.int32(body.left))
    action = jnp.where(turn == 0, jnp.int32(body.forward), turned)
    return action, actions.reshape(-1)[chosen] < _NEVER


def _leg(body: Movement, room: Surroundings, position: jax.Array, heading: jax.Array) -> Leg:
    """Walk straight ahead from a position."""
    step = forward(heading) * body.step

    def stride(carry: tuple[jax.Array, jax.Array], _: None) -> tuple[Any, Any]:
        before, going = carry
        after = walk(room.level, room.closed, before, step)
        there, wrong = _touched(room, after)
        going = going & jnp.any(after != before) & ~wrong
        return (after, going), (after, going, there)

    start = varying((position, jnp.bool_(True)), position, heading, room)
    _, walked = jax.lax.scan(stride, start, length=_STRIDES * body.steps)
    here = position, jnp.bool_(True), _touched(room, position)[0]
    decided = jax.tree.map(lambda leaf: leaf[body.steps - 1 :: body.steps], walked)
    return Leg(*jax.tree.map(lambda a, b: jnp.concatenate([a[None], b]), here, decided))


def _touched(room: Surroundings, position: jax.Array) -> tuple[jax.Array, jax.Array]:
    """bool[]: whether the target is touched; bool[]: whether only another thing is."""
    distance = jnp.sqrt(jnp.sum((room.things - position[None]) ** 2, axis=-1))
    touched = distance < room.radius
    right = jnp.any(touched & room.right)
    return right, jnp.any(touched & ~room.right) & ~right


TWO_LEGS = Player("takes the shortest path of two straight legs; sees the whole state", two_legs)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Sign(ThingsRoom):
    """Go to the requested box or key, in the colour of a sign that is out of sight at first.

    Actions: turn left, turn right, forward, done. Touching another thing ends the episode with
    `fail_reward`; done ends it without a reward.
    """

    defaults: GridParams = DEFAULTS
    size: int = 10

    deeds: ClassVar[tuple[int, ...]] = (0, 1, 2, DONE)
    event_names: ClassVar[tuple[str, ...]] = ("solved", "failed")
    kinds: ClassVar[tuple[int, ...]] = (KEY_KIND, BOX_KIND)
    asks: ClassVar[bool] = True
    hands: ClassVar[bool] = False
    action_names: ClassVar[tuple[str, ...]] = (*ACTION_NAMES[:3], "done")
    aim_words: ClassVar[str] = "touched the requested thing"
    fail_words: ClassVar[str] = "touched something else, or gave up"

    def __post_init__(self) -> None:
        """Check the settings."""
        super().__post_init__()
        check_whole("size", self.size, 10, 10)

    def lay_out(self, key: jax.Array) -> GridState:
        """Sample the kind, the colour and the start."""
        sketch = Sketch(key, 12, 15)
        sketch.wall(sketch.area(7, 7, 4, 1))
        for kind, tiles in _TILES.items():
            for name, tile in zip(_COLOURS, tiles, strict=True):
                sketch.thing(kind, COLOUR_NAMES.index(name), tile)
        kind = jnp.where(sketch.number(0, 2) == 0, BOX_KIND, KEY_KIND)
        sign = jnp.asarray(_SIGNS)[sketch.number(0, len(_SIGNS))].astype(jnp.uint8)
        # The instruction does not tell the colour: it shows the requested kind in grey.
        state = sketch.start((5, 5)).state(asked=(kind, GREY))
        walls = jnp.asarray(state.level.walls).at[:, _ROWS, _COLUMN].set(sign)
        bits = sketch.bits(3)
        return state.replace(
            level=state.level.replace(walls=walls),
            position=_START[0] + sample_unit(bits[:2]) * (_START[1] - _START[0]),
            heading=sample_heading(bits[2], None),
        )

    def target(self, state: GridState) -> jax.Array:
        """bool[6]: the requested thing, in the colour of the sign."""
        sign = jnp.asarray(state.level.walls)[0, _ROWS.start, _COLUMN].astype(jnp.int32)
        said = jnp.asarray(_SIGNS)[state.things.colour] == sign
        return state.things.of(state.asked[0, 0]) & said

    def judge(self, step: Step) -> tuple[jax.Array, jax.Array]:
        """Whether the target is touched; whether another thing is, or the agent gives up."""
        middle = step.after.things.tile.astype(jnp.float32) + 0.5
        distance = jnp.sqrt(jnp.sum((middle - step.after.position[None]) ** 2, axis=-1))
        touched = distance < cast(SignParams, step.params).touch_radius
        right = self.target(step.after)
        solved = jnp.any(touched & right)
        return solved, (jnp.any(touched & ~right) | (step.action == DONE)) & ~solved

    def subgoal(self, state: GridState) -> Subgoal:
        """The tile of the target."""
        return Subgoal(self.tiles_of(state, self.target(state)), jnp.int32(NOWHERE))

    def transition(
        self, key: jax.Array, state: GridState, action: jax.Array, params: GridParams
    ) -> tuple[GridState, jax.Array, jax.Array, Info]:
        """As in all of these rooms, except that giving up costs nothing."""
        state, reward, over, events = super().transition(key, state, action, params)
        gave_up = events["failed"] & (action == self.deeds.index(DONE))
        return state, reward - jnp.where(gave_up, params.fail_reward, 0), over, events

    def about(self) -> About:
        """A description of the task."""
        about = super().about()
        return dataclasses.replace(
            about,
            ends="when the agent touches a thing or says done",
            rewards={**about.rewards, "fail_reward": "{:+g} for touching another thing"},
            players={"two_legs": TWO_LEGS, "shortest_path": SHORTEST_PATH},
            expert="two_legs",
        )

    def instruction(self, state: GridState) -> str:
        """The instruction of a state, without the colour."""
        kind = "box" if int(state.asked[0, 0]) == BOX_KIND else "key"
        return f"asked for: the {kind} in the colour of the sign"

    def distance_field(self, state: GridState) -> jax.Array:
        """int32[rows, columns]: walking distance in tiles to the target, around other things."""
        walls = jnp.asarray(state.level.walls)[0] != 0
        row, column = np.indices(walls.shape, np.float32)
        place = state.things.tile.astype(jnp.float32)
        offsets = column[None] - place[:, :1, None], row[None] - place[:, 1:, None]
        near = jnp.sqrt(offsets[0] ** 2 + offsets[1] ** 2) < _AWAY
        wrong = jnp.any(near & ~self.target(state)[:, None, None], axis=0)
        return flood(~walls & ~wrong, self.subgoal(state).tiles)
