"""Whether levels of any generated task can be solved, by search on the host; many at once."""

import numpy as np

from jaxenstein.maps.reach import open_tiles
from jaxenstein.maps.symbols import DOOR_LABELS, LABEL_NAMES
from jaxenstein.maps.things import COLOUR_NAMES
from jaxenstein.tasks.explore import Explore
from jaxenstein.tasks.key_corridor import KeyCorridor
from jaxenstein.tasks.memory_maze import MemoryMaze
from jaxenstein.tasks.minigrid.world import GridWorld
from jaxenstein.tasks.miniworld.rooms import BoxRooms
from jaxenstein.tasks.miniworld.sign import Sign
from tests.tasks.minigrid import search
from tests.tasks.minigrid.search import flood, mask_of

# Parts per tile side for distances, and half the diagonal of a part.
FINE, HALF = 4, 0.18


def solvable(env, params, states):
    """bool[B]: whether each of B levels on the host can be solved."""
    if isinstance(env, Sign):
        return sign(states, float(params.touch_radius))
    if isinstance(env, GridWorld):
        return search.solvable(env, states)
    if isinstance(env, KeyCorridor):
        return key_corridor(states)
    if isinstance(env, Explore):
        walls = states.level.walls[:, 0]
        floor = (walls == 0) | np.isin(walls, DOOR_LABELS)
        if env.doors:
            floor &= ~mask_at(floor.shape, states.level.doors, states.closed)
        return all_reached(floor, states, states.things, states.left & states.good)
    if isinstance(env, MemoryMaze):
        return all_reached(states.level.walls[:, 0] == 0, states, states.things)
    if isinstance(env, BoxRooms):
        return box_rooms(env, states)
    return all_reached(states.level.walls[:, 0] == 0, states, states.goal[:, None])


def mask_at(shape, tiles, which):
    """bool[shape]: the (column, row) int[B, K, 2] that bool[B, K] selects."""
    return mask_of(shape, tiles[..., 0], tiles[..., 1], which)


def start_tiles(states, shape):
    """bool[shape]: the tile of each start."""
    cell = np.floor(states.position).astype(int)[:, None]
    return mask_at(shape, cell, np.ones(cell.shape[:2], bool))


def all_reached(floor, states, places, which=None):
    """bool[B]: whether the tiles of float[B, K, 2] places, or some of them, can be walked to."""
    which = np.ones(places.shape[:2], bool) if which is None else which
    seen = flood(floor, start_tiles(states, floor.shape))
    wanted = mask_at(floor.shape, np.floor(places).astype(int), which)
    return which.any(axis=1) & ~(wanted & ~seen).any(axis=(1, 2))


def box_rooms(env, states):
    """bool[B]: whether the box can be reached, not by the street if there is one."""
    floor = np.array(open_tiles(env.tilemap))
    if env.street is not None:
        left, top, right, bottom = (int(edge) for edge in env.street)
        floor[top:bottom, left:right] = False
    floors = np.broadcast_to(floor, (len(states.goal), *floor.shape))
    return all_reached(floors, states, states.goal[:, None])


def key_corridor(states):
    """bool[B]: without the locked door to the key, and with it to the goal."""
    walls = states.level.walls[:, 0] == 0
    # An absent door is in the corner of the map, which is unreachable.
    every = mask_at(walls.shape, states.level.doors, np.ones(states.locked.shape, bool))
    shut = mask_at(walls.shape, states.level.doors, states.locked)
    to_key = all_reached(walls | (every & ~shut), states, states.key[:, None])
    return to_key & all_reached(walls | every, states, states.goal[:, None])


def sign(states, radius):
    """bool[B]: whether the target can be touched without touching anything else before.

    On a grid of quarters of tiles, whose size all distances are off by.
    """
    walls = np.repeat(np.repeat(states.level.walls[:, 0] != 0, FINE, axis=1), FINE, axis=2)
    label = states.level.walls[:, 0, 10, 11].tolist()
    shade = [COLOUR_NAMES.index(LABEL_NAMES[one].removesuffix(" wall")) for one in label]
    things = states.things
    right = (things.kind == states.asked[:, 0, :1]) & (things.colour == np.array(shade)[:, None])
    row, column = (np.indices(walls.shape[1:]) + 0.5) / FINE
    away = np.zeros(walls.shape, bool)
    near = np.zeros(walls.shape, bool)
    for slot in range(things.kind.shape[1]):
        x, y = (things.tile[:, slot, i, None, None] + 0.5 for i in (0, 1))
        distance = np.hypot(column - x, row - y)
        own = right[:, slot, None, None]
        near |= own & (distance < radius - HALF)
        away |= ~own & (distance < radius + HALF)
    fine = states.replace(position=states.position * FINE)
    seen = flood(~walls & ~away, start_tiles(fine, walls.shape))
    return (right.sum(axis=1) == 1) & (seen & near).any(axis=(1, 2))
