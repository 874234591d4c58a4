"""What only `look="game"` shows in Deathmatch: fog, and things with which nothing happens."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ...engine.textures import ADD
from ...pytree import PyTreeNode
from .fixed import ONE
from .game_things import Look, Shown
from .maps import MapThing
from .parts import Part

_LETTERS, _TICS = "ABABCDEFGHIJ", 6
_PICTURES = sorted(set(_LETTERS))


class Fogs(PyTreeNode):
    """The last M fogs.

    Attributes:
        position: int32[M, 2], map units in 16.16.
        age: int32[M], tics since each appeared.
        next: int32[], the index of the next new one.
    """

    position: jax.Array
    age: jax.Array
    next: jax.Array


class Fog(Part):
    """The fog in which monsters appear: `state.fogs`, at most `count`; more replace the oldest."""

    def __init__(self, count: int) -> None:
        """Set the most fogs."""
        self.count = count

    def none(self) -> Fogs:
        """No fogs."""
        age = jnp.full(self.count, len(_LETTERS) * _TICS, jnp.int32)
        return Fogs(jnp.zeros((self.count, 2), jnp.int32), age, jnp.int32(0))

    def added(self, before: Fogs, comes: jax.Array, places: jax.Array) -> Fogs:
        """The fogs a tic later, with new ones at int32[N, 2] where bool[N] is true."""
        order = jnp.cumsum(comes.astype(jnp.int32)) - 1
        slot = jnp.where(comes, (before.next + order) % self.count, self.count)
        return Fogs(
            before.position.at[slot].set(places, mode="drop"),
            # A fog is one tic old in the first frame that shows it.
            (before.age + 1).at[slot].set(1, mode="drop"),
            (before.next + jnp.sum(comes, dtype=jnp.int32)) % self.count,
        )

    @property
    def looks(self) -> tuple[Look, ...]:
        """The game's pictures."""
        return tuple(Look("TFOG", letter, True, ADD, picture=-1) for letter in _PICTURES)

    def shown(self, state: Any, tic: jax.Array) -> Shown:
        """The fogs."""
        del tic
        fogs = state.fogs
        table = np.array([_PICTURES.index(letter) for letter in _LETTERS], np.int32)
        frame = fogs.age // _TICS
        look = jnp.asarray(table).at[frame].get(mode="clip")
        return Shown(fogs.position, look, frame < len(_LETTERS))


SCENERY = {17: "CELP", 2004: "PLAS"}
"""The sprites of the things on the map that do nothing, by their numbers."""
# The game has a copy of the player at each of its other starts: x, y and eighths of a turn.
_COPIES = ((320, 832, 0), (40, 984, 7))


class Scenery(Part):
    """Things that never change: copies of the player, and things that our states leave out."""

    def __init__(self, things: Sequence[MapThing]) -> None:
        """Read the places of the things on the map."""
        own = [thing for thing in things if thing.kind in SCENERY]
        places = [(x, y) for x, y, _ in _COPIES] + [(thing.x, thing.y) for thing in own]
        self._places = (np.array(places) * ONE).astype(np.int32)
        kinds = [0] * len(_COPIES) + [1 + list(SCENERY).index(thing.kind) for thing in own]
        self._looks = np.array(kinds, np.int32)
        eighths = [eighth for *_, eighth in _COPIES] + [0] * len(own)
        self._facing = np.array(eighths, np.uint32) << np.uint32(29)

    @property
    def looks(self) -> tuple[Look, ...]:
        """The game's pictures."""
        own = (Look(sprite, picture=-1) for sprite in SCENERY.values())
        return Look("PLAY", picture=-1, green=True), *own

    def shown(self, state: Any, tic: jax.Array) -> Shown:
        """All of them."""
        del state, tic
        here = jnp.ones(len(self._places), bool)
        return Shown(
            jnp.asarray(self._places), jnp.asarray(self._looks), here, jnp.asarray(self._facing)
        )
