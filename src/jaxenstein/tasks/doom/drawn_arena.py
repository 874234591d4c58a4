"""Arenas that are drawn in characters: the map, what stands on it, and how it looks."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Mapping
from typing import ClassVar, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from ...engine.level import Level, compile_level
from ...engine.scene import Theme
from ...engine.shade import Light
from ...errors import MapError, SettingError
from ...maps.ascii import parse_ascii
from ...maps.symbols import LABEL_COLOURS, SYMBOLS
from ...maps.things import MEDKIT, THING_OF, Role
from ...maps.tilemap import TileMap
from ..appearance import CEILING, FLOOR
from ..steering import heading_range
from .arena import DoomArenaParams
from .bodies import overlap
from .buttons import (
    ATTACK,
    BACKWARD,
    FORWARD,
    MOVE_LEFT,
    MOVE_RIGHT,
    TURN_LEFT,
    TURN_RIGHT,
)
from .fixed import ONE
from .geometry import RADIUS, Geometry, build_geometry
from .kinds import (
    CHAINGUN_GUY,
    CHAINSAW_MARINE,
    DEMON,
    IMP,
    SHOTGUN_GUY,
    ZOMBIE,
    Act,
    Kind,
    Roster,
)
from .lattice import Tiles
from .look import (
    AMMUNITION_BOX,
    GOAL_STAR,
    MEDKIT_BOX,
    MONSTERS,
    ROCKETS,
    Picture,
    doom_theme,
)
from .outline import outline
from .rocket_arena import DoomRocketArena, DoomRocketState
from .shots import segments
from .walls import DoomMap

KINDS: Mapping[str, Kind] = {
    "z": ZOMBIE,
    "s": SHOTGUN_GUY,
    "c": CHAINGUN_GUY,
    "i": IMP,
    "d": DEMON,
    "m": CHAINSAW_MARINE,
}
"""The kind of monster that each symbol of a map stands for."""
TILE, HEIGHT = 64, 96
"""Map units: of a tile, and from floor to ceiling."""
MOST_MONSTERS, MOST_TILES = 64, 64
"""How many monsters a map may have, and how many columns and rows."""
# Half-width of what is taken and of goals; fireballs in the air, of each imp and of all together.
_THING, _BALLS, _MOST_BALLS = 20, 4, 24
_KNOWN = frozenset(
    character
    for character, symbol in SYMBOLS.items()
    if symbol.role or symbol.kind in ("floor", "spawn", "wall", "goal")
)
_EXTRAS = (MEDKIT_BOX, AMMUNITION_BOX, GOAL_STAR)


class DrawnState(DoomRocketState):
    """State of a player on a map with M medkits and boxes of ammunition.

    Attributes:
        left: bool[M], which of them still lie there.
    """

    left: jax.Array


S = TypeVar("S", bound=DrawnState)
P = TypeVar("P", bound=DoomArenaParams)


@functools.lru_cache(maxsize=64)
def _read(text: str) -> TileMap:
    """A map; what is odd about it is told once, to who builds the environment."""
    return parse_ascii(text, goal_required=False, known=_KNOWN, stacklevel=7)


@dataclasses.dataclass(frozen=True, kw_only=True)
class DrawnArena(DoomRocketArena[S, P]):
    """Base of scenarios on a map in characters; `tasks.shooter.Shooter` says what it may hold."""

    text: str = dataclasses.field(repr=False)
    heading: float | tuple[float, float] | None = None

    monsters: ClassVar[Mapping[str, Kind]] = KINDS
    # Whether monsters react at once and strike without pausing, as in the game's highest skill.
    fast: ClassVar[bool] = False
    unit: ClassVar[int] = TILE
    takes_patterns: ClassVar[bool] = True
    button_names: ClassVar[tuple[str, ...]] = (
        MOVE_LEFT,
        MOVE_RIGHT,
        ATTACK,
        FORWARD,
        BACKWARD,
        TURN_LEFT,
        TURN_RIGHT,
    )
    scenario: ClassVar[str | None] = None  # pyright: ignore[reportIncompatibleMethodOverride]

    def __post_init__(self) -> None:
        """Check the settings and the map."""
        super().__post_init__()
        heading_range(self.heading)
        columns, rows = self.tilemap.columns, self.tilemap.rows
        if max(columns, rows) > MOST_TILES:
            raise MapError(
                f"a map of {columns} columns and {rows} rows is too large for a shooter: the limit "
                f"is {MOST_TILES} of each"
            )
        count = len(self.posts)
        if not 1 <= count <= MOST_MONSTERS:
            raise MapError(
                f"a shooter has 1 to {MOST_MONSTERS} monsters ({' '.join(KINDS)}), not {count} as "
                "this map"
            )
        self._check_kinds()

    def _check_kinds(self) -> None:
        found = {THING_OF[label].symbols for label in self._labels("monster")}
        if missing := sorted(found - set(self.monsters)):
            raise SettingError(f"monsters has no kind for the symbol {missing[0]!r} of the map")
        if strange := [kind.name for kind in self.cast if kind.name not in MONSTERS]:
            raise SettingError(
                f"there are no pictures of the monster {strange[0]!r}; a kind of one's own keeps "
                f"one of the names {', '.join(MONSTERS)}"
            )

    # The map.

    @functools.cached_property
    def tilemap(self) -> TileMap:
        """The map as tiles."""
        return dataclasses.replace(_read(self.text), name=self.name)

    @functools.cached_property
    def doom_map(self) -> DoomMap:
        """The map in map units, whose origin is the map's south-western corner."""
        solid = np.array([list(row) for row in self.tilemap.tiles]) != 0
        return DoomMap(outline(solid, TILE), (), 0, HEIGHT, 255)

    @functools.cached_property
    def tiles(self) -> Tiles:
        """Where the tiles are in map units."""
        walls = self.tilemap.walls
        faces = walls if walls.ndim == 3 else walls[None].repeat(4, axis=0)
        return Tiles(faces[0] != 0, faces, (), 0, self.tilemap.rows * TILE, TILE)

    @functools.cached_property
    def geometry(self) -> Geometry:
        """What bodies meet."""
        return build_geometry(self.doom_map.walls)

    @functools.cached_property
    def level(self) -> Level:
        """The map as the renderer has it."""
        return compile_level(self.tilemap.walls, self.tilemap.door_tiles)

    @functools.cached_property
    def opaque_walls(self) -> np.ndarray:  # pyright: ignore[reportIncompatibleMethodOverride]
        """float32[L, 4]: all walls."""
        return segments(self.doom_map.walls)

    @property
    def starts(self) -> np.ndarray:
        """float[n, 2]: where episodes start, in map units."""
        return self.places(self.tilemap.spawns) / ONE

    @property
    def goals(self) -> np.ndarray:
        """float[n, 2]: the goals, in map units."""
        return self.places(self.tilemap.goals) / ONE

    def places(self, cells: object) -> np.ndarray:
        """int32[n, 2]: the centres of (column, row) tiles, map units in 16.16."""
        centre = np.array(cells, np.float64).reshape(-1, 2) + 0.5
        east, north = centre[:, 0] * TILE, (self.tilemap.rows - centre[:, 1]) * TILE
        return (np.stack([east, north], axis=1) * ONE).astype(np.int32)

    def _labels(self, role: Role) -> list[int]:
        return [item.label for item in self.tilemap.items if THING_OF[item.label].role == role]

    def _places(self, role: Role) -> np.ndarray:
        items = [item for item in self.tilemap.items if THING_OF[item.label].role == role]
        return self.places([(item.column, item.row) for item in items])

    @property
    def angles(self) -> tuple[int, int]:
        """The first heading, lowest and highest, in 65536ths of a circle counterclockwise."""
        low, high = heading_range(self.heading)
        return round(-high / (2 * math.pi) * ONE), round(-low / (2 * math.pi) * ONE)

    def touches(self, state: S, places: np.ndarray | jax.Array) -> jax.Array:
        """bool[N]: whether the player is at places int32[N, 2]: nearer than 36 units in x and y."""
        own, other = np.array(RADIUS, np.int32), np.array(_THING, np.int32)
        return overlap(state.fixed_position[None], own, jnp.asarray(places), other)

    def struck(
        self, origin: jax.Array, towards: jax.Array, places: jax.Array, there: jax.Array
    ) -> jax.Array:
        """bool[N]: the body that a bullet hits first; rockets hit later."""
        if self.weapon.speed:
            return jnp.zeros(there.shape, bool)
        return super().struck(origin, towards, places, there)

    # What stands on it.

    @functools.cached_property
    def cast(self) -> tuple[Kind, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The kind of each monster, row by row of the map."""
        return tuple(self.monsters[THING_OF[label].symbols] for label in self._labels("monster"))

    @functools.cached_property
    def roster(self) -> Roster:
        """The monsters."""
        return Roster(self.cast, fast=self.fast, feuds=True)

    @functools.cached_property
    def most_balls(self) -> int:  # pyright: ignore[reportIncompatibleVariableOverride]
        """How many fireballs can be in the air."""
        throwers = sum(any(f.act == Act.THROW for f in kind.missile) for kind in self.cast)
        return min(_BALLS * throwers, _MOST_BALLS)

    @functools.cached_property
    def posts(self) -> np.ndarray:
        """int32[N, 2]: where the monsters stand at first, map units in 16.16."""
        return self._places("monster")

    @functools.cached_property
    def supplies(self) -> np.ndarray:
        """int32[M, 2]: where medkits and ammunition lie, map units in 16.16."""
        return self._places("supply")

    @functools.cached_property
    def medkits(self) -> np.ndarray:
        """bool[M]: which of them are medkits."""
        return np.array([label == MEDKIT.label for label in self._labels("supply")], bool)

    @property
    def pictures(self) -> tuple[Picture, ...]:
        """Of monsters and fireballs, of what lies there, and of rockets."""
        return (*super().pictures, *_EXTRAS, *(ROCKETS if self.weapon.speed else ()))

    @functools.cached_property
    def theme(self) -> Theme:
        """How the map looks: as other maps in characters do."""
        theme = doom_theme(
            self.pictures, floor=FLOOR[0], ceiling=CEILING, level=self.doom_map.light, unit=TILE
        )
        return theme.replace(
            wall_colours=np.array(LABEL_COLOURS, np.float32),
            floor=np.array(FLOOR, np.float32),
            light=Light(),
        )

    def things(self, state: S) -> tuple[jax.Array, jax.Array, jax.Array]:
        """Monsters, fireballs, what lies there, the goals, and rockets."""
        places, looks, present = super().things(state)
        first, rockets = len(super().pictures), state.rockets
        goals = self.places(self.tilemap.goals)
        rocket = np.int32(first + len(_EXTRAS))
        kinds = np.append(np.where(self.medkits, 0, 1), np.full(len(goals), 2)) + first
        fixed = [jnp.asarray(self.supplies), jnp.asarray(goals)]
        kept = [state.left, jnp.ones(len(goals), bool)]
        flying = jnp.where(rockets.flies, rocket, rocket + 1)
        return (
            jnp.concatenate([places, *fixed, rockets.position]),
            jnp.concatenate([looks, jnp.asarray(kinds.astype(np.int32)), flying]),
            jnp.concatenate([present, *kept, rockets.flies | (rockets.bursts > 0)]),
        )
