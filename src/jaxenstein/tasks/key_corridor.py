"""MiniGrid's KeyCorridor, with a new layout at each reset, generated inside JAX.

The rules are those of minigrid/envs/keycorridor.py and core/roomgrid.py of
Farama-Foundation/Minigrid. There are three columns of rooms; the middle one is an open hall. A
room in the east is locked and has the goal, the key is in a room in the west. Doors are added
between random neighbours, never to the locked room, until every room is reachable.
`fidelity/minigrid_worlds.py` compares the statistics of the layouts.
"""

from __future__ import annotations

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np

from ..engine.level import Level
from ..engine.scene import Theme
from ..environment import State
from ..errors import SettingError
from ..maps.things import GOAL, KEY
from ..maps.tilemap import Key, TileMap
from ..params import number
from ..players.walking import flood, mask_of
from .appearance import build_theme
from .draws import sample_index
from .first_person import GeneratedTask
from .goals import KeysAndDoorsTask, NavigationParams
from .levels import read_level
from .minigrid.sketch import COLOURS, Sketch
from .minigrid.state import BALL_KIND, KEY_KIND, place_of

WEST, EAST = 0, 1


class KeyCorridorState(State):
    """The state of the task; D places for doors.

    Attributes:
        level: the walls and doors of this episode.
        locked: bool[D], which door is the locked one.
        opened: bool[D].
        key: float32[2], (x, y) of the key in tiles.
        key_colour: int32[], the colour index of the key and of the locked door.
        taken: bool[], whether the key has been picked up.
        goal: float32[2], (x, y) of the goal in tiles.
    """

    level: Level
    locked: jax.Array
    opened: jax.Array
    key: jax.Array
    key_colour: jax.Array
    taken: jax.Array
    goal: jax.Array


@dataclasses.dataclass(frozen=True, kw_only=True)
class KeyCorridor(
    GeneratedTask[KeyCorridorState, NavigationParams], KeysAndDoorsTask[KeyCorridorState]
):
    """Fetch the key in the west, open the locked door in the east, reach the goal behind it.

    Actions and reward are those of `KeysAndDoorsTask`.

    Attributes:
        room_size: tiles from a room's wall to the opposite wall, both included; at least 3.
        room_rows: rows of rooms, 1 to 3.
        layout_seed: None, or the seed of a single layout, a shorthand for `levels=(seed, seed +
            1)`. The start is still random.
    """

    room_size: int = number(4, 3, 16)
    room_rows: int = number(3, 1, 3)
    layout_seed: int | None = number(None, 0, 2**32 - 1, whole=True)

    def __post_init__(self) -> None:
        """Check the settings."""
        super().__post_init__()
        if self.layout_seed is not None and self.levels is not None:
            raise SettingError("set either levels or layout_seed, which is a range of one level")

    @property
    def level_range(self) -> tuple[int, int] | None:
        """The seeds of the layouts."""
        if self.layout_seed is None:
            return super().level_range
        return int(self.layout_seed), int(self.layout_seed) + 1

    @functools.cached_property
    def theme(self) -> Theme:
        """The look of the map."""
        return build_theme((GOAL.label, *KEY.labels), doors=True)

    @functools.cached_property
    def map_size(self) -> tuple[int, int]:
        """(columns, rows) of the map in tiles."""
        step = self.room_size - 1
        return 3 * step + 1, self.room_rows * step + 1

    def init_state(self, key: jax.Array, params: NavigationParams) -> KeyCorridorState:
        """Sample a layout, and a start in the hall that does not face the locked door."""
        del params
        layout_key, start_key = jax.random.split(key)
        sketch, colour = corridor_sketch(
            self.level_key(layout_key), start_key, self.room_size, self.room_rows
        )
        drawn = sketch.state()
        key_place, goal = drawn.things.tile.astype(jnp.float32) + 0.5
        return KeyCorridorState(
            position=drawn.position,
            heading=drawn.heading,
            level=drawn.level,
            locked=drawn.doors.locked,
            opened=drawn.doors.opened,
            key=key_place,
            key_colour=colour,
            taken=jnp.bool_(False),
            goal=goal,
        )

    def level_parts(self, state: KeyCorridorState) -> tuple[jax.Array, ...]:
        """The walls with the doors, the tiles of key and goal, the colour of the key."""
        tiles = (jnp.floor(place).astype(jnp.int32) for place in (state.key, state.goal))
        return jnp.asarray(state.level.walls), *tiles, state.key_colour

    def level_of(self, state: KeyCorridorState) -> Level:
        """The level of the layout."""
        return state.level

    def goal_of(self, state: KeyCorridorState) -> jax.Array:
        """float32[2]: the position of the goal in tiles."""
        return state.goal

    def keys_of(self, state: KeyCorridorState) -> tuple[jax.Array, jax.Array, jax.Array]:
        """The key: position, sprite picture, colour index."""
        return state.key[None], 1 + state.key_colour[None], state.key_colour[None]

    def locks_of(self, state: KeyCorridorState) -> tuple[jax.Array, jax.Array]:
        """The doors: which one is locked, and the colour of the key."""
        return state.locked, jnp.broadcast_to(state.key_colour, state.locked.shape)

    def distance_field(self, state: KeyCorridorState) -> jax.Array:
        """int32[rows, columns]: distances to the key, or to the goal once the agent has it."""
        walls = jnp.asarray(state.level.walls)[0] != 0
        doors = jnp.asarray(state.level.doors)
        # An absent door is on the map's border.
        passable = (~state.locked | state.taken) & (doors[:, 0] > 0)
        walkable = ~walls | mask_of(doors, walls.shape, passable)
        target = jnp.floor(jnp.where(state.taken, state.goal, state.key)).astype(jnp.int32)
        return flood(walkable, mask_of(target, walls.shape))

    def tilemap_of(self, state: KeyCorridorState) -> TileMap:
        """The layout with its key, its goal, and the agent's tile as its spawn."""
        cells = [
            tuple(int(part) for part in np.floor(np.asarray(place)))
            for place in (state.position, state.goal, state.key)
        ]
        (start, goal, (column, row)) = cells
        tilemap = read_level(self.name, state.level)
        on_floor = tilemap.is_floor(*start)
        return dataclasses.replace(
            tilemap,
            spawns=(start,) if on_floor else (),
            goals=(goal,),
            keys=(Key(column, row, int(state.key_colour)),),
        )


def corridor_sketch(
    layout_key: jax.Array, start_key: jax.Array, size: int, rows: int
) -> tuple[Sketch, jax.Array]:
    """A layout of rooms: the sketch with key, ball, doors and start; int32[], the key's colour.

    Args:
        layout_key: the random key of everything except the start.
        start_key: the random key of the start.
        size: tiles along a room's side, walls included.
        rows: rows of rooms.
    """
    step, places = size - 1, 4 * rows - 2
    sketch = Sketch(layout_key, 3 * step + 1, rows * step + 1, 5 + 2 * places)
    locked_row, key_row = sketch.number(0, rows), sketch.number(0, rows)
    colour = sketch.colour()
    key_tile = _tile_of_room(sketch, step, 0, key_row)
    goal_tile = _tile_of_room(sketch, step, 2, locked_row)
    sketch.wall(sketch.lattice(step))
    # The hall has no walls between its rooms.
    sketch.clear(sketch.area(step + 1, 1, step - 1, rows * step - 1))
    there, locked = _doors_there(sketch.bits(places), locked_row, rows)
    bits = sketch.bits(places)
    along = 1 + sample_index(bits, size - 2)
    # The same bits also give the colour: the place does not use their low bits.
    colours = jnp.where(locked, colour, sample_index(bits << 12, COLOURS))
    tiles = jnp.where(there[:, None], _door_places(step, rows, along), 0)
    sketch.doors(tiles, jnp.where(there, colours, 0), locked)
    sketch.thing(KEY_KIND, colour, key_tile)
    sketch.thing(BALL_KIND, 0, goal_tile)
    door = jnp.sum(jnp.where(locked, along, 0), dtype=jnp.int32) + locked_row * step
    return _start(sketch, start_key, step, rows, door), colour


def _tile_of_room(sketch: Sketch, step: int, column: int, row: jax.Array) -> jax.Array:
    """int32[2]: a random tile in the room at a column and a row of rooms."""
    width = step - 1
    tile = sketch.number(0, width * width)
    return jnp.stack([column * step + 1 + tile % width, row * step + 1 + tile // width])


def _door_places(step: int, rows: int, along: jax.Array) -> jax.Array:
    """int32[D, 2]: the places for doors: on each side those to the hall, then between rows.

    Args:
        step: tiles from a wall of a room to the opposite one.
        rows: rows of rooms.
        along: int32[D], the tile of each door along its wall.
    """
    index = np.arange(len(along), dtype=np.int32)
    to_hall, between, gaps = index < 2 * rows, index - 2 * rows, max(rows - 1, 1)
    side = np.where(to_hall, index // rows, between // gaps)
    line = np.where(to_hall, index % rows, between % gaps + 1)
    column = jnp.where(to_hall, (1 + side) * step, 2 * step * side + along)
    row = line * step + jnp.where(to_hall, along, 0)
    return jnp.stack([column, row], axis=-1)


def _doors_there(bits: jax.Array, locked_row: jax.Array, rows: int) -> tuple[jax.Array, jax.Array]:
    """bool[D], the places that have doors; bool[D], which door is the locked one.

    MiniGrid adds doors one by one, in random order, until all rooms are connected. Equivalently,
    each wall has a random priority, and walls have doors up to the lowest priority that connects
    all rooms.

    Args:
        bits: uint32[D], random.
        locked_row: int32[], the row of the locked room.
        rows: rows of rooms.
    """
    index = np.arange(len(bits), dtype=np.int32)
    # The index breaks ties, so that no two priorities are equal.
    priority = (bits & ~jnp.uint32(15)) | index.astype(np.uint32)
    locked = jnp.asarray(index) == rows + locked_row
    between = np.arange(rows - 1, dtype=np.int32)
    beside = (between == locked_row) | (between + 1 == locked_row)
    shut = jnp.concatenate([jnp.zeros(3 * rows - 1, bool), beside])
    order = jnp.where(locked, jnp.uint32(0), priority)
    order = jnp.where(shut, jnp.uint32(0xFFFFFFFF), order)
    needed = jnp.uint32(0)
    for side in (WEST, EAST):
        to_hall = [order[side * rows + i] for i in range(rows)]
        down = [order[2 * rows + side * (rows - 1) + i] for i in range(rows - 1)]
        needed = jnp.maximum(needed, _bottleneck(to_hall, down))
    return ((order <= needed) & ~shut) | locked, locked


def _bottleneck(to_hall: list[jax.Array], down: list[jax.Array]) -> jax.Array:
    """The lowest priority up to which doors connect all rooms of one side with the hall.

    Args:
        to_hall: uint32[], the priority of each room's door to the hall.
        down: uint32[], the priority of the door between each room and the next.
    """
    best = list(to_hall)
    for i in range(1, len(best)):
        best[i] = jnp.minimum(best[i], jnp.maximum(best[i - 1], down[i - 1]))
    for i in reversed(range(len(best) - 1)):
        best[i] = jnp.minimum(best[i], jnp.maximum(best[i + 1], down[i]))
    return functools.reduce(jnp.maximum, best)


def _start(sketch: Sketch, key: jax.Array, step: int, rows: int, door: jax.Array) -> Sketch:
    """Start in the hall's middle room with one of four headings, not facing the locked door.

    The open walls between the hall's rooms belong to the room as well.

    Args:
        sketch: the layout.
        key: the random key of the start.
        step: tiles from a wall of a room to the opposite one.
        rows: rows of rooms.
        door: int32[], the row of the locked door, which is in the hall's eastern wall.
    """
    room = sketch.area(step + 1, rows // 2 * step, step - 1, step + 1) & ~sketch.walls
    spots = jnp.stack([room & ~sketch.tile(2 * step - 1, door), room, room, room], axis=-1)
    choice = sample_index(jax.random.bits(key, (), jnp.uint32), jnp.sum(spots, dtype=jnp.int32))
    place = place_of(spots, choice)
    tile, heading = place // 4, place % 4
    return sketch.start((tile % sketch.columns, tile // sketch.columns), heading)
