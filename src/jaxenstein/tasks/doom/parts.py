"""What a scenario is made of: parts, each of which has its share of the state and shows it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import numpy as np

from ...engine.shade import ImageKind
from ...environment import Info
from .view import Picture


@dataclass(frozen=True)
class GameObject:
    """A kind of thing that stands, lies or flies about.

    Attributes:
        name: what the game calls it.
        label: its label id.
        pictures: what it looks like, one after the other as `Part.sprites` numbers them; none for
            what our states do not hold.
    """

    name: str
    label: int
    pictures: tuple[Picture, ...] = ()


class Game(NamedTuple):
    """What the running game tells besides the player's pose.

    Attributes:
        names: what it calls each of M objects.
        objects: int64[M, 5], of each object x and y in 16.16 map units, a number that is the
            higher the later it appeared, its angle, 2**32 a circle, and its speed.
        variables: the values of the variables that were asked for, and of HEALTH.
    """

    names: tuple[str, ...]
    objects: np.ndarray
    variables: Mapping[str, int]

    def of(self, *names: str) -> np.ndarray:
        """int64[K, 5]: the objects of these names, in the game's order."""
        return self.objects[np.isin(np.array(self.names, str), names)]


class Sprites(NamedTuple):
    """Billboards of a part.

    Attributes:
        places: int32[N, 2], map units in 16.16.
        pictures: int32[N], numbers of pictures, counted over the part's objects.
        visible: bool[N].
    """

    places: jax.Array
    pictures: jax.Array
    visible: jax.Array


class Part:
    """A part of a scenario: constants of a program, and functions of the scenario's states.

    Each part owns some fields of the state, which its docstring names. Whatever a part does not
    have is left as it is here.

    Attributes:
        objects: the kinds of things that it shows.
        game_variables: what it asks of the running game, by the game's names.
        limits: entries of `describe` that the `dict` observation has, each with its highest value.
    """

    objects: tuple[GameObject, ...] = ()
    game_variables: tuple[str, ...] = ()
    limits: Mapping[str, int] = {}

    def sprites(self, state: Any) -> Sprites | None:
        """What there is to see of it."""
        del state
        return None

    def show(self, image: jax.Array, state: Any, kind: ImageKind) -> jax.Array:
        """The image of the view with what the part shows over it, if that is asked for."""
        del state, kind
        return image

    def describe(self, state: Any) -> Info:
        """Its entries of `info`."""
        del state
        return {}

    def from_game(self, state: Any, game: Game) -> Any:
        """The state with what the running game tells of the part, in numpy."""
        del game
        return state


class Health(Part):
    """The player's health: `state.health`, int32[]."""

    def __init__(self, most: int) -> None:
        """Say how much there can be of it."""
        self.limits = {"health": most}

    def describe(self, state: Any) -> Info:
        """The health."""
        return {"health": state.health}

    def from_game(self, state: Any, game: Game) -> Any:
        """The game's health."""
        return state.replace(health=np.int32(game.variables["HEALTH"]))
