"""A scripted player of Doom's scenarios that steps out of the way of fireballs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp

from ...about import Choose, Player
from ...players.chance import NO_OP
from .buttons import MOVE_LEFT, MOVE_RIGHT
from .fixed import ONE
from .shots import offsets

if TYPE_CHECKING:
    from .cover import DoomTakeCover
    from .fireballs import DoomFireState

# Map units: fireballs farther ahead or aside than this are no danger yet; so near a side of the
# room a player goes back.
_AHEAD, _ASIDE, _WALL = 260, 70, 70


def dodge(env: DoomTakeCover, params: Any) -> Choose:
    """Step away from the nearest fireball ahead, but not into a corner."""
    del params
    left, right = (env.index_of(name) for name in (MOVE_LEFT, MOVE_RIGHT))
    sides = [wall.y0 for wall in env.doom_map.walls]
    south, north = min(sides) + _WALL, max(sides) - _WALL

    def choose(key: jax.Array, state: DoomFireState) -> jax.Array:
        del key
        offset = offsets(state.fixed_position, state.balls.position)
        ahead, aside = offset[:, 0], offset[:, 1]
        near = state.balls.flies & (ahead > -30) & (ahead < _AHEAD) & (jnp.abs(aside) < _ASIDE)
        first = jnp.argmin(jnp.where(near, ahead, jnp.inf))
        y = state.fixed_position[1].astype(jnp.float32) * (1 / ONE)
        go_left = jnp.where(y < south, True, jnp.where(y > north, False, aside[first] < 0))
        step = jnp.where(go_left, jnp.int32(left), jnp.int32(right))
        return jnp.where(jnp.any(near), step, NO_OP)

    return choose


DODGE = Player(
    "steps away from the nearest fireball; sees the whole state", dodge, waits="waits: no danger"
)
