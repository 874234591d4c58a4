"""What ViZDoom's own scenarios have in common here: the body, the buttons, the view."""

from __future__ import annotations

import abc
import dataclasses
import functools
import math
from collections.abc import Mapping
from typing import ClassVar, Literal, TypeVar, get_args

import jax
import jax.numpy as jnp
import numpy as np

from ...engine.camera import Camera
from ...engine.level import Level
from ...engine.scene import Scene, Sprites, Theme
from ...environment import Params, State
from ...errors import SettingError
from ...maps.tilemap import TileMap
from ..draws import draw_index
from ..first_person import FirstPerson
from .buttons import Buttons, action_name, hold, numbered
from .fixed import FRACTION_BITS, ONE, to_fixed
from .geometry import Geometry, load_geometry
from .lattice import Tiles, rasterise
from .look import EYE, ROW_FOCAL_SHARE, relabelled
from .motion import Blocked, Body, Tried, tic
from .walls import DoomMap, load_map

ButtonsAtOnce = Literal["single", "all"]
# Map units a tic that nobody exceeds: ahead 8.33, aside 8.
TOP_SPEED = 12
# The headings that a script draws, in 65536ths of a circle: any of them, both ends included.
ANY_ANGLE = (0, ONE)


class DoomState(State):
    """State of a body in Doom.

    The game knows the last four alone; `position` and `heading` follow from them in each step,
    and observations are drawn from them. A state with others of these goes on as the game would.

    Attributes:
        fixed_position: int32[2], map units in 16.16, x eastwards and y northwards.
        fixed_velocity: int32[2], units a tic.
        angle: uint32[], 2**32 a circle, 0 east, growing counterclockwise.
        turn_tics: int32[], tics that a turn button has been held.
    """

    fixed_position: jax.Array
    fixed_velocity: jax.Array
    angle: jax.Array
    turn_tics: jax.Array


S = TypeVar("S", bound=DoomState)
P = TypeVar("P", bound=Params)


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoomScenario(FirstPerson[S, P]):
    """Base of ViZDoom's scenarios. A step is a tic of the game, of which a second has 35.

    Attributes:
        buttons: `"single"`: an action holds no button or one, numbered as by ViZDoom's Gymnasium
            wrapper: none, then the buttons from the last to the first. `"all"`: any combination,
            in the wrapper's order.
        field_of_view: as of all environments. Rows are those of the game's screen of 320 by 240
            whatever the image's size, so pixels are square only in images of the ratio 10 to 9.
    """

    buttons: ButtonsAtOnce = "single"
    field_of_view: float = 90.0

    map_name: ClassVar[str]
    # Map units of a tile.
    unit: ClassVar[int] = 32
    button_names: ClassVar[tuple[str, ...]]
    # What the game calls the things of each look.
    game_things: ClassVar[tuple[str, ...]]
    # Whether the tiles are large enough for patterns on walls and floor.
    takes_patterns: ClassVar[bool] = False
    # The game's count that tells whether the aim was reached, where the end does not.
    success_count: ClassVar[str] = ""

    def __post_init__(self) -> None:
        """Check the settings."""
        super().__post_init__()
        if self.buttons not in get_args(ButtonsAtOnce):
            raise SettingError(f"buttons must be 'single' or 'all', not {self.buttons!r}")
        if self.look != "plain" and not self.takes_patterns:
            raise SettingError(
                "look must be 'plain' in Doom's scenarios, whose tiles are too small for "
                f"patterns, not {self.look!r}"
            )

    @functools.cached_property
    def action_buttons(self) -> np.ndarray:
        """int32[actions]: the buttons that each action holds, bit i for `button_names[i]`."""
        count = len(self.button_names)
        return numbered(count, 1 if self.buttons == "single" else count)

    @functools.cached_property
    def action_names(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The buttons of each action in words."""
        return tuple(action_name(self.button_names, held) for held in self.action_buttons.tolist())

    @functools.cached_property
    def doom_map(self) -> DoomMap:
        """The map in map units."""
        return load_map(self.map_name)

    @functools.cached_property
    def geometry(self) -> Geometry:
        """What bodies meet on it."""
        return load_geometry(self.map_name)

    @functools.cached_property
    def tiles(self) -> Tiles:
        """The map as tiles."""
        return rasterise(self.doom_map, self.unit)

    @functools.cached_property
    def game_labels(self) -> dict[str, int]:
        """The label of each thing of the game by its name."""
        return dict(zip(self.game_things, self.theme.sprite_labels.tolist(), strict=True))

    @functools.cached_property
    def tilemap(self) -> TileMap:
        """The map as tiles with labels, for people and the renderer."""
        faces = tuple(tuple(bytes(row) for row in face) for face in relabelled(self.tiles))
        return TileMap(
            self.name, faces[0], faces, spawns=self.cells(self.starts), goals=self.cells(self.goals)
        )

    @property
    def scenario(self) -> str | None:
        """Its name in ViZDoom, where that comes with it."""
        return self.map_name.replace("-", "_")

    @property
    def game_variables(self) -> tuple[str, ...]:
        """What the game tells besides pose and health, by its names."""
        return ()

    @property
    def starts(self) -> np.ndarray:
        """float[n, 2]: places in map units where episodes start."""
        return np.zeros((0, 2))

    @property
    def goals(self) -> np.ndarray:
        """float[n, 2]: places of goals in map units."""
        return np.zeros((0, 2))

    def cells(self, places: np.ndarray) -> tuple[tuple[int, int], ...]:
        """(column, row) of the tiles of places in map units, float[n, 2]."""
        corners = [self.tiles.to_position(x, y) for x, y in places.tolist()]
        return tuple((math.floor(x), math.floor(y)) for x, y in corners)

    @functools.cached_property
    def map_size(self) -> tuple[int, int]:
        """(columns, rows) of the map in tiles."""
        return self.tilemap.columns, self.tilemap.rows

    def tilemap_of(self, state: S) -> TileMap:
        """The map."""
        del state
        return self.tilemap

    @functools.cached_property
    def level(self) -> Level:
        """The map as the renderer has it."""
        return self.tiles.level().replace(walls=relabelled(self.tiles))

    @functools.cached_property
    def camera(self) -> Camera:
        """The eyes of the game's player."""
        return Camera(
            self.view_height,
            int(self.width),
            float(self.field_of_view),
            eye=EYE / self.unit,
            wall=(self.doom_map.ceiling - self.doom_map.floor) / self.unit,
            row_focal_share=ROW_FOCAL_SHARE,
        )

    @functools.cached_property
    @abc.abstractmethod
    def theme(self) -> Theme:
        """How the map looks."""

    @abc.abstractmethod
    def things(self, state: S) -> tuple[jax.Array, jax.Array, jax.Array]:
        """int32[N, 2] places (16.16 map units), int32[N] looks, bool[N] whether they are there."""

    def scene(self, state: S, params: P) -> Scene:
        """The map and the things on it, from where the player stands."""
        del params
        places, looks, present = self.things(state)
        return Scene(
            level=self.level,
            closed=jnp.zeros(0, bool),
            position=self.to_tiles(state.fixed_position),
            heading=to_heading(state.angle),
            sprites=Sprites(position=self.to_tiles(places), look=looks, visible=present),
            theme=self.theme,
            lift=self.lift(state),
        )

    def lift(self, state: S) -> jax.Array | None:
        """float32[]: tiles by which the eye is above its usual height, if that changes."""
        del state
        return None

    def stride(self, params: P) -> float:
        """The most tiles that a tic moves the player."""
        del params
        return TOP_SPEED / self.unit

    def to_tiles(self, place: jax.Array) -> jax.Array:
        """float32[..., 2]: (x, y) in tiles of int32[..., 2] map units in 16.16."""
        east = place[..., 0] - self.tiles.west * ONE
        south = self.tiles.north * ONE - place[..., 1]
        tile = self.unit << FRACTION_BITS
        return jnp.stack([east, south], axis=-1).astype(jnp.float32) * jnp.float32(1 / tile)

    def drawn(self, bits: jax.Array, angles: tuple[int, int]) -> dict[str, jax.Array]:
        """The fields of a state of a body at one of the starts.

        Args:
            bits: uint32[2], random.
            angles: the lowest and the highest angle, in 65536ths of a circle.
        """
        table = [[to_fixed(value) for value in spot] for spot in self.starts.tolist()]
        spots = jnp.asarray(np.array(table, np.int32))
        return self.placed(spots[draw_index(bits[0], len(table))], draw_angle(bits[1], angles))

    def placed(self, position: jax.Array, angle: jax.Array) -> dict[str, jax.Array]:
        """The fields of a state of a body that stands still.

        Args:
            position: int32[2], map units in 16.16.
            angle: uint32[].
        """
        still = Body(position, jnp.zeros(2, jnp.int32), angle, jnp.int32(0))
        return self._pose(still)

    def at_pose(self, state: S, position: jax.Array, velocity: jax.Array, angle: jax.Array) -> S:
        """The state with the body in another pose.

        Args:
            state: the state.
            position: int32[2], map units in 16.16.
            velocity: int32[2], units a tic.
            angle: uint32[].
        """
        return state.replace(**self._pose(Body(position, velocity, angle, jnp.int32(0))))

    def with_things(self, state: S, health: int, things: np.ndarray) -> S:
        """The state with what the game tells besides the pose.

        Args:
            state: the state.
            health: of the player.
            things: int64[M, 6], of each thing its look, x and y in 16.16 map units, a number that
                is the higher the later it appeared, its angle, 2**32 a circle, and its speed.
        """
        del health, things
        return state

    def with_variables(self, state: S, values: Mapping[str, int]) -> S:
        """The state with the values of `game_variables`."""
        del values
        return state

    def pressed(self, action: jax.Array) -> Buttons:
        """The buttons that an action holds."""
        return hold(self.button_names, self.held(action))

    def held(self, action: jax.Array) -> jax.Array:
        """int32[]: the buttons that an action holds, bit i for `button_names[i]`."""
        table = jnp.asarray(np.append(self.action_buttons, np.int32(0)))
        return table.at[action].get(mode="promise_in_bounds")

    def moved(self, state: S, action: jax.Array, bodies: Blocked | None = None) -> tuple[S, Tried]:
        """The state after the body has moved in a tic, and where it was put.

        Args:
            state: before it.
            action: the action.
            bodies: tells where others are in its way, if there are any.
        """
        body = Body(state.fixed_position, state.fixed_velocity, state.angle, state.turn_tics)
        after, tried = tic(self.geometry, body, self.pressed(action), bodies)
        return state.replace(**self._pose(after)), tried

    def _pose(self, body: Body) -> dict[str, jax.Array]:
        return {
            "position": self.to_tiles(body.position),
            "heading": to_heading(body.angle),
            "fixed_position": body.position,
            "fixed_velocity": body.velocity,
            "angle": body.angle,
            "turn_tics": body.turn_tics,
        }


def to_heading(angle: jax.Array) -> jax.Array:
    """float32[]: Doom's angle as a heading in radians, clockwise, from 0 up to 2 pi."""
    turned = (jnp.uint32(0) - angle) >> 8
    return turned.astype(jnp.float32) * jnp.float32(2 * math.pi * 2.0**-24)


def draw_angle(bits: jax.Array, angles: tuple[int, int]) -> jax.Array:
    """uint32[]: an angle as the game's scripts draw it: 65536ths of a circle, both ends too."""
    low, high = angles
    return (draw_index(bits, high - low + 1) + low).astype(jnp.uint32) << 16


def near(tried: Tried, place: jax.Array, reach: int) -> jax.Array:
    """bool[...]: whether the body was put where its box overlaps that of a thing.

    Args:
        tried: where the body was put.
        place: int32[..., 2], map units in 16.16.
        reach: the sum of the half-widths, in map units.
    """

    def close(target: jax.Array) -> jax.Array:
        return jnp.all(jnp.abs(place - target) < reach * ONE, axis=-1)

    where = [tried.target, *(tried.others[i] for i in range(tried.others.shape[0]))]
    shaped = [target.reshape((1,) * (place.ndim - 1) + (2,)) for target in where]
    return functools.reduce(jnp.logical_or, map(close, shaped)) & tried.moving
