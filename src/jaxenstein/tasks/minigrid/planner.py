"""A player that solves any world of things and doors, by search over the state.

A family defines what solves a world (`GridWorld.subgoal`), ignoring obstacles. If something is in
the way, the player deals with that first: it fetches the key of a locked door, opens the box with
a key, carries away what blocks the path, and puts down what it holds if it needs the hand.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from ..._jax.batching import select, varying
from ...about import Choose, Player
from ...engine.motion import forward, touched_door
from ...players.walking import FAR, Movement, flood, mask_of, movement_of, walk_down
from ..steering import FORWARD, INTERACT, TURN_LEFT
from .state import (
    BOX_KIND,
    BOXED,
    DONE,
    DROP,
    KEY_KIND,
    LAVA_KIND,
    NOWHERE,
    PICK_UP,
    GridState,
    Subgoal,
    beside,
    solid_level,
)

# The longest chain of obstacles that block each other: more than in any world.
_DEEPEST = 12
# Rows and columns around a tile, in their order, starting in the east.
_RING = ((0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1))
Walk = Callable[[Movement, Any, jax.Array, jax.Array], tuple[jax.Array, jax.Array]]
"""A function that walks down a field, such as `walk_down`."""


class Walkable(NamedTuple):
    """Masks bool[rows, columns] of walkable tiles in a state.

    Attributes:
        open: without any key; doors that are not locked are open.
        free: with the key in the hand.
        any: with every key, and with everything that can be carried out of the way.
        reached: the free tiles that the agent can reach.
        own: the agent's tile.
    """

    open: jax.Array
    free: jax.Array
    any: jax.Array
    reached: jax.Array
    own: jax.Array


def planner(env: Any, params: Any, walk: Walk = walk_down) -> Choose:
    """Do what `env.subgoal` says, after whatever has to be done first.

    Args:
        env: a world of things and doors.
        params: its params.
        walk: how to walk down a field; `walk_straight` is for rooms without doors.
    """
    body = movement_of(env, params)

    def choose(key: jax.Array, state: GridState) -> jax.Array:
        floor = _survey(state, hands=env.hands)
        last = env.subgoal(state)
        subgoal = _lay_down(state, floor, last, _reachable(state, floor, last))
        field = flood(floor.free | subgoal.tiles, subgoal.tiles)
        scene = env.scene(state, params)
        level, closed = solid_level(state, also=state.things.lying & state.things.of(LAVA_KIND))
        scene = scene.replace(level=level, closed=closed)
        action, target = walk(body, scene, field, key)
        lost = field[state.cell[1], state.cell[0]] >= FAR
        careful = (action == FORWARD) & (
            lost | _walks_into_danger(body, scene, state, hands=env.hands)
        )
        action = jnp.where(careful, jnp.int32(TURN_LEFT), action)
        return _act(env, state, params, subgoal, target, action)

    return choose


PLANNER = Player("plans keys, doors and things; sees the whole state", planner)


def _act(
    env: Any, state: GridState, params: Any, subgoal: Subgoal, target: jax.Array, action: jax.Array
) -> jax.Array:
    """The subgoal's action if it is possible, opening a door on the way, else `action`."""
    column, row = env.front(state, params)
    front = jnp.stack([column, row])
    door = jnp.all(jnp.asarray(state.level.doors) == front[None], axis=-1) & ~state.doors.opened
    shut = jnp.any(door) & jnp.all(front == target)
    action = jnp.where(shut, jnp.int32(INTERACT), action)
    box = jnp.any(state.things.at(front) & state.things.of(BOX_KIND) & ~_wanted(env, state))
    deed = jnp.where(box & (subgoal.action == PICK_UP), jnp.int32(INTERACT), subgoal.action)
    away = jnp.any(front != state.cell)
    at_hand = (
        subgoal.tiles[row, column] & away & (subgoal.action != NOWHERE) & (subgoal.action != DONE)
    )
    at_hand = at_hand | ((subgoal.action == DONE) & env.stands_beside(state, subgoal.tiles))
    return jnp.where(at_hand, deed, action)


def _wanted(env: Any, state: GridState) -> jax.Array:
    """bool[N], the things that are targets themselves, and not just boxes."""
    number = jnp.arange(state.things.box.shape[0], dtype=jnp.int32)
    inside = (state.things.box[None] == number[:, None]) & (state.things.place == BOXED)[None]
    return env.asked_for(state) | ~jnp.any(inside, axis=1)


def _survey(state: GridState, *, hands: bool) -> Walkable:
    things, shape = state.things, state.level.walls.shape[-2:]
    walls = jnp.asarray(state.level.walls)[0] != 0
    doors = jnp.asarray(state.level.doors)
    key = things.held & things.of(KEY_KIND)
    fits = jnp.any(key[None] & (things.colour[None] == state.doors.colour[:, None]), axis=1)
    # An absent door is on the map's corner.
    real = jnp.any(doors != 0, axis=-1)
    lava = mask_of(things.tile, shape, things.lying & things.of(LAVA_KIND))
    blocked = mask_of(things.tile, shape, things.blocking) | lava
    locked = state.doors.locked & ~state.doors.opened
    without = ~walls | mask_of(doors, shape, real & ~locked)
    with_key = without | mask_of(doors, shape, real & fits)
    every = ~walls | mask_of(doors, shape, real)
    own = mask_of(state.cell, shape)
    free = with_key & ~blocked
    reached = flood(free | own, own) < FAR
    return Walkable(without & ~blocked, free, every & ~(lava if hands else blocked), reached, own)


def _reachable(state: GridState, floor: Walkable, subgoal: Subgoal) -> Subgoal:
    """The subgoal, or what must be done first, repeated until nothing is in the way."""
    doors = jnp.asarray(state.level.doors)
    shape = floor.own.shape
    edge = floor.any & ~floor.free & beside(floor.reached)
    # Being near a locked door is not enough, even if the door is the target.
    near = floor.reached | beside(floor.reached)
    near = near & ~(mask_of(doors, shape, state.doors.locked) & ~floor.free)

    def blocked(carry: tuple[Subgoal, jax.Array]) -> jax.Array:
        subgoal, depth = carry
        return ~jnp.any(subgoal.tiles & near) & jnp.any(edge) & (depth < _DEEPEST)

    def before(carry: tuple[Subgoal, jax.Array]) -> tuple[Subgoal, jax.Array]:
        subgoal, depth = carry
        field = jnp.where(edge, flood(floor.any | subgoal.tiles, subgoal.tiles), FAR + 1)
        first = jnp.zeros(field.size, bool).at[jnp.argmin(field)].set(True).reshape(shape)
        column, row = doors[:, 0], doors[:, 1]
        shut = first[row, column] & state.doors.locked
        keys = _keys(state, jnp.sum(jnp.where(shut, state.doors.colour, 0), dtype=jnp.int32))
        return Subgoal(jnp.where(jnp.any(shut), keys, first), jnp.int32(PICK_UP)), depth + 1

    start = varying((subgoal, jnp.int32(0)), state, subgoal, floor)
    return jax.lax.while_loop(blocked, before, start)[0]


def _keys(state: GridState, colour: jax.Array) -> jax.Array:
    """bool[rows, columns], the tiles of keys of a colour, also in boxes."""
    things, shape = state.things, state.level.walls.shape[-2:]
    wanted = things.of(KEY_KIND) & (things.colour == colour)
    hidden = wanted & (things.place == BOXED)
    number = jnp.arange(things.box.shape[0], dtype=jnp.int32)
    boxes = jnp.any((things.box[None] == number[:, None]) & hidden[None], axis=1)
    return mask_of(things.tile, shape, (wanted | boxes) & things.lying)


def _lay_down(state: GridState, floor: Walkable, top: Subgoal, subgoal: Subgoal) -> Subgoal:
    """The subgoal, or putting down what the agent holds, if it needs the hand and no key.

    The place to put it is not on the shortest paths to the target of the world. If possible, it is
    also not the last tile from which the subgoal can be reached, not a bottleneck of the floor,
    and not next to a door.
    """
    things, shape = state.things, floor.own.shape
    doors = jnp.asarray(state.level.doors)
    without = flood(floor.open | floor.own, floor.own) < FAR
    at_once = jnp.any(subgoal.tiles & (without | beside(without)))
    full = jnp.any(things.held) & (subgoal.action == PICK_UP) & at_once
    every = mask_of(doors, shape)
    litter = mask_of(things.tile, shape, things.lying)
    spots = floor.open & ~every & ~litter & ~floor.own & (without | beside(without))
    there = flood(floor.any | top.tiles, top.tiles)
    here = flood(floor.any | floor.own, floor.own)
    length = jnp.min(jnp.where(top.tiles, here, FAR))
    spots = spots & (there + here > length)
    ways = jnp.sum(jnp.stack(_ring(without)[::2]), axis=0, dtype=jnp.int32)
    last = beside(subgoal.tiles & (ways == 1))
    for apart in (~last, _spare(without), ~beside(every)):
        spots = select(jnp.any(spots & apart), spots & apart, spots)
    return select(full & jnp.any(spots), Subgoal(spots, jnp.int32(DROP)), subgoal)


def _ring(floor: jax.Array) -> list[jax.Array]:
    """bool[rows, columns] each: whether the tiles around are floor, starting in the east."""
    rows, columns = floor.shape
    wide = jnp.pad(floor, 1)
    return [wide[1 + y : 1 + y + rows, 1 + x : 1 + x + columns] for y, x in _RING]


def _spare(floor: jax.Array) -> jax.Array:
    """bool[rows, columns], the tiles whose removal leaves the floor around them connected."""
    ring = _ring(floor)
    # Connected pieces of floor that share an edge with the tile; 0 if all eight are floor.
    ends = [ring[k] & ~(ring[k - 1] & ring[k - 2]) for k in range(0, 8, 2)]
    pieces = jnp.sum(jnp.stack(ends), axis=0, dtype=jnp.int32)
    return (pieces == 1) | ((pieces == 0) & beside(floor))


def _walks_into_danger(body: Movement, scene: Any, state: GridState, *, hands: bool) -> jax.Array:
    """bool[]: whether walking on would lead into lava or a moving obstacle."""
    arm = forward(state.heading) * jnp.minimum(body.step * body.steps, 0.99)
    touched = touched_door(scene.level, scene.closed, state.position, arm)
    danger = state.things.of(LAVA_KIND) | (not hands)
    return jnp.any(touched[state.doors.opened.shape[0] :] & danger)
