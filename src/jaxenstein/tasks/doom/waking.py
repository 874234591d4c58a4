"""Monsters that wait for the player from the first tic of the game on, before anybody plays."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from ..draws import random_bits
from .creatures import Creatures, act
from .kinds import Roster

# The tic of the game in which the player is seen first by an agent; until then nobody moves it.
FIRST = 10


def begun(
    roster: Roster, creatures: Creatures, player: jax.Array, key: jax.Array, walls: np.ndarray
) -> Creatures:
    """The monsters in the game's tenth tic: they have looked, seen the player, and taken a step.

    Args:
        roster: their kinds, whose first look is in this tic or, if they look so often, before.
        creatures: monsters that stand there and see the player.
        player: int32[2], where the player is.
        key: random.
        walls: float32[L, 4], walls that block monsters.
    """
    looking = creatures.replace(tics=jnp.ones(len(roster), jnp.int32))
    bits = random_bits(key, (len(roster), 2))
    nothing, quiet = np.zeros((0, 4), np.float32), jnp.bool_(False)
    after, _ = act(roster, looking, player, quiet, bits, opaque=nothing, walls=walls)
    since = FIRST - roster.tics[roster.stand]
    return after.replace(tics=jnp.asarray(roster.tics[roster.walk] - since))
