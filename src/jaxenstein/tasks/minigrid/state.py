"""What a world of things and doors keeps from step to step."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from ...engine.level import Level
from ...environment import State
from ...maps.things import BALL, BOX, GOAL, KEY, LAVA, Thing
from ...pytree import PyTreeNode

KINDS: tuple[Thing, ...] = (KEY, BALL, BOX, GOAL, LAVA)
"""The kinds of things; an index into this table is a kind."""
KEY_KIND, BALL_KIND, BOX_KIND, GOAL_KIND, LAVA_KIND = range(len(KINDS))
DOOR_KIND = len(KINDS)
"""What an instruction calls a door, which is no thing."""
PORTABLE = 3
"""The first kinds can be carried, and stand in the way where they lie."""

LYING, HELD, BOXED, GONE = range(4)
"""Where a thing is: on its tile, in the hand, in a box, nowhere any more."""


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


def beside(mask: jax.Array) -> jax.Array:
    """bool[rows, columns], the tiles that share an edge with one of a mask's."""
    wide = jnp.pad(mask, 1)
    return wide[2:, 1:-1] | wide[:-2, 1:-1] | wide[1:-1, 2:] | wide[1:-1, :-2]


def around(tile: jax.Array, shape: tuple[int, ...]) -> jax.Array:
    """bool[rows, columns] of `shape`, a tile int32[2] and the eight around it."""
    row, column = np.indices(shape, np.int32)
    return (abs(column - tile[0]) <= 1) & (abs(row - tile[1]) <= 1)
