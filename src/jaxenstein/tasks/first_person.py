"""The base of all rendered tasks: the camera and the kinds of observation."""

from __future__ import annotations

import abc
import dataclasses
import functools
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Literal, TypeVar, cast, get_args

import jax
import jax.numpy as jnp
import numpy as np

from .._jax.batching import select, where_few
from ..about import About
from ..catalogue import ENTRIES
from ..engine.camera import Camera
from ..engine.level import Level
from ..engine.render import render
from ..engine.scene import Scene
from ..engine.shade import ImageKind
from ..environment import Environment, Params, State
from ..errors import SettingError, quoted
from ..fields import choice, number, of_form
from ..images import Images, read_images
from ..maps.tilemap import TileMap
from ..seeds import key_of
from ..spaces import Box, Dict, Space
from .draws import sample_seed
from .dressing import dressed
from .levels import read_level
from .looks import Look, patterned, randomised
from .splits import Split, fingerprint, first_accepted, is_in_split
from .steering import SteeringParams

ObservationKind = Literal["rgb", "gray", "depth", "labels", "dict"]
# Folded into the key of a reset to get the key of the look.
_LOOKS = 0x100C

S = TypeVar("S", bound=State)
P = TypeVar("P", bound=Params)


def _with_game_look() -> list[str]:
    """The ids that can show a game's own pictures."""
    builds: dict[str, Any] = {
        name: row.build for name, row in ENTRIES.items() if name.startswith("doom-")
    }
    return [name for name, build in builds.items() if build.func.takes_game_look]


@dataclasses.dataclass(frozen=True, kw_only=True)
class FirstPerson(Environment[S, P]):
    """Base of first-person tasks.

    Attributes:
        height: image rows in pixels. Every size is rendered natively.
        width: image columns in pixels.
        field_of_view: horizontal angle of view in degrees; pixels are square.
        observation: `"rgb"` uint8[height, width, 3]; `"gray"` uint8[height, width]; `"depth"`
            float32[height, width], perpendicular distance in tiles; `"labels"` uint8[height,
            width], the label id of each pixel, see `jaxenstein.maps.symbols.LABEL_NAMES`;
            `"dict"`: the rgb image as `"image"`, and the variables of the task.
        sprite_layers: how many sprites an image column can show, one behind another.
        look: the look of walls, floor and ceiling: `"plain"`, in one colour each; `"patterned"`,
            with patterns such as bricks and boards; `"random"`, with colours and patterns drawn at
            each reset. Doors, things, depth and labels do not depend on these. Doom's scenarios
            lack `"patterned"`, have their own `"random"`, and add `"game"`: the game's own pictures
            of everything, and a bobbing eye.
        look_range: strength of random looks: from 0, as patterned, to 1, any colours.
        look_seeds: seeds of random looks: None for all seeds, or (first, stop).
        textures: None, or images of walls, floor, ceiling and things: a folder with files such as
            `wall.png`, `floor.png`, `red-wall.png`, `goal.png`; in Python also a table of such
            names with arrays uint8[height, width, 3 or 4]. The names are `wall`, `door`, and those
            of labels. Sides are resized to the next power of two, to 128 at most.
    """

    height: int = number(64, 1, 4096)
    width: int = number(64, 1, 4096)
    field_of_view: float = number(60.0, 30, 120)
    observation: ObservationKind = choice("rgb", ObservationKind)
    sprite_layers: int = number(4, 1, 64)
    look: Look = choice("plain", Look)
    look_range: float = number(1.0, 0, 1)
    look_seeds: tuple[int, int] | range | None = of_form(None, "seeds")
    textures: Images | Mapping[str, np.ndarray] | str | Path | None = of_form(None, "images")

    # Whether it can show a game's own pictures.
    takes_game_look: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """Check the settings."""
        if self.textures is not None:
            object.__setattr__(self, "textures", read_images(self.textures))
        super().__post_init__()
        if self.textures is not None and self.look != "plain":
            raise SettingError(f"textures need look='plain', not look={quoted(self.look)}")
        if self.look == "game" and not self.takes_game_look:
            raise SettingError(f"look='game' is only for {', '.join(_with_game_look())}")
        for name in ("look_seeds", "look_range"):
            given = getattr(self, name)
            if self.look != "random" and given != getattr(FirstPerson, name):
                raise SettingError(
                    f"{name} needs look='random': set that too, not {name}={quoted(given)} with "
                    f"look={quoted(self.look)}"
                )

    @abc.abstractmethod
    def scene(self, state: S, params: P) -> Scene:
        """The scene to render in a state."""

    def first_state(self, key: jax.Array, params: P) -> S:
        """Add the seed of the look, if looks are random."""
        state = super().first_state(key, params)
        if self.look != "random":
            return state
        # A separate key, so that everything else is the same as without random looks.
        seeds = cast("tuple[int, int] | None", self.look_seeds)
        return state.replace(look=sample_seed(jax.random.fold_in(key, _LOOKS), seeds))

    def dressed(self, scene: Scene, state: S) -> Scene:
        """The scene of a state with its look."""
        if self.textures is not None:
            images = cast(Images, self.textures)
            return scene.replace(theme=dressed(scene.theme, images, self.camera))
        if self.look == "plain":
            return scene
        if self.look == "patterned":
            return scene.replace(theme=patterned(scene.theme))
        theme = randomised(scene.theme, self.look_seed(state), float(self.look_range))
        return scene.replace(theme=theme)

    def look_seed(self, state: S) -> jax.Array:
        """uint32[]: the seed of a random look."""
        if state.look is None:
            raise SettingError(
                "look='random' needs a state from reset or first_state, which has a seed for the "
                "look, not one from init_state"
            )
        return state.look

    def tilemap_of(self, state: S) -> TileMap:
        """The map of a state (one, not a batch), on the host, for people.

        By default the walls and doors of the scene; tasks add other things.
        """
        level = self.scene(state, self.default_params).level
        return read_level(self.name, level)

    @functools.cached_property
    def map_size(self) -> tuple[int, int]:
        """(columns, rows) of the map in tiles."""
        level = jax.eval_shape(self._first_level, jax.random.key(0))
        columns, rows = level.size
        return columns - 2 * level.margin, rows - 2 * level.margin

    def _first_level(self, key: jax.Array) -> Level:
        params = self.default_params
        return self.scene(self.init_state(key, self.check_params(params)), params).level

    def variables(self, state: S) -> dict[str, jax.Array]:
        """The variables of the task for the `dict` observation."""
        del state
        return {}

    def variable_spaces(self) -> dict[str, Box]:
        """The spaces of the variables."""
        return {}

    @functools.cached_property
    def camera(self) -> Camera:
        """The camera for observations."""
        return Camera(self.view_height, int(self.width), float(self.field_of_view))

    @property
    def view_height(self) -> int:
        """The number of image rows that show the scene."""
        return int(self.height)

    def draw(self, state: S, params: P, kind: ImageKind) -> jax.Array:
        """Render a state as any kind of image, in the size of the environment."""
        scene = self.dressed(self.scene(state, params), state)
        return render(scene, self.camera, kind, self.sprite_layers)

    def stride(self, params: P) -> float:
        """How many tiles a world step can move the player."""
        return float(params.move_distance) if isinstance(params, SteeringParams) else 0.0

    def observe(self, state: S, params: P) -> Any:
        """Render the observation of a state; see the class for its kinds."""
        return self._observe(state, params)

    # Traced once for all programs that render the same environment, and inlined into them.
    @functools.partial(jax.jit, static_argnums=0, inline=True)
    def _observe(self, state: S, params: P) -> Any:
        kind = "rgb" if self.observation == "dict" else cast(ImageKind, self.observation)
        image = self.draw(state, params, kind)
        if self.observation == "dict":
            return {"image": image, **self.variables(state)}
        return image

    def observation_space(self, params: P | None = None) -> Space:
        """The space of observations."""
        del params
        size = self.height, self.width
        if self.observation == "depth":
            return Box(0.0, math.inf, size, np.dtype(np.float32))
        colour = self.observation in ("rgb", "dict")
        image = Box(0, 255, (*size, 3) if colour else size, np.dtype(np.uint8))
        if self.observation == "dict":
            variables = self.variable_spaces()
            taken = [name for name in variables if hasattr(dict, name)]
            if taken:
                raise SettingError(
                    f"a variable must not be called {quoted(taken[0])}, the name of a method of "
                    "dictionaries: libraries that make modules from the entries could "
                    "not use it"
                )
            return Dict({"image": image, **variables})
        return image


@dataclasses.dataclass(frozen=True, kw_only=True)
class GeneratedTask(FirstPerson[S, P]):
    """Base of tasks that draw a level at each reset; it must come first among the bases of a task.

    `init_state` draws the level, such as walls and things, from one key, and everything else in an
    episode, such as its start, from another:

        level_key, start_key = jax.random.split(key)
        level = ...  # drawn from self.level_key(level_key) and nothing else

    Attributes:
        levels: None for unlimited levels, or the seeds of the levels: `range(first, stop)` or
            (first, stop). Every episode draws one of them uniformly. A seed gives the same level
            on every machine.
        split: None for all levels, or one side: `"train"` or `"test"`. The side of a level depends
            on its content, not on its seed, so no level is on both sides.
        test_fraction: the fraction of all levels on the test side of a split.
    """

    levels: tuple[int, int] | range | None = of_form(None, "seeds")
    split: Split | None = choice(None, (*get_args(Split), None))
    test_fraction: float = number(0.2, above=0, below=1)

    def __post_init__(self) -> None:
        """Check the settings."""
        super().__post_init__()
        if self.split is None and self.test_fraction != GeneratedTask.test_fraction:
            raise SettingError(
                "test_fraction needs a split: set split='train' or split='test' too, not "
                f"test_fraction={quoted(self.test_fraction)} with split=None"
            )

    @property
    def level_range(self) -> tuple[int, int] | None:
        """The first seed and the one after the last; None for unlimited levels."""
        return None if self.levels is None else (int(self.levels[0]), int(self.levels[1]))

    def level_key(self, key: jax.Array) -> jax.Array:
        """The key from which to draw a level: `key` itself, or that of one of the seeds.

        Args:
            key: a key of the episode that is not used elsewhere.
        """
        if self.level_range is None:
            return key
        seed = sample_seed(key, self.level_range)
        # Levels must not depend on the default generator, which users may change.
        return key_of(seed)

    def level_parts(self, state: S) -> tuple[jax.Array, ...]:
        """The content of the level of a first state, as arrays of whole numbers or bools.

        It must be equal for levels that an agent cannot tell apart. So put equal things on a map of
        tiles, not into a list, whose order would matter. Leave out what does not belong to the
        level, such as the start of an episode.
        """
        raise SettingError(
            f"{type(self).__name__} has no split: define level_parts, the content of its levels"
        )

    def first_state(self, key: jax.Array, params: P) -> S:
        """The first state of an episode, in a level of the split."""
        return self._first_where(jnp.bool_(True), key, params)

    def _first_where(self, needed: jax.Array, key: jax.Array, params: P) -> S:
        """A first state if bool[] `needed`, else an arbitrary state."""
        draw = super().first_state
        if self.split is None:
            return draw(key, params)

        def accepts(state: S) -> jax.Array:
            level = fingerprint(self.level_parts(state))
            return is_in_split(str(self.split), float(self.test_fraction), level)

        # A `while_loop` has no reverse-mode derivative.
        return first_accepted(draw, accepts, needed, key, jax.lax.stop_gradient(params))

    def reset_where(self, over: jax.Array, key: jax.Array, state: S, params: P) -> S:
        """As `Environment.reset_where`, but samples only the needed levels, which are expensive."""
        params = jax.lax.stop_gradient(params)
        if self.split is None:
            fresh = where_few(self.first_state)(over, key, params)
        else:
            # In a batch, environments that need no level must not wait for one.
            fresh = where_few(self._first_where)(over, over, key, params)
        return select(over, fresh, state)

    def about(self) -> About:
        """A description of the task."""
        several = self.level_range is None or self.level_range[1] > self.level_range[0] + 1
        return dataclasses.replace(super().about(), generated=several)


SETTINGS = tuple(
    field.name for field in dataclasses.fields(FirstPerson) if field.name not in ("name", "version")
)
"""The settings that every first-person environment takes."""
RESETTING = ("autoreset", "final_observation")
"""The settings of resets, which are up to the code that steps the environment."""
SEEN = tuple(name for name in SETTINGS if name not in RESETTING)
"""The other settings."""
