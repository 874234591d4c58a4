"""What a world of things and doors keeps from step to step, and what its actions do to that."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ...engine.level import Level, is_solid
from ...engine.motion import forward, path_tiles
from ...environment import Scalar, State
from ...maps.symbols import door_label
from ...maps.things import BALL, BOX, COLOUR_NAMES, GOAL, KEY, LAVA, Thing
from ...pytree import PyTreeNode
from ..steering import INTERACT

KINDS: tuple[Thing, ...] = (KEY, BALL, BOX, GOAL, LAVA)
"""The kinds of things; an index into this table is a kind."""
KEY_KIND, BALL_KIND, BOX_KIND, GOAL_KIND, LAVA_KIND = range(len(KINDS))
DOOR_KIND = len(KINDS)
"""What an instruction calls a door, which is no thing."""
PORTABLE = 3
"""The first kinds can be carried, and stand in the way where they lie."""

LYING, HELD, BOXED, GONE = range(4)
"""Where a thing is: on its tile, in the hand, in a box, nowhere any more."""


PICK_UP, DROP, DONE = INTERACT + 1, INTERACT + 2, INTERACT + 3
NOWHERE = -1
"""The action of a subgoal that is reached by standing on it."""
_UNLOCKED = door_label(0, locked=False) - door_label(0, locked=True)


class Things(PyTreeNode):
    """All things of a world, N of them.

    Attributes:
        kind: int32[N], index into `KINDS`.
        colour: int32[N], colour index.
        tile: int32[N, 2], (column, row) where it lies.
        place: int32[N], `LYING`, `HELD`, `BOXED` or `GONE`.
        box: int32[N], which thing is the box that it is in, or -1.
    """

    kind: jax.Array
    colour: jax.Array
    tile: jax.Array
    place: jax.Array
    box: jax.Array

    @property
    def lying(self) -> jax.Array:
        """bool[N], which lie on their tiles."""
        return self.place == LYING

    @property
    def held(self) -> jax.Array:
        """bool[N], which is in the hand: one at most."""
        return self.place == HELD

    @property
    def blocking(self) -> jax.Array:
        """bool[N], which stand in the way."""
        return self.lying & (self.kind < PORTABLE)

    def of(self, kind: int | jax.Array) -> jax.Array:
        """bool[N], which are of a kind."""
        return self.kind == kind

    def at(self, tile: jax.Array) -> jax.Array:
        """bool[N], which lie on a tile."""
        return self.lying & jnp.all(self.tile == tile[None], axis=-1)


class Doors(PyTreeNode):
    """The doors of a world, D of them, in the order of `Level.doors`.

    Attributes:
        colour: int32[D], colour index.
        locked: bool[D], which open with a key of their colour alone.
        opened: bool[D].
    """

    colour: jax.Array
    locked: jax.Array
    opened: jax.Array


class GridState(State):
    """State of a world of things and doors.

    Attributes:
        level: the walls and doors of this episode.
        things: what there is in it.
        doors: how its doors are.
        asked: int32[2, 2], (kind, colour) of what the task is about, and of what that is to be
            put near; -1 where there is none.
    """

    level: Level
    things: Things
    doors: Doors
    asked: jax.Array

    @property
    def cell(self) -> jax.Array:
        """int32[2], (column, row) of the tile that the agent is on."""
        return jnp.floor(self.position).astype(jnp.int32)


class Step(NamedTuple):
    """A step that was taken: the states before and after it, its action int32[], and the params."""

    before: GridState
    after: GridState
    action: jax.Array
    params: Any


class Subgoal(NamedTuple):
    """What to do next to solve a world, for players that see the state.

    Attributes:
        tiles: bool[rows, columns], where.
        action: int32[], what to do to one of them: an action with it in front, `DONE` beside it,
            or `NOWHERE` to stand on it.
    """

    tiles: jax.Array
    action: jax.Array


def solid_level(state: GridState, *, also: jax.Array | None = None) -> tuple[Level, jax.Array]:
    """The level with a closed door for each thing that stands in the way, and what is closed.

    Args:
        state: the state.
        also: bool[N], things that are to be in the way as well.

    Returns:
        The level, whose doors are D doors and then N things; bool[D + N].
    """
    doors = jnp.concatenate([jnp.asarray(state.level.doors), state.things.tile])
    blocking = state.things.blocking if also is None else state.things.blocking | also
    return state.level.replace(doors=doors), jnp.concatenate([~state.doors.opened, blocking])


def mask_of(tiles: jax.Array, which: jax.Array, shape: tuple[int, ...]) -> jax.Array:
    """bool[rows, columns] of `shape`, the tiles int32[K, 2] of those that bool[K] names."""
    row, column = np.indices(shape, np.int32)
    here = (column[None] == tiles[:, 0, None, None]) & (row[None] == tiles[:, 1, None, None])
    return jnp.any(here & which[:, None, None], axis=0)


def things_map(things: Things, shape: tuple[int, ...]) -> jax.Array:
    """int32[rows, columns] of `shape`: kind and colour of the thing on each tile and in its box.

    The low 8 bits encode the thing on the tile, the higher bits the thing in its box; 0 is nothing.
    The order of the things does not matter.
    """
    code = 1 + things.kind * len(COLOUR_NAMES) + things.colour
    code = jnp.where(things.place == BOXED, code << 8, code)
    there = things.lying | (things.place == BOXED)
    column, row = things.tile.T
    return jnp.zeros(shape, jnp.int32).at[row, column].add(jnp.where(there, code, 0))


def beside(mask: jax.Array) -> jax.Array:
    """bool[rows, columns], the tiles that share an edge with one of a mask's."""
    wide = jnp.pad(mask, 1)
    return wide[2:, 1:-1] | wide[:-2, 1:-1] | wide[1:-1, 2:] | wide[1:-1, :-2]


def place_of(mask: jax.Array, number: jax.Array) -> jax.Array:
    """int32[]: the index into a flattened mask of the one of its true entries with a number."""
    rank = jnp.cumsum(mask.reshape(-1).astype(jnp.int32))
    return jnp.sum(rank <= number, dtype=jnp.int32)


def around(tile: jax.Array, shape: tuple[int, ...]) -> jax.Array:
    """bool[rows, columns] of `shape`, a tile int32[2] and the eight around it."""
    row, column = np.indices(shape, np.int32)
    return (abs(column - tile[0]) <= 1) & (abs(row - tile[1]) <= 1)


def tile_in_front(state: GridState, reach: Scalar) -> jax.Array:
    """int32[2]: the first tile with anything on it that an arm enters, else the one of its end."""
    level, _ = solid_level(state)
    shut = jnp.ones(state.doors.opened.shape, bool)
    end = state.position + forward(state.heading) * reach
    first, last = path_tiles(state.position, end)
    anything = jnp.concatenate([shut, state.things.blocking])
    return jnp.where(is_solid(level, anything, first[0], first[1]), first, last)


def handle(state: GridState, action: jax.Array, reach: Scalar, *, hands: bool) -> GridState:
    """What interact, pick up and drop do to the tile in front."""
    tile = tile_in_front(state, reach)
    other = jnp.any(tile != state.cell)
    here = state.things.at(tile) & other
    door = jnp.all(jnp.asarray(state.level.doors) == tile[None], axis=-1) & other
    state = _use_door(state, tile, door & (action == INTERACT))
    if not hands:
        return state
    level, closed = solid_level(state, also=state.things.lying)
    anything = jnp.concatenate([jnp.ones(door.shape, bool), closed[door.shape[0] :]])
    free = other & ~is_solid(level, anything, tile[0], tile[1])
    things = _open_box(state.things, here & (action == INTERACT))
    portable = here & (things.kind < PORTABLE) & (action == PICK_UP) & ~jnp.any(things.held)
    dropped = things.held & (action == DROP) & free
    place = jnp.where(portable, HELD, jnp.where(dropped, LYING, things.place))
    tiles = jnp.where(dropped[:, None], tile[None], things.tile)
    return state.replace(things=things.replace(place=place, tile=tiles))


def _use_door(state: GridState, tile: jax.Array, used: jax.Array) -> GridState:
    """Open or close the one of bool[D] doors at a tile; a key unlocks it for good."""
    doors, things = state.doors, state.things
    if not used.shape[0]:
        return state
    key = things.held & things.of(KEY_KIND)
    fits = jnp.any(key[None] & (things.colour[None] == doors.colour[:, None]), axis=1)
    turned = used & (~doors.locked | fits)
    unlocked = turned & doors.locked
    # Not with a scatter over all doors, whose loop is scalar.
    walls = jnp.asarray(state.level.walls)
    row, column = np.indices(walls.shape[1:], np.int32)
    here = ((column == tile[0]) & (row == tile[1]) & jnp.any(unlocked))[None]
    return state.replace(
        level=state.level.replace(
            walls=walls + jnp.where(here, np.uint8(_UNLOCKED % 256), np.uint8(0))
        ),
        doors=doors.replace(opened=doors.opened ^ turned, locked=doors.locked & ~turned),
    )


def _open_box(things: Things, used: jax.Array) -> Things:
    """Open the box of bool[N]: it is gone, and what was in it lies there."""
    box = used & things.of(BOX_KIND)
    number = jnp.sum(jnp.where(box, np.arange(box.shape[0], dtype=np.int32), 0), dtype=jnp.int32)
    tile = jnp.sum(jnp.where(box[:, None], things.tile, 0), axis=0, dtype=jnp.int32)
    inside = (things.place == BOXED) & (things.box == number) & jnp.any(box)
    place = jnp.where(box, GONE, jnp.where(inside, LYING, things.place))
    return things.replace(place=place, tile=jnp.where(inside[:, None], tile[None], things.tile))
