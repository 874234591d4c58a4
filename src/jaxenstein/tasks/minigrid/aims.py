"""What players of a world of things and doors are told to do next."""

from __future__ import annotations

from typing import NamedTuple

import jax

from ..steering import INTERACT

PICK_UP, DROP, DONE = INTERACT + 1, INTERACT + 2, INTERACT + 3
NOWHERE = -1
"""The action of an aim that is reached by standing on it."""


class Aim(NamedTuple):
    """What to do next to solve a world, for players that see the state.

    Attributes:
        tiles: bool[rows, columns], where.
        action: int32[], what to do to one of them: an action with it in front, `DONE` beside it,
            or `NOWHERE` to stand on it.
    """

    tiles: jax.Array
    action: jax.Array
