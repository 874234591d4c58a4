"""The state of a world of things and doors, and how actions change it."""

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
"""The kinds of things; a kind is an index into this table."""
KEY_KIND, BALL_KIND, BOX_KIND, GOAL_KIND, LAVA_KIND = range(len(KINDS))
DOOR_KIND = len(KINDS)
"""The kind of a door in an instruction; doors are not things."""
PORTABLE = 3
"""The first kinds can be carried, and block the way."""

LYING, HELD, BOXED, GONE = range(4)
"""The place of a thing: on its tile, in the hand, in a box, or gone."""


PICK_UP, DROP, DONE = INTERACT + 1, INTERACT + 2, INTERACT + 3
NOWHERE = -1
"""The action of a subgoal that is reached by standing on it."""
_UNLOCKED = door_label(0, locked=False) - door_label(0, locked=True)


class Things(PyTreeNode):
    """The N things of a world.

    Attributes:
        kind: int32[N], index into `KINDS`.
        colour: int32[N], colour index.
        tile: int32[N, 2], (column, row) of its tile.
        place: int32[N], `LYING`, `HELD`, `BOXED` or `GONE`.
        box: int32[N], the number of the box that it is in, or -1.
    """

    kind: jax.Array
    colour: jax.Array
    tile: jax.Array
    place: jax.Array
    box: jax.Array

    @property
    def lying(self) -> jax.Array:
        """bool[N], which things are on their tiles."""
        return self.place == LYING

    @property
    def held(self) -> jax.Array:
        """bool[N], which thing is in the hand; at most one."""
        return self.place == HELD

    @property
    def blocking(self) -> jax.Array:
        """bool[N], which things block the way."""
        return self.lying & (self.kind < PORTABLE)

    def of(self, kind: int | jax.Array) -> jax.Array:
        """bool[N], which things are of a kind."""
        return self.kind == kind

    def at(self, tile: jax.Array) -> jax.Array:
        """bool[N], which things are on a tile."""
        return self.lying & jnp.all(self.tile == tile[None], axis=-1)


class Doors(PyTreeNode):
    """The D doors of a world, in the order of `Level.doors`.

    Attributes:
        colour: int32[D], colour index.
        locked: bool[D], which doors need a key of their colour.
        opened: bool[D].
    """

    colour: jax.Array
    locked: jax.Array
    opened: jax.Array


class GridState(State):
    """The state of a world of things and doors.

    Attributes:
        level: the walls and doors of this episode.
        things: the things.
        doors: the doors.
        asked: int32[2, 2], (kind, colour) of the requested thing, and of the thing to put it near;
            -1 for none.
    """

    level: Level
    things: Things
    doors: Doors
    asked: jax.Array

    @property
    def cell(self) -> jax.Array:
        """int32[2], (column, row) of the agent's tile."""
        return jnp.floor(self.position).astype(jnp.int32)


class Step(NamedTuple):
    """A step: the states before and after it, its action int32[], and the params."""

    before: GridState
    after: GridState
    action: jax.Array
    params: Any


class Subgoal(NamedTuple):
    """The next thing to do to solve a world, for players that see the state.

    Attributes:
        tiles: bool[rows, columns], the possible tiles.
        action: int32[], the action for one of them: an action facing it, `DONE` beside it, or
            `NOWHERE` to stand on it.
    """

    tiles: jax.Array
    action: jax.Array


def solid_level(state: GridState, *, also: jax.Array | None = None) -> tuple[Level, jax.Array]:
    """The level with a closed door for each thing that blocks the way, and which are closed.

    Args:
        state: the state.
        also: bool[N], further things that should block the way.

    Returns:
        The level, whose doors are the D doors and then N things; bool[D + N].
    """
    doors = jnp.concatenate([jnp.asarray(state.level.doors), state.things.tile])
    blocking = state.things.blocking if also is None else state.things.blocking | also
    return state.level.replace(doors=doors), jnp.concatenate([~state.doors.opened, blocking])


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
    """bool[rows, columns], the tiles that share an edge with a tile of the mask."""
    wide = jnp.pad(mask, 1)
    return wide[2:, 1:-1] | wide[:-2, 1:-1] | wide[1:-1, 2:] | wide[1:-1, :-2]


def place_of(mask: jax.Array, number: jax.Array) -> jax.Array:
    """int32[]: the flat index of the true entry of a mask with a given number."""
    rank = jnp.cumsum(mask.reshape(-1).astype(jnp.int32))
    return jnp.sum(rank <= number, dtype=jnp.int32)


def around(tile: jax.Array, shape: tuple[int, ...]) -> jax.Array:
    """bool[rows, columns] of `shape`, a tile int32[2] and the eight around it."""
    row, column = np.indices(shape, np.int32)
    return (abs(column - tile[0]) <= 1) & (abs(row - tile[1]) <= 1)


def tile_in_front(state: GridState, reach: Scalar) -> jax.Array:
    """int32[2]: the first tile within an arm's reach that is not empty, else the last one."""
    level, _ = solid_level(state)
    shut = jnp.ones(state.doors.opened.shape, bool)
    end = state.position + forward(state.heading) * reach
    first, last = path_tiles(state.position, end)
    anything = jnp.concatenate([shut, state.things.blocking])
    return jnp.where(is_solid(level, anything, first[0], first[1]), first, last)


def handle(state: GridState, action: jax.Array, reach: Scalar, *, hands: bool) -> GridState:
    """Apply interact, pick up and drop to the tile in front."""
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
    """Open or close the door at a tile among bool[D] doors; a key unlocks it permanently."""
    doors, things = state.doors, state.things
    if not used.shape[0]:
        return state
    key = things.held & things.of(KEY_KIND)
    fits = jnp.any(key[None] & (things.colour[None] == doors.colour[:, None]), axis=1)
    turned = used & (~doors.locked | fits)
    unlocked = turned & doors.locked
    # Without a scatter over all doors, whose loop is scalar.
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
    """Open the box of bool[N]: it disappears, and its content is on its tile."""
    box = used & things.of(BOX_KIND)
    number = jnp.sum(jnp.where(box, np.arange(box.shape[0], dtype=np.int32), 0), dtype=jnp.int32)
    tile = jnp.sum(jnp.where(box[:, None], things.tile, 0), axis=0, dtype=jnp.int32)
    inside = (things.place == BOXED) & (things.box == number) & jnp.any(box)
    place = jnp.where(box, GONE, jnp.where(inside, LYING, things.place))
    return things.replace(place=place, tile=jnp.where(inside[:, None], tile[None], things.tile))
