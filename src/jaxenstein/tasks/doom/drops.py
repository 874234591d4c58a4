"""What monsters drop when they die, with `look="game"`: `state.drops`.

Numbers are those of the game (ViZDoom 1.3.2, p_enemy.cpp): a thing is thrown up from the middle of
a monster in a random direction, falls, and slides to where it stays. Only its last place is shown.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .fixed import ONE, byte
from .game_things import Look, Shown
from .monsters import Horde
from .parts import Part

# The sprites of the things by the game's names of the monsters.
_SPRITES = {"Zombieman": "CLIP", "ShotgunGuy": "SHOT", "ChaingunGuy": "MGUN"}
# The frames of a death before the thing appears, and the height from which it is thrown.
_BEFORE, _MIDDLE = 2, 28
# How far it slides in map units, for a speed of one map unit per tic.
_SLIDES = 29 / 3


class Drops(Part):
    """The things that monsters drop, one for each; nobody can reach them."""

    def __init__(self, horde: Horde, room: tuple[int, int]) -> None:
        """Build the tables; `room` is how far at most a thing moves along x and y, in map units."""
        sprites = [_SPRITES[kind.game_name] for kind in horde.kinds]
        self._horde, self._room, self._sprites = horde, room, sprites

    def sample(self, bits: jax.Array) -> jax.Array:
        """int32[N, 2]: from each monster to its thing, 16.16, with random bits uint32[N, 2]."""
        pairs = [byte(bits[:, 0], i) - byte(bits[:, 0], i + 1) for i in (0, 2)]
        speed = jnp.stack(pairs, axis=1).astype(jnp.float32) * np.float32(1 / 256)
        up = 5 + byte(bits[:, 1], 0).astype(jnp.float32) * np.float32(1 / 64)
        flight = up + jnp.sqrt(up * up + 2 * _MIDDLE)
        way = speed * (flight[:, None] + _SLIDES)
        room = np.array([self._room], np.float32)
        return (jnp.clip(way, -room, room) * ONE).astype(jnp.int32)

    @property
    def looks(self) -> tuple[Look, ...]:
        """The game's pictures."""
        return tuple(Look(sprite, picture=-1) for sprite in self._sprites)

    def shown(self, state: Any, tic: jax.Array) -> Shown:
        """The things of monsters that are dead."""
        del tic
        monsters, horde = state.monsters, self._horde
        # Frames of a death are the last ones of each kind.
        there = monsters.present & (monsters.frame >= horde.die + _BEFORE)
        return Shown(monsters.position + state.drops, jnp.asarray(horde.kind_of), there)
