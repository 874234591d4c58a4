"""The parts of a scenario, each with its fields of the state and its sprites."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ...engine.scene import Sprites as SceneSprites
from ...engine.shade import ImageKind
from ...environment import Info
from .game_things import ANIMATIONS, Animation, Look, Shown, looks_at, looks_of
from .game_weapon import WeaponLook
from .view import Picture


@dataclass(frozen=True)
class GameObject:
    """A kind of object.

    Attributes:
        name: the game's name.
        label: its label id.
        pictures: its pictures, in the order of the numbers in `Part.sprites`; empty for objects
            that our states do not have.
    """

    name: str
    label: int
    pictures: tuple[Picture, ...] = ()


class Game(NamedTuple):
    """The data of the running game other than the player's pose.

    Attributes:
        names: the game's names of M objects.
        objects: int64[M, 5], for each object x and y in 16.16 map units, a number that increases
            with the time of appearance, the angle, 2**32 per turn, and the speed.
        variables: the values of the requested variables, and of HEALTH.
    """

    names: tuple[str, ...]
    objects: np.ndarray
    variables: Mapping[str, int]

    def of(self, *names: str) -> np.ndarray:
        """int64[K, 5]: the objects with these names, in the game's order."""
        return self.objects[np.isin(np.array(self.names, str), names)]


class Sprites(NamedTuple):
    """The billboards of a part.

    Attributes:
        places: int32[N, 2], map units in 16.16.
        pictures: int32[N], picture numbers, counted over the part's objects.
        visible: bool[N].
        age: int32[N], for `look="game"` the tics since they appeared; None if they always were
            there.
    """

    places: jax.Array
    pictures: jax.Array
    visible: jax.Array
    age: jax.Array | None = None


class Part:
    """A part of a scenario: constants of a program, and functions of the scenario's states.

    Each part owns some fields of the state, which its docstring names. Subclasses override the
    methods that they need.

    Attributes:
        objects: the kinds of objects that it shows.
        game_variables: the game's names of the variables that it needs from the running game.
        limits: entries of `describe` for the `dict` observation, each with its highest value.
    """

    objects: tuple[GameObject, ...] = ()
    game_variables: tuple[str, ...] = ()
    limits: Mapping[str, int] = {}

    def sprites(self, state: Any) -> Sprites | None:
        """The sprites of the part."""
        del state
        return None

    @property
    def looks(self) -> tuple[Look, ...]:
        """With `look="game"`, the game's pictures that it shows."""
        return looks_of(self.animations)

    @property
    def animations(self) -> list[Animation]:
        """With `look="game"`, the pictures that its objects show in turn."""
        return [ANIMATIONS[thing.name] for thing in self.objects]

    def shown(self, state: Any, tic: jax.Array) -> Shown | None:
        """With `look="game"`, what the part shows in a tic int32[] of the game."""
        found = self.sprites(state)
        if found is None:
            return None
        age = jnp.broadcast_to(tic if found.age is None else found.age, found.visible.shape)
        return Shown(found.places, looks_at(self.animations, age, found.pictures), found.visible)

    @property
    def weapon_looks(self) -> tuple[WeaponLook, ...]:
        """With `look="game"`, the game's pictures of the player's weapons."""
        return ()

    def show(self, image: jax.Array, state: Any, kind: ImageKind) -> jax.Array:
        """Draw the part over an image of the view, if that is enabled."""
        del state, kind
        return image

    def describe(self, state: Any) -> Info:
        """The entries of `info`."""
        del state
        return {}

    def from_game(self, state: Any, game: Game) -> Any:
        """The state with what the running game reports about the part, in numpy."""
        del game
        return state


class Health(Part):
    """The player's health: `state.health`, int32[]."""

    def __init__(self, most: int) -> None:
        """Set the maximum health."""
        self.limits = {"health": most}

    def describe(self, state: Any) -> Info:
        """The health."""
        return {"health": state.health}

    def from_game(self, state: Any, game: Game) -> Any:
        """Read the game's health."""
        return state.replace(health=np.int32(game.variables["HEALTH"]))


def billboards(
    parts: Sequence[Part], state: Any, to_tiles: Callable[[jax.Array], jax.Array]
) -> SceneSprites:
    """The sprites of all parts for the renderer.

    Args:
        parts: the parts.
        state: the state.
        to_tiles: a function from places int32[N, 2], in 16.16, to float32[N, 2] in tiles.
    """
    places, pictures, visible, first = [], [], [], 0
    for part in parts:
        if shown := part.sprites(state):
            places.append(shown.places)
            pictures.append(shown.pictures + np.int32(first))
            visible.append(shown.visible)
        first += sum(len(thing.pictures) for thing in part.objects)
    position = to_tiles(jnp.concatenate(places))
    return SceneSprites(position, jnp.concatenate(pictures), jnp.concatenate(visible))
