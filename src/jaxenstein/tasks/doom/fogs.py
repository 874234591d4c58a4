"""The fog in which monsters appear, with `look="game"`: `state.fogs`."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ...engine.textures import ADD
from ...pytree import PyTreeNode
from .game_things import Look, Shown
from .parts import Part

_LETTERS, _TICS = "ABABCDEFGHIJ", 6


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
    """At most `count` fogs; more replace the oldest."""

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
            # They already act in the tic in which they appear.
            (before.age + 1).at[slot].set(1, mode="drop"),
            (before.next + jnp.sum(comes, dtype=jnp.int32)) % self.count,
        )

    @property
    def looks(self) -> tuple[Look, ...]:
        """The game's pictures."""
        # In other images there is no fog, so any picture will do.
        return tuple(
            Look("TFOG", letter, True, ADD, picture=-1) for letter in sorted(set(_LETTERS))
        )

    def shown(self, state: Any, tic: jax.Array) -> Shown:
        """The fogs."""
        del tic
        known, fogs = sorted(set(_LETTERS)), state.fogs
        table = np.array([known.index(letter) for letter in _LETTERS], np.int32)
        frame = fogs.age // _TICS
        look = jnp.asarray(table).at[frame].get(mode="clip")
        return Shown(fogs.position, look, frame < len(_LETTERS))
