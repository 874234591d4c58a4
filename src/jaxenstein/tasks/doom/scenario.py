"""The base of all Doom scenarios: a player with buttons on a map, and parts."""

from __future__ import annotations

import abc
import dataclasses
import functools
import math
import os
from pathlib import Path
from typing import ClassVar, Literal, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from ...engine.camera import Camera
from ...engine.level import Level
from ...engine.scene import Scene, Theme
from ...engine.shade import ImageKind
from ...environment import Info, Params
from ...fields import choice, number, of_form
from ...maps.tilemap import TileMap
from ...spaces import Box
from ..hud import strip_rows
from ..navigation import FixedMap
from .arsenal import Arsenal
from .collision import Geometry, load_geometry
from .game_look import GAME_FOCAL_SHARE, screen_of
from .game_scene import GameLook, check_game_look, read_game_look
from .maps import START, DoomMap, TileGrid, load_map, tiled
from .monsters import Horde
from .overlay import check_overlays, strip
from .parts import Game, Part, billboards
from .physics import (
    MOST_SPEED,
    RUN_SPEED,
    Body,
    Buttons,
    action_name,
    bob_height,
    hold,
    numbered,
)
from .pose import (
    DoomState,
    game_tic,
    pose_fields,
    sample_angle,
    sample_start,
    to_heading,
    to_tiles,
)
from .random_look import RandomLook, build_random_look
from .view import EYE, ROW_FOCAL_SHARE, Room, doom_theme, face_labels, labelled_tiles

ButtonsAtOnce = Literal["single", "all"]


S = TypeVar("S", bound=DoomState)
P = TypeVar("P", bound=Params)


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoomScenario(FixedMap[S, P]):
    """A scenario: a player's body on a map, and parts. A step is a tic, 1/35 of a second.

    A scenario defines its parts (`parts`), how an episode starts (`init_state`) and what happens
    in a tic (`transition`). The parts determine the image, the entries of `info` and of the `dict`
    observation, and how a state of the running game becomes one of ours.

    Attributes:
        buttons: `"single"`: an action holds at most one button, numbered as in ViZDoom's Gymnasium
            wrapper: none, then the buttons from the last to the first. `"all"`: any combination,
            in the wrapper's order.
        field_of_view: as in all environments. Rows are those of the game's screen of 320 by 240
            for every image size, so pixels are square only in images of the ratio 10 to 9.
        hud: show health and ammunition as bars in a strip below the view, which becomes shorter by
            as much; only for images of colours or greys.
        show_weapon: show the weapon in the player's hands, and the flash of its shots, as the game
            does by default; only for images of colours or greys. With `look="game"`, its own
            weapon is always there.
        look: `"plain"`: one colour for each texture. `"game"`: the game's pictures from a WAD file,
            with its placement and light, and an eye that bobs while the player walks. Frames with
            the aspect ratio 4:3 and at least 160 columns show what the game shows on a screen of
            that size, unless `samples=2`. Other frames are pixels of its screen of 320 by 240:
            64x48 has the middle one of every 5x5. `"random"`: placement, light and bobbing are
            those of the game, but each episode draws one of 32 patterns for each texture of walls,
            floor and ceiling, and one of four shades for each kind of thing. It needs no WAD file.
        samples: with `look="game"` or `"random"`, 2 for the mean of two adjacent pixels of the
            screen.
        wad: the WAD file for `look="game"`, such as DOOM2.WAD; None for the file of Freedoom, which
            comes with the extra `vizdoom`.
    """

    wad: str | None = of_form(None, "text")
    samples: int = number(1, 1, 2)
    buttons: ButtonsAtOnce = choice("single", ButtonsAtOnce)
    field_of_view: float = 90.0
    hud: bool = False
    show_weapon: bool = False

    survival: ClassVar[bool] = True
    button_names: ClassVar[tuple[str, ...]]
    # Map units per tile.
    unit: ClassVar[int] = 32
    # Whether the tiles are large enough for patterns on walls and floor.
    takes_patterns: ClassVar[bool] = False
    # The game's count of tics at the first observation.
    first_tic: ClassVar[int] = 1
    # Whether the eye bobs with all looks, not only on the game's screen.
    always_bobs: ClassVar[bool] = False
    # The game variable that tells whether the goal was reached, if the end of the episode does not.
    success_count: ClassVar[str] = ""

    def __post_init__(self) -> None:
        """Check the settings."""
        if isinstance(self.wad, str | os.PathLike):
            # The absolute path, so that the environment is the same in another folder.
            object.__setattr__(self, "wad", str(Path(self.wad).expanduser().resolve()))
        super().__post_init__()
        check_game_look(
            self.look,
            self.wad,
            int(self.samples),
            takes_patterns=self.takes_patterns,
            takes_game_look=self.takes_game_look,
        )
        if self.look == "game":
            # Read the pictures now: a damaged file is an error here, not in the first step.
            _ = self.game_look
        if self.hud or self.show_weapon:
            check_overlays(
                self.name,
                self.limits,
                hud=self.hud,
                show_weapon=self.show_weapon,
                observation=self.observation,
                height=self.height,
            )

    @property
    @abc.abstractmethod
    def room(self) -> Room:
        """The map of the scenario."""

    @functools.cached_property
    @abc.abstractmethod
    def parts(self) -> tuple[Part, ...]:
        """The parts of the scenario, in drawing order."""

    @functools.cached_property
    def horde(self) -> Horde:
        """The monsters, for scenarios that have any."""
        raise NotImplementedError(f"{self.name!r} has no monsters")

    @functools.cached_property
    def arsenal(self) -> Arsenal:
        """The player's weapons, for scenarios that have any."""
        raise NotImplementedError(f"{self.name!r} has no weapon")

    @functools.cached_property
    def limits(self) -> dict[str, int]:
        """The variables of the `dict` observation, each with its highest value."""
        return {name: most for part in self.parts for name, most in part.limits.items()}

    @property
    def game_variables(self) -> tuple[str, ...]:
        """The game's variables that are needed in addition to pose and health, by name."""
        return tuple(name for part in self.parts for name in part.game_variables)

    @functools.cached_property
    def game_labels(self) -> dict[str, int]:
        """The label of each object of the game, by name."""
        return {thing.name: thing.label for part in self.parts for thing in part.objects}

    @functools.cached_property
    def action_buttons(self) -> np.ndarray:
        """int32[actions]: the buttons of each action, bit i for `button_names[i]`."""
        count = len(self.button_names)
        return numbered(count, 1 if self.buttons == "single" else count)

    @functools.cached_property
    def action_names(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The buttons of each action in words."""
        return tuple(action_name(self.button_names, held) for held in self.action_buttons.tolist())

    @functools.cached_property
    def doom_map(self) -> DoomMap:
        """The map in map units."""
        return load_map(self.room.map_name)

    @functools.cached_property
    def geometry(self) -> Geometry:
        """The walls that bodies collide with."""
        return load_geometry(self.room.map_name)

    @functools.cached_property
    def tiles(self) -> TileGrid:
        """The map as tiles."""
        return tiled(self.doom_map, self.unit)

    @functools.cached_property
    def tilemap(self) -> TileMap:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The map as tiles with labels, for people and the renderer."""
        return labelled_tiles(self.name, self.tiles, self.starts, self.goals)

    @property
    def scenario(self) -> str | None:
        """Its name in ViZDoom, if it comes with ViZDoom."""
        return self.room.map_name.replace("-", "_")

    @property
    def starts(self) -> np.ndarray:
        """float[n, 2]: the starts of episodes in map units."""
        return self.doom_map.places(START)

    @property
    def goals(self) -> np.ndarray:
        """float[n, 2]: the goals in map units."""
        return np.zeros((0, 2))

    @functools.cached_property
    def level(self) -> Level:
        """The map for the renderer."""
        return self.tiles.level().replace(walls=face_labels(self.tiles))

    @functools.cached_property
    def camera(self) -> Camera:
        """The camera of the game's player."""
        size = self.view_height, int(self.width)
        shown = self.on_screen
        return Camera(
            *size,
            float(self.field_of_view),
            eye=EYE / self.unit,
            wall=(self.doom_map.ceiling - self.doom_map.floor) / self.unit,
            row_focal_share=GAME_FOCAL_SHARE if shown else ROW_FOCAL_SHARE,
            screen=screen_of(*size, int(self.samples)) if shown else None,
        )

    @functools.cached_property
    def theme(self) -> Theme:
        """The look of the map."""
        things = [thing for part in self.parts for thing in part.objects]
        pictures = [(picture, thing.label) for thing in things for picture in thing.pictures]
        return doom_theme(pictures, self.room, self.doom_map.light, self.unit)

    @functools.cached_property
    def game_look(self) -> GameLook:
        """What the scenario shows with `look="game"`."""
        return read_game_look(
            self.parts,
            self.tiles,
            self.level,
            self.theme,
            walls=(self.room.map_name, self.doom_map),
            wad=self.wad,
            screen=(self.view_height, int(self.width), int(self.samples)),
            first_tic=self.first_tic,
        )

    @functools.cached_property
    def random_look(self) -> RandomLook:
        """What the scenario shows with `look="random"`."""
        size = self.view_height, int(self.width), int(self.samples)
        return build_random_look(self.theme, self.level, self.doom_map, self.tiles, size)

    @property
    def on_screen(self) -> bool:
        """Whether frames are pixels of the game's screen, on which the eye bobs."""
        return self.look == "game" or (self.look == "random" and not self.takes_patterns)

    @property
    def shows_weapon(self) -> bool:
        """Whether images of colours show the weapon, if the scenario has one."""
        return self.show_weapon or (self.look == "game" and bool(self.game_look.weapons))

    def dressed(self, scene: Scene, state: S) -> Scene:
        """The scene of a state with its look."""
        if not self.on_screen:
            return super().dressed(scene, state)
        if self.look == "game":
            return self.game_look.dressed(scene, state)
        return self.random_look.dressed(scene, self.look_seed(state), float(self.look_range))

    def scene(self, state: S, params: P) -> Scene:
        """The map and the things on it, from the player's pose."""
        del params
        return Scene(
            level=self.level,
            closed=jnp.zeros(0, bool),
            position=self.to_tiles(state.fixed_position),
            heading=to_heading(state.angle),
            sprites=billboards(self.parts, state, self.to_tiles),
            theme=self.theme,
            lift=self.lift(state),
        )

    @property
    def view_height(self) -> int:
        """The number of image rows above the strip."""
        return self.height - strip_rows(self.height) if self.hud else self.height

    def draw(self, state: S, params: P, kind: ImageKind) -> jax.Array:
        """Add the weapon and the strip."""
        image = super().draw(state, params, kind)
        # The game's look has a weapon of its own.
        if self.show_weapon and self.look != "game":
            for part in self.parts:
                image = part.show(image, state, kind)
        return jnp.concatenate([image, self.strip(state, kind)]) if self.hud else image

    def strip(self, state: S, kind: ImageKind) -> jax.Array:
        """The strip of `hud=True`: health and, on the right, ammunition if there is any."""
        most, rows = self.limits.get("ammo", 0), strip_rows(self.height)
        return strip(self._told(state), most, rows, self.width, kind)

    def _told(self, state: S) -> Info:
        """The entries of the parts for a state."""
        return {name: value for part in self.parts for name, value in part.describe(state).items()}

    def describe(self, state: S, params: P) -> Info:
        """Add the entries of the parts."""
        return super().describe(state, params) | self._told(state)

    def variables(self, state: S) -> dict[str, jax.Array]:
        """The entries of `limits`: float32[1] each."""
        told = self._told(state)
        return {name: told[name].astype(jnp.float32)[None] for name in self.limits}

    def variable_spaces(self) -> dict[str, Box]:
        """The spaces of the variables."""
        kind = np.dtype(np.float32)
        return {name: Box(0.0, float(most), (1,), kind) for name, most in self.limits.items()}

    def lift(self, state: S) -> jax.Array | None:
        """float32[]: how many tiles the eye is above its usual height; None if that is fixed."""
        if state.gait is None:
            return None
        steps, tic = state.gait[1], game_tic(state, self.first_tic)
        return bob_height(steps, tic - 1) * np.float32(1 / self.unit)

    def stride(self, params: P) -> float:
        """The most tiles that the player moves in a tic."""
        del params
        fights = any(isinstance(part, Horde) for part in self.parts)
        # A blow's push, and less than 2 units of thrust, along both axes.
        return (math.sqrt(2) * (MOST_SPEED + 2) if fights else RUN_SPEED) / self.unit

    def to_tiles(self, place: jax.Array) -> jax.Array:
        """float32[..., 2]: (x, y) in tiles of int32[..., 2] map units in 16.16."""
        return to_tiles(place, self.tiles)

    def start_pose(self, bits: jax.Array, angles: tuple[int, int] = (0, 0)) -> dict[str, jax.Array]:
        """The fields of a state for a body that stands at one of the starts.

        Args:
            bits: uint32[2], random.
            angles: the lowest and the highest angle, in 65536ths of a turn.
        """
        place = sample_start(self.starts, bits[0])
        return self.pose(place, sample_angle(bits[1], angles))

    def only_pose(self) -> dict[str, jax.Array]:
        """As `start_pose`, for a single start facing east."""
        return self.start_pose(jnp.zeros(2, jnp.uint32))

    def pose(self, position: jax.Array, angle: jax.Array) -> dict[str, jax.Array]:
        """The fields for a body that stands at int32[2], in 16.16, with an angle uint32[]."""
        return self.body_fields(Body(position, jnp.zeros(2, jnp.int32), angle, jnp.int32(0)))

    def at_pose(self, state: S, position: jax.Array, velocity: jax.Array, angle: jax.Array) -> S:
        """The state with the body in another pose: int32[2], int32[2], uint32[], as in `Body`."""
        return state.replace(**self.body_fields(Body(position, velocity, angle, jnp.int32(0))))

    def from_game(self, state: S, game: Game) -> S:
        """The state with what the running game reports besides the pose, in numpy."""
        return functools.reduce(lambda state, part: part.from_game(state, game), self.parts, state)

    def absorbed(self, state: S, lost: jax.Array) -> tuple[S, jax.Array]:
        """The state after damage int32[N]; int32[], the part that reaches the player."""
        return state, jnp.sum(lost, dtype=jnp.int32)

    def pressed(self, action: jax.Array) -> Buttons:
        """The buttons that an action holds."""
        return hold(self.button_names, self.held(action))

    def held(self, action: jax.Array) -> jax.Array:
        """int32[]: the buttons that an action holds, bit i for `button_names[i]`."""
        table = jnp.asarray(np.append(self.action_buttons, np.int32(0)))
        return table.at[action].get(mode="promise_in_bounds")

    def body_fields(self, body: Body) -> dict[str, jax.Array]:
        """The fields of a state for a body."""
        return pose_fields(body, self.tiles, self.on_screen or self.always_bobs)
