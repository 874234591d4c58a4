"""The base of all Doom scenarios: a player with buttons on a map, and parts."""

from __future__ import annotations

import abc
import dataclasses
import functools
import math
import os
from pathlib import Path
from typing import ClassVar, Literal, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from ...engine.camera import Camera
from ...engine.level import Level
from ...engine.scene import Scene, Theme
from ...engine.scene import Sprites as SceneSprites
from ...engine.shade import ImageKind
from ...environment import Info, Params, State
from ...errors import SettingError, quoted
from ...fields import choice, number, of_form
from ...maps.things import RGB
from ...maps.tilemap import TileMap
from ...spaces import Box
from ..draws import sample_index
from ..first_person import FirstPerson
from ..health import FULL_HEALTH
from ..hud import AMMUNITION, bar, check_overlay, check_strip, strip_rows
from .arsenal import Arsenal
from .collision import Geometry, load_geometry
from .fixed import FRACTION_BITS, ONE, direction, to_fixed
from .game_look import GAME_FOCAL_SHARE, GamePictures, game_pictures, sampling, screen_of
from .game_things import Look
from .game_walls import free_walls
from .game_weapon import WeaponLook, held
from .maps import START, DoomMap, TileGrid, load_map, tiled
from .monsters import Horde
from .parts import Game, Part
from .physics import (
    Blocked,
    Body,
    Buttons,
    Reached,
    action_name,
    bob_height,
    bob_swing,
    bobbed,
    hold,
    numbered,
    tic,
)
from .view import EYE, ROW_FOCAL_SHARE, doom_theme, face_labels
from .wad import find_iwad

ButtonsAtOnce = Literal["single", "all"]
# The highest speed of a player in map units per tic: 8.33 ahead, 8 sideways.
TOP_SPEED = 12
# The headings from which a script chooses, in 65536ths of a turn: all, both ends included.
ANY_ANGLE = (0, ONE)


class Room(NamedTuple):
    """The map of a scenario.

    Attributes:
        map_name: the name of a file in `maps/`, without suffix.
        floor: mean RGB of the floor's texture.
        ceiling: mean RGB of the ceiling's texture.
    """

    map_name: str
    floor: RGB
    ceiling: RGB


class DoomState(State):
    """The state of a body in Doom.

    The four fields after `heading` are the game's own. `position` and `heading` are computed from
    them in each step, and observations are rendered from those two. If you change the four, the
    state continues as the game would.

    Attributes:
        fixed_position: int32[2], map units in 16.16, x eastwards and y northwards.
        fixed_velocity: int32[2], units per tic.
        angle: uint32[], 2**32 per turn, 0 east, growing counter-clockwise.
        turn_tics: int32[], for how many tics a turn button has been held.
        gait: int32[2, 2], with `look="game"` the velocity from the player's own steps, after
            friction and before it, which makes the eye bob; else None.
    """

    fixed_position: jax.Array
    fixed_velocity: jax.Array
    angle: jax.Array
    turn_tics: jax.Array
    gait: jax.Array | None = dataclasses.field(default=None, kw_only=True)


S = TypeVar("S", bound=DoomState)
P = TypeVar("P", bound=Params)


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoomScenario(FirstPerson[S, P]):
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
            does by default; only for images of colours or greys.
        look: `"plain"`: one colour for each texture. `"game"`: the game's pictures from a WAD file,
            with its placement and light, and an eye that bobs while the player walks. Frames with
            the aspect ratio 4:3 and at least 160 columns show what the game shows on a screen of
            that size. Other frames are pixels of its screen of 320 by 240: 64x48 has the middle one
            of every 5x5.
        samples: with `look="game"`, 2 for the mean of two adjacent pixels of the screen.
        wad: the WAD file for `look="game"`, such as DOOM2.WAD; None for the file of Freedoom, which
            comes with the extra `vizdoom`.
    """

    wad: str | None = of_form(None, "text")
    samples: int = number(1, 1, 2)
    buttons: ButtonsAtOnce = choice("single", ButtonsAtOnce)
    field_of_view: float = 90.0
    hud: bool = False
    show_weapon: bool = False

    button_names: ClassVar[tuple[str, ...]]
    # Map units per tile.
    unit: ClassVar[int] = 32
    # Whether the tiles are large enough for patterns on walls and floor.
    takes_patterns: ClassVar[bool] = False
    # The game's count of tics at the first observation.
    first_tic: ClassVar[int] = 1
    # The game variable that tells whether the goal was reached, if the end of the episode does not.
    success_count: ClassVar[str] = ""

    def __post_init__(self) -> None:
        """Check the settings."""
        if isinstance(self.wad, str | os.PathLike):
            # The absolute path, so that the environment is the same in another folder.
            object.__setattr__(self, "wad", str(Path(self.wad).expanduser().resolve()))
        super().__post_init__()
        if self.look not in ("plain", "game") and not self.takes_patterns:
            raise SettingError(
                "look must be 'plain' or 'game' in Doom's scenarios, whose tiles are too small for "
                f"patterns, not {self.look!r}"
            )
        if self.wad is not None and self.look != "game":
            raise SettingError(
                f"wad needs look='game': set that too, not wad={quoted(self.wad)} with "
                f"look={quoted(self.look)}"
            )
        if self.samples != 1 and self.look != "game":
            raise SettingError(
                f"samples needs look='game': set that too, not samples={self.samples} with "
                f"look={quoted(self.look)}"
            )
        if self.look == "game":
            # Read the pictures now: a damaged file is an error here, not in the first step.
            assert self.game_theme.textures is not None
        check_strip(self.hud, self.observation, self.height)
        check_overlay("show_weapon", self.show_weapon, self.observation)
        if self.hud and not self.limits:
            raise SettingError(f"hud=True: {self.name!r} has neither health nor a weapon")
        if self.show_weapon and not self._most_ammo:
            raise SettingError(f"show_weapon=True: {self.name!r} has no weapon")

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
    def tilemap(self) -> TileMap:
        """The map as tiles with labels, for people and the renderer."""
        faces = tuple(tuple(bytes(row) for row in face) for face in face_labels(self.tiles))
        return TileMap(
            self.name, faces[0], faces, spawns=self.cells(self.starts), goals=self.cells(self.goals)
        )

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

    def cells(self, places: np.ndarray) -> tuple[tuple[int, int], ...]:
        """(column, row) of the tiles of positions in map units, float[n, 2]."""
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
        """The map for the renderer."""
        return self.tiles.level().replace(walls=face_labels(self.tiles))

    @functools.cached_property
    def camera(self) -> Camera:
        """The camera of the game's player."""
        size = self.view_height, int(self.width)
        shown = self.look == "game"
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
        return doom_theme(
            tuple((picture, thing.label) for thing in things for picture in thing.pictures),
            floor=self.room.floor,
            ceiling=self.room.ceiling,
            level=self.doom_map.light,
            unit=self.unit,
        )

    @functools.cached_property
    def game_looks(self) -> tuple[Look, ...]:
        """The game's pictures of the things, part by part; each `picture` is a row of `theme`."""
        looks, first = [], 0
        for part in self.parts:
            looks += [dataclasses.replace(one, picture=one.picture + first) for one in part.looks]
            first += sum(len(thing.pictures) for thing in part.objects)
        return tuple(looks)

    @property
    def weapon_look(self) -> WeaponLook | None:
        """The game's pictures of the player's weapon, if the game shows it."""
        looks = [part.weapon_look for part in self.parts]
        return next((look for look in looks if look is not None), None)

    @functools.cached_property
    def game_pictures(self) -> GamePictures:
        """The game's pictures of map, things and weapon."""
        path = str(find_iwad(self.wad))
        return game_pictures(path, self.room.map_name, self.game_looks, self.weapon_look, self.unit)

    @functools.cached_property
    def game_theme(self) -> Theme:
        """The look of the map in the game, with a row for each picture of each thing."""
        textures, views = self.game_pictures
        places = sampling(self.view_height, int(self.width), int(self.samples))
        textures = textures.replace(sampling=places)
        rows = np.array([look.picture for look in self.game_looks])
        return views.themed(self.theme, rows).replace(textures=textures)

    def game_sprites(self, state: S) -> SceneSprites:
        """The billboards of all parts, in the game's pictures."""
        tic, eye, views = self.game_tic(state), state.fixed_position, self.game_pictures.views
        places, rows, visible, first = [], [], [], 0
        for part in self.parts:
            if shown := part.shown(state, tic):
                places.append(shown.places)
                visible.append(shown.visible)
                rows.append(views.rows(shown._replace(looks=shown.looks + np.int32(first)), eye))
            first += len(part.looks)
        position = self.to_tiles(jnp.concatenate(places))
        return SceneSprites(position, jnp.concatenate(rows), jnp.concatenate(visible))

    @functools.cached_property
    def game_level(self) -> Level:
        """The map for the renderer, with walls where the game has them."""
        return self.level.replace(free_walls=free_walls(self.doom_map, self.tiles))

    def dressed(self, scene: Scene, state: S) -> Scene:
        """The scene of a state with its look."""
        if self.look != "game":
            return super().dressed(scene, state)
        cosine, sine = direction(state.angle)
        heading = jnp.stack([cosine, -sine]).astype(jnp.float32) * np.float32(1 / ONE)
        scene = scene.replace(
            level=self.game_level,
            heading=heading,
            sprites=self.game_sprites(state),
            theme=self.game_theme,
        )
        if self.weapon_look is None:
            return scene
        assert state.gait is not None
        trigger, swing = getattr(state, "trigger"), bob_swing(state.gait[1])  # noqa: B009
        over, glare = held(self.weapon_look, trigger, swing, self.game_tic(state))
        return scene.replace(held=over, glare=glare)

    def sprites(self, state: S) -> SceneSprites:
        """The billboards of all parts."""
        places, pictures, visible, first = [], [], [], 0
        for part in self.parts:
            if shown := part.sprites(state):
                places.append(shown.places)
                pictures.append(shown.pictures + np.int32(first))
                visible.append(shown.visible)
            first += sum(len(thing.pictures) for thing in part.objects)
        position = self.to_tiles(jnp.concatenate(places))
        return SceneSprites(
            position=position, picture=jnp.concatenate(pictures), visible=jnp.concatenate(visible)
        )

    def scene(self, state: S, params: P) -> Scene:
        """The map and the things on it, from the player's pose."""
        del params
        return Scene(
            level=self.level,
            closed=jnp.zeros(0, bool),
            position=self.to_tiles(state.fixed_position),
            heading=to_heading(state.angle),
            sprites=self.sprites(state),
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
        if self.show_weapon:
            for part in self.parts:
                image = part.show(image, state, kind)
        return jnp.concatenate([image, self.strip(state, kind)]) if self.hud else image

    def strip(self, state: S, kind: ImageKind) -> jax.Array:
        """The strip of `hud=True`: health and, on the right, ammunition if there is any."""
        rows, most, now = strip_rows(self.height), self._most_ammo, self._told(state)
        right = self.width // 2 if most else 0
        health = bar(now["health"] / FULL_HEALTH, rows, self.width - right, kind)
        if not right:
            return health
        ammo = bar(now["ammo"] / most, rows, right, kind, AMMUNITION)
        return jnp.concatenate([health, ammo], axis=1)

    @property
    def _most_ammo(self) -> int:
        return self.limits.get("ammo", 0)

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

    def succeeded(
        self, state: S, reward: jax.Array, terminated: jax.Array, events: Info, params: P
    ) -> jax.Array:
        """Whether the success event happened or, without one, the time limit was reached."""
        if self.success_event:
            return super().succeeded(state, reward, terminated, events, params)
        return state.done & ~terminated

    def game_tic(self, state: S) -> jax.Array:
        """int32[]: the game's count of tics, some of which pass before an episode starts."""
        return state.time + np.int32(self.first_tic)

    def lift(self, state: S) -> jax.Array | None:
        """float32[]: how many tiles the eye is above its usual height; None if that is fixed."""
        if state.gait is None:
            return None
        return bob_height(state.gait[1], self.game_tic(state) - 1) * np.float32(1 / self.unit)

    def stride(self, params: P) -> float:
        """The most tiles that the player moves in a tic."""
        del params
        return TOP_SPEED / self.unit

    def to_tiles(self, place: jax.Array) -> jax.Array:
        """float32[..., 2]: (x, y) in tiles of int32[..., 2] map units in 16.16."""
        east = place[..., 0] - self.tiles.west * ONE
        south = self.tiles.north * ONE - place[..., 1]
        tile = self.unit << FRACTION_BITS
        return jnp.stack([east, south], axis=-1).astype(jnp.float32) * jnp.float32(1 / tile)

    def start_pose(self, bits: jax.Array, angles: tuple[int, int] = (0, 0)) -> dict[str, jax.Array]:
        """The fields of a state for a body that stands at one of the starts.

        Args:
            bits: uint32[2], random.
            angles: the lowest and the highest angle, in 65536ths of a turn.
        """
        table = [[to_fixed(value) for value in spot] for spot in self.starts.tolist()]
        spots = jnp.asarray(np.array(table, np.int32))
        return self.pose(spots[sample_index(bits[0], len(table))], sample_angle(bits[1], angles))

    def only_pose(self) -> dict[str, jax.Array]:
        """As `start_pose`, for a single start facing east."""
        return self.start_pose(jnp.zeros(2, jnp.uint32))

    def pose(self, position: jax.Array, angle: jax.Array) -> dict[str, jax.Array]:
        """The fields of a state for a body that stands still.

        Args:
            position: int32[2], map units in 16.16.
            angle: uint32[].
        """
        return self._pose(Body(position, jnp.zeros(2, jnp.int32), angle, jnp.int32(0)))

    def at_pose(self, state: S, position: jax.Array, velocity: jax.Array, angle: jax.Array) -> S:
        """The state with the body in another pose.

        Args:
            state: the state.
            position: int32[2], map units in 16.16.
            velocity: int32[2], units per tic.
            angle: uint32[].
        """
        return state.replace(**self._pose(Body(position, velocity, angle, jnp.int32(0))))

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

    def moved(
        self, state: S, action: jax.Array, bodies: Blocked | None = None
    ) -> tuple[S, Reached]:
        """The state after the body has moved in a tic, and the positions that it reached.

        Args:
            state: the state before the tic.
            action: the action.
            bodies: a function that tells where other bodies are in its way, if there are any.
        """
        body = Body(state.fixed_position, state.fixed_velocity, state.angle, state.turn_tics)
        buttons = self.pressed(action)
        after, reached = tic(self.geometry, body, buttons, bodies)
        fields = self._pose(after)
        if state.gait is not None:
            velocity = after.velocity
            steps, pace = bobbed(state.gait[0], after.angle, buttons, velocity, reached.slid)
            fields["gait"] = jnp.stack([pace, steps])
        return state.replace(**fields), reached

    def _pose(self, body: Body) -> dict[str, jax.Array]:
        fields = {
            "position": self.to_tiles(body.position),
            "heading": to_heading(body.angle),
            "fixed_position": body.position,
            "fixed_velocity": body.velocity,
            "angle": body.angle,
            "turn_tics": body.turn_tics,
        }
        if self.look == "game":
            # The velocity before the friction of the last tic.
            fields["gait"] = jnp.stack([body.velocity, body.velocity * 32 // 29])
        return fields


def to_heading(angle: jax.Array) -> jax.Array:
    """float32[]: Doom's angle as a heading in radians, clockwise, in [0, 2 pi)."""
    turned = (jnp.uint32(0) - angle) >> 8
    return turned.astype(jnp.float32) * jnp.float32(2 * math.pi * 2.0**-24)


def sample_angle(bits: jax.Array, angles: tuple[int, int]) -> jax.Array:
    """uint32[]: an angle drawn as in the game's scripts, in 65536ths of a turn, ends included."""
    low, high = angles
    return (sample_index(bits, high - low + 1) + low).astype(jnp.uint32) << 16
