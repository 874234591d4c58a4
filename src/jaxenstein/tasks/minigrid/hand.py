"""What the hand does: doors, boxes, and what can be carried."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from ...engine.level import is_solid
from ...engine.motion import forward, path_tiles
from ...environment import Scalar
from ...maps.symbols import door_label
from ..steering import INTERACT
from .aims import DROP, PICK_UP
from .state import (
    BOX_KIND,
    BOXED,
    GONE,
    HELD,
    KEY_KIND,
    LYING,
    PORTABLE,
    GridState,
    Things,
    solid_level,
)

_UNLOCKED = door_label(0, locked=False) - door_label(0, locked=True)


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
