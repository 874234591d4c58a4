"""Scripted players of Doom's scenarios that aim and shoot."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp

from ...about import Choose, Player
from ...players.chance import NO_OP
from .buttons import ATTACK, MOVE_LEFT, MOVE_RIGHT, TURN_LEFT, TURN_RIGHT
from .fixed import ONE
from .shots import bearing

if TYPE_CHECKING:
    from .arena import DoomArena
    from .basic import DoomBasic, DoomBasicState

# The player's way, for a velocity of one, up to the shot's leaving and until it stands, in tics.
_COASTS, _STOPS = 3.2, 9.0
# So far off, in map units, a shot still hits with something to spare.
_NEAR = 24
# Who turns counts a half turn as so many map units of distance, over pi; and it shoots at what it
# aims at by this share of its half-width.
_TURNING, _SURE = 80, 0.8


def step_and_shoot(env: DoomBasic, params: Any) -> Choose:
    """Step aside until the shot will leave in front of the monster, then shoot."""
    del params
    left, right, shoot = (env.index_of(name) for name in (MOVE_LEFT, MOVE_RIGHT, ATTACK))

    def choose(key: jax.Array, state: DoomBasicState) -> jax.Array:
        del key
        gap = (state.target[1] - state.fixed_position[1]).astype(jnp.float32) * (1 / ONE)
        speed = state.fixed_velocity[1].astype(jnp.float32) * (1 / ONE)
        aligned = jnp.abs(gap - _COASTS * speed) < _NEAR
        step = jnp.where(gap - _STOPS * speed > 0, jnp.int32(left), jnp.int32(right))
        return jnp.where(aligned, jnp.int32(shoot), step)

    return choose


STEP_AND_SHOOT = Player(
    "steps aside until the monster is ahead, then shoots; sees the whole state", step_and_shoot
)


def turn_and_shoot(env: DoomArena[Any, Any], params: Any) -> Choose:
    """Turn to the monster that is nearest, also by angle, and shoot when it is ahead."""
    del params
    left, right, shoot = (env.index_of(name) for name in (TURN_LEFT, TURN_RIGHT, ATTACK))
    widths = jnp.asarray(env.half_widths, jnp.float32)

    def choose(key: jax.Array, state: Any) -> jax.Array:
        del key
        creatures = state.creatures
        offset = creatures.position - state.fixed_position[None]
        error = bearing(offset) - state.angle.astype(jnp.int32)
        length = jnp.sqrt(jnp.sum((offset.astype(jnp.float32) * (1 / ONE)) ** 2, axis=-1))
        off = jnp.abs(error.astype(jnp.float32)) * jnp.float32(math.pi * 2.0**-31)
        worst = jnp.where(creatures.living, length + _TURNING * off, jnp.inf)
        first = jnp.argmin(worst)
        ahead = creatures.living[first] & (off[first] * length[first] < widths[first] * _SURE)
        turn = jnp.where(error[first] > 0, jnp.int32(left), jnp.int32(right))
        acts = jnp.where(ahead, jnp.int32(shoot), turn)
        return jnp.where(jnp.any(creatures.living), acts, NO_OP)

    return choose


TURN_AND_SHOOT = Player(
    "turns to the nearest monster and shoots when it is ahead; sees the whole state",
    turn_and_shoot,
    waits="waits: alone",
)
