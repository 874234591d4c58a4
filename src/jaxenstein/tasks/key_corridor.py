"""MiniGrid's KeyCorridor, with a new layout at each reset, generated inside JAX.

Rules: minigrid/envs/keycorridor.py and core/roomgrid.py of Farama-Foundation/Minigrid. Three
columns of rooms; the middle one is an open hall. A room in the east is locked and holds the
goal, the key lies in a room in the west, and doors are added between random neighbours, never
to the locked room, until every room can be reached. `fidelity/minigrid_worlds.py` compares the
statistics of the layouts.
"""

from __future__ import annotations

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np

from ..engine.level import Level, level_from_walls
from ..engine.scene import Theme
from ..environment import State
from ..errors import SettingError
from ..maps.symbols import DEFAULT_WALL, door_label
from ..maps.things import COLOUR_NAMES, GOAL, KEY
from ..maps.tilemap import Key, TileMap
from ..params import number
from ..players.walking import flood
from .appearance import build_theme
from .draws import draw_index
from .generated import GeneratedTask
from .goals import GoalTask, NavigationParams
from .levels import read_level

WEST, EAST = 0, 1
_COLOURS = len(COLOUR_NAMES)


class KeyCorridorState(State):
    """State of the task; D places for doors.

    Attributes:
        level: the walls and doors of this episode.
        locked: bool[D], which door is the locked one.
        opened: bool[D].
        key: float32[2], (x, y) of the key in tiles.
        key_colour: int32[], its colour index, which is the locked door's.
        taken: bool[], whether it has been picked up.
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
class KeyCorridor(GeneratedTask[KeyCorridorState, NavigationParams], GoalTask[KeyCorridorState]):
    """Fetch the key in the west, open the locked door in the east, reach the goal behind it.

    Actions and reward are those of `GoalTask`.

    Attributes:
        room_size: tiles from a room's wall to its opposite one, both included; at least 3.
        room_rows: rows of rooms, 1 to 3.
        layout_seed: None, or the seed of the one layout: short for `levels=(seed, seed + 1)`. The
            start is drawn anew all the same.
    """

    room_size: int = number(4, 3, 16)
    room_rows: int = number(3, 1, 3)
    layout_seed: int | None = number(None, 0, 2**32 - 1, whole=True)

    def __post_init__(self) -> None:
        """Check the settings."""
        super().__post_init__()
        if self.layout_seed is not None and self.levels is not None:
            raise SettingError("give either levels or layout_seed, which is a range of one level")

    @property
    def level_range(self) -> tuple[int, int] | None:
        """The seeds of the layouts."""
        if self.layout_seed is None:
            return super().level_range
        return int(self.layout_seed), int(self.layout_seed) + 1

    @functools.cached_property
    def theme(self) -> Theme:
        """How the map looks."""
        return build_theme((GOAL.label, *KEY.labels), doors=True)

    @functools.cached_property
    def map_size(self) -> tuple[int, int]:
        """(columns, rows) of the map in tiles."""
        step = self.room_size - 1
        return 3 * step + 1, self.room_rows * step + 1

    def init_state(self, key: jax.Array, params: NavigationParams) -> KeyCorridorState:
        """Draw a layout, and a start in the hall that does not face the locked door."""
        del params
        layout_key, start_key = jax.random.split(key)
        layout_key = self.level_key(layout_key)
        rows, places = self.room_rows, self._door_count
        bits = jax.random.bits(layout_key, (5 + 2 * places,), jnp.uint32)
        locked_row, key_row = draw_index(bits[0], rows), draw_index(bits[1], rows)
        colour = draw_index(bits[2], _COLOURS)
        doors, locked, labels = self._draw_doors(bits[5:], locked_row, colour)
        level = self._build(doors, labels)
        position, heading = self._draw_start(start_key, doors, locked)
        step = self.room_size - 1
        return KeyCorridorState(
            position=position,
            heading=heading,
            level=level,
            locked=locked,
            opened=jnp.zeros(places, bool),
            key=self._inside(bits[3], jnp.int32(0), key_row * step),
            key_colour=colour,
            taken=jnp.bool_(False),
            goal=self._inside(bits[4], jnp.int32(2 * step), locked_row * step),
        )

    def level_of(self, state: KeyCorridorState) -> Level:
        """The level of the layout."""
        return state.level

    def goal_of(self, state: KeyCorridorState) -> jax.Array:
        """float32[2]: the place of the goal in tiles."""
        return state.goal

    def keys_of(self, state: KeyCorridorState) -> tuple[jax.Array, jax.Array, jax.Array]:
        """The key: place, sprite look, colour index."""
        return state.key[None], 1 + state.key_colour[None], state.key_colour[None]

    def locks_of(self, state: KeyCorridorState) -> tuple[jax.Array, jax.Array]:
        """The doors: which is the locked one, the colour of the key."""
        return state.locked, jnp.broadcast_to(state.key_colour, state.locked.shape)

    def distance_field(self, state: KeyCorridorState) -> jax.Array:
        """int32[rows, columns]: distances to the key, or to the goal once the key is taken."""
        walls = jnp.asarray(state.level.walls)[0] != 0
        columns, rows = state.level.doors[:, 0], state.level.doors[:, 1]
        # An absent door stands on the map's border.
        passable = (~state.locked | state.taken) & (columns > 0)
        row, column = np.indices(walls.shape, np.int32)
        here = (column[None] == columns[:, None, None]) & (row[None] == rows[:, None, None])
        walkable = ~walls | jnp.any(here & passable[:, None, None], axis=0)
        target = jnp.floor(jnp.where(state.taken, state.goal, state.key)).astype(jnp.int32)
        return flood(walkable, (column == target[0]) & (row == target[1]))

    def tilemap_of(self, state: KeyCorridorState) -> TileMap:
        """The layout with its key, its goal, and the tile the agent is on as its start."""
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

    @property
    def _door_count(self) -> int:
        """Places for doors: each side's to the hall, then each side's between rows."""
        return 2 * self.room_rows + 2 * (self.room_rows - 1)

    def _draw_doors(
        self, bits: jax.Array, locked_row: jax.Array, colour: jax.Array
    ) -> tuple[jax.Array, jax.Array, jax.Array]:
        """int32[D, 2] (column, row) of the doors, bool[D] the locked one, int32[D] labels.

        MiniGrid adds doors one by one, in random order, until all rooms are connected. That is:
        each wall has a random priority, and doors are in all walls up to the least priority at
        which they connect everything. An absent door stands at (0, 0).
        """
        rows, step = self.room_rows, self.room_size - 1
        places = self._door_count
        hall = np.arange(places) < 2 * rows
        index = np.arange(places, dtype=np.int32)
        # Ties are broken by the index, so that no two priorities are equal.
        priority = (bits[:places] & ~jnp.uint32(15)) | index.astype(np.uint32)
        locked = jnp.asarray(index) == rows + locked_row
        between = np.arange(max(rows - 1, 0), dtype=np.int32)
        beside = (between == locked_row) | (between + 1 == locked_row)
        shut = jnp.concatenate([jnp.zeros(2 * rows + rows - 1, bool), beside])
        never = jnp.uint32(0xFFFFFFFF)
        order = jnp.where(shut, never, jnp.where(locked, jnp.uint32(0), priority))
        needed = jnp.uint32(0)
        for side in (WEST, EAST):
            to_hall = [order[side * rows + i] for i in range(rows)]
            down = [order[2 * rows + side * (rows - 1) + i] for i in range(rows - 1)]
            needed = jnp.maximum(needed, _bottleneck(to_hall, down))
        present = ((order <= needed) & ~shut) | locked
        along = 1 + draw_index(bits[places:], self.room_size - 2)
        # The same bits serve for the colour: their low ones are not used for the place.
        painted = draw_index(bits[places:] << 12, _COLOURS)
        side_of = np.where(hall, index // rows, (index - 2 * rows) // max(rows - 1, 1))
        line = np.where(hall, index % rows, (index - 2 * rows) % max(rows - 1, 1))
        column = jnp.where(hall, (1 + side_of) * step, 2 * step * side_of + along)
        row = jnp.where(hall, line * step + along, (line + 1) * step)
        doors = jnp.stack([column, row], axis=-1).astype(jnp.int32)
        labels = jnp.where(
            locked, door_label(0, locked=True) + colour, door_label(0, locked=False) + painted
        )
        return jnp.where(present[:, None], doors, 0), locked, labels

    def _build(self, doors: jax.Array, labels: jax.Array) -> Level:
        """The level of a layout."""
        columns, rows = self.map_size
        step = self.room_size - 1
        solid = np.zeros((rows, columns), bool)
        solid[::step] = solid[:, ::step] = True
        # The hall has no walls between its rooms.
        solid[1:-1, step + 1 : 2 * step] = False
        walls = jnp.asarray(np.where(solid, DEFAULT_WALL, 0).astype(np.int32))
        row, column = np.indices((rows, columns), np.int32)
        for i in range(self._door_count):
            here = (column == doors[i, 0]) & (row == doors[i, 1]) & (doors[i, 0] > 0)
            walls = jnp.where(here, labels[i], walls)
        return level_from_walls(walls.astype(jnp.uint8), doors)

    def _draw_start(
        self, key: jax.Array, doors: jax.Array, locked: jax.Array
    ) -> tuple[jax.Array, jax.Array]:
        """A tile of the hall's middle room and one of four headings, not facing the locked door.

        The open walls between the hall's rooms belong to the room as well.
        """
        step, middle = self.room_size - 1, self.room_rows // 2
        first = middle * step + (1 if middle == 0 else 0)
        last = (middle + 1) * step - (1 if middle == self.room_rows - 1 else 0)
        width, height = step - 1, last - first + 1
        count = 4 * width * height
        door = jnp.sum(jnp.where(locked[:, None], doors, 0), axis=0, dtype=jnp.int32)
        # Choices run over headings, then columns, then rows; the bad one faces east.
        bad = ((door[1] - first) * width + (width - 1)) * 4
        exists = (door[1] >= first) & (door[1] <= last)
        bits = jax.random.bits(key, (), jnp.uint32)
        choice = draw_index(bits, count - exists.astype(jnp.int32))
        choice = choice + (exists & (choice >= bad)).astype(jnp.int32)
        tile = choice // 4
        place = jnp.stack([step + 1 + tile % width, first + tile // width])
        heading = (choice % 4).astype(jnp.float32) * jnp.float32(np.pi / 2)
        return place.astype(jnp.float32) + 0.5, heading

    def _inside(self, bits: jax.Array, column: jax.Array, row: jax.Array) -> jax.Array:
        """float32[2]: the centre of a random tile in the room whose corner is given."""
        width = self.room_size - 2
        tile = draw_index(bits, width * width)
        place = jnp.stack([column + 1 + tile % width, row + 1 + tile // width])
        return place.astype(jnp.float32) + 0.5


def _bottleneck(to_hall: list[jax.Array], down: list[jax.Array]) -> jax.Array:
    """The least priority up to which doors connect all rooms of one side with the hall.

    Args:
        to_hall: uint32[] of each room's door to the hall.
        down: uint32[] of the door between each room and the next.
    """
    best = list(to_hall)
    for i in range(1, len(best)):
        best[i] = jnp.minimum(best[i], jnp.maximum(best[i - 1], down[i - 1]))
    for i in reversed(range(len(best) - 1)):
        best[i] = jnp.minimum(best[i], jnp.maximum(best[i + 1], down[i]))
    return functools.reduce(jnp.maximum, best)
