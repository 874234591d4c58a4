"""Find a goal on a fixed map, with or without keys and doors."""

from __future__ import annotations

import dataclasses
import functools
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from ..about import About
from ..engine.level import Level, compile_level
from ..engine.scene import Theme
from ..environment import Params, State
from ..errors import SettingError, quoted
from ..maps.ascii import load_layout
from ..maps.things import GOAL, KEY, RGB
from ..maps.tilemap import Cell, TileMap
from ..players.walking import distance_tables
from .appearance import CEILING, FLOOR, build_theme, check_rgb
from .draws import sample_index
from .first_person import FirstPerson
from .goals import GoalTask, KeysAndDoorsTask, NavigationParams
from .steering import centres, heading_range, sample_heading

S = TypeVar("S", bound=Any)
P = TypeVar("P", bound=Params)


class FixedMap(FirstPerson[S, P]):
    """Base of tasks with a fixed map; it must come first among the bases of a task."""

    tilemap: TileMap

    @functools.cached_property
    def level(self) -> Level:
        """The compiled map, constants of every program."""
        return compile_level(self.tilemap.walls, self.tilemap.door_tiles)

    @functools.cached_property
    def map_size(self) -> tuple[int, int]:
        """(columns, rows) of the map in tiles."""
        return self.tilemap.columns, self.tilemap.rows

    def tilemap_of(self, state: S) -> TileMap:
        """The map."""
        del state
        return self.tilemap

    def level_of(self, state: S) -> Level:
        """The level of the map."""
        del state
        return self.level


class MapGoalState(State):
    """The state of a task with a goal on a fixed map.

    Attributes:
        goal: int32[], index into the map's goals.
    """

    goal: jax.Array


@dataclasses.dataclass(frozen=True, kw_only=True)
class MapGoalTask(FixedMap[S, NavigationParams], GoalTask[S]):
    """Base of tasks with a goal on a fixed map.

    Attributes:
        tilemap: the map. Each reset samples one of its spawns and one of its goals.
        heading: degrees of the first heading: None for any, a number, or (lowest, highest).
        floor: RGB of the two tiles of the floor's checker.
        ceiling: RGB of the ceiling.
    """

    tilemap: TileMap
    heading: float | tuple[float, float] | None = None
    floor: tuple[RGB, RGB] = FLOOR
    ceiling: RGB = CEILING

    def __post_init__(self) -> None:
        """Check the settings."""
        super().__post_init__()
        if not isinstance(self.tilemap, TileMap):
            raise SettingError(f"tilemap must be a TileMap, not {quoted(self.tilemap)}")
        for part in ("spawns", "goals"):
            if not len(getattr(self.tilemap, part)):
                raise SettingError(f"the tilemap has no {part}; this task needs at least one")
        heading_range(self.heading)
        check_rgb("floor", self.floor, (2, 3))
        check_rgb("ceiling", self.ceiling, (3,))

    @functools.cached_property
    def theme(self) -> Theme:
        """The look of the map."""
        doors = bool(self.tilemap.doors)
        labels = self.sprite_labels
        return build_theme(labels, doors=doors, floor=self.floor, ceiling=self.ceiling)

    @functools.cached_property
    def sprite_labels(self) -> tuple[int, ...]:
        """The labels of the sprites; the goal comes first."""
        return (GOAL.label,)

    def sample_start(self, key: jax.Array) -> dict[str, jax.Array]:
        """Fields of the state: start, heading and goal, each uniform."""
        bits = jax.random.bits(key, (3,), jnp.uint32)
        spawn = sample_index(bits[0], len(self.tilemap.spawns))
        return {
            "position": centres(self.tilemap.spawns)[spawn],
            "heading": sample_heading(bits[1], self.heading),
            "goal": sample_index(bits[2], len(self.tilemap.goals)),
        }

    def about(self) -> About:
        """A description of the task."""
        goals = len(self.tilemap.goals)
        one = {"the goal is one of the map's": lambda s: (s.goal >= 0) & (s.goal < goals)}
        return dataclasses.replace(super().about(), holds=one)

    def goal_of(self, state: S) -> jax.Array:
        """float32[2]: the position of the goal in tiles."""
        return centres(self.tilemap.goals)[state.goal]


class NavigationState(MapGoalState):
    """The state of a navigation task; D doors and K keys on the map.

    Attributes:
        opened: bool[D], which doors are open.
        taken: bool[K], which keys have been picked up.
    """

    opened: jax.Array
    taken: jax.Array


@dataclasses.dataclass(frozen=True, kw_only=True)
class Navigation(KeysAndDoorsTask[NavigationState], MapGoalTask[NavigationState]):
    """Reach the goal of a map; actions and reward are those of `KeysAndDoorsTask`."""

    @functools.cached_property
    def sprite_labels(self) -> tuple[int, ...]:
        """The labels of the sprites: the goal, then one for each key colour of the map."""
        return GOAL.label, *sorted({KEY.labels[key.colour] for key in self.tilemap.keys})

    def init_state(self, key: jax.Array, params: NavigationParams) -> NavigationState:
        """Sample start, heading and goal, each uniformly."""
        del params
        return NavigationState(**self.sample_start(key), **self.untouched())

    def untouched(self) -> dict[str, jax.Array]:
        """Fields of the state: all doors closed, no key taken."""
        doors, keys = len(self.tilemap.doors), len(self.tilemap.keys)
        return {"opened": jnp.zeros(doors, bool), "taken": jnp.zeros(keys, bool)}

    def keys_of(self, state: NavigationState) -> tuple[jax.Array, jax.Array, jax.Array]:
        """The map's keys: positions, sprite pictures, colour indices."""
        del state
        keys = self.tilemap.keys
        pictures = [self.sprite_labels.index(KEY.labels[key.colour]) for key in keys]
        colours = [key.colour for key in keys]
        places = centres([(key.column, key.row) for key in keys])
        return places, jnp.array(pictures, jnp.int32), jnp.array(colours, jnp.int32)

    def locks_of(self, state: NavigationState) -> tuple[jax.Array, jax.Array]:
        """The map's doors: which ones are locked, and the colour of the key of each."""
        del state
        doors = self.tilemap.doors
        locked, colours = [door.locked for door in doors], [door.colour for door in doors]
        return jnp.array(locked, bool), jnp.array(colours, jnp.int32)

    def distance_field(self, state: NavigationState) -> jax.Array:
        """int32[rows, columns]: walking distance to the goal, or to a key if it is locked away."""
        weights = 2 ** np.arange(len(self.tilemap.keys), dtype=np.int32)
        taken = jnp.sum(jnp.where(state.taken, weights, 0), dtype=jnp.int32)
        return jnp.asarray(distance_tables(self.tilemap))[taken, state.goal].astype(jnp.int32)


def from_layout(
    layout: str, *, regions: bool = True, spawn: Cell | None = None, **settings: Any
) -> functools.partial[Navigation]:
    """Navigation on a map of the package.

    Args:
        layout: the name of the map.
        regions: whether walls have the colours of their regions.
        spawn: a single start, (column, row), instead of those of the map.
        **settings: settings of `Navigation`.
    """
    tilemap = load_layout(layout, regions=regions)
    tilemap = tilemap.with_spawns((spawn,)) if spawn else tilemap
    return functools.partial(Navigation, tilemap=tilemap, **settings)


def my_way_home(heading: Any = None, **variant: Any) -> functools.partial[Navigation]:
    """ViZDoom's My Way Home on tiles.

    The texture of both floor and ceiling, FLAT1_1, has the mean RGB (65, 46, 26).
    """
    floor, ceiling = ((104, 84, 62), (84, 66, 46)), (52, 42, 34)
    view = {"heading": heading, "floor": floor, "ceiling": ceiling}
    return from_layout("my-way-home", **view, **variant)
