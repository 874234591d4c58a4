"""Scripted players of Doom's scenarios that aim and shoot."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np

from ...about import Choose, Player
from ...players.chance import NO_OP
from .buttons import ATTACK, FORWARD, MOVE_LEFT, MOVE_RIGHT, TURN_LEFT, TURN_RIGHT
from .creatures import sight
from .fixed import ONE
from .players import walker
from .shots import bearing, offsets

if TYPE_CHECKING:
    from .arena import DoomArena
    from .basic import DoomBasic, DoomBasicState
    from .corridor import DoomCorridorState, DoomDeadlyCorridor
    from .predict import DoomPredictPosition, DoomPredictState
    from .shooter import DoomShooter

# The player's way, for a velocity of one, in the 4 or 8 tics up to the shot and until it stands.
_COASTS, _STOPS = {4: 3.2, 8: 5.6}, 9.0
# So far off, in map units, a shot still hits with something to spare.
_NEAR = 24
# Who turns counts a half turn as so many map units of distance, over pi; and it shoots at what it
# aims at by this share of its half-width.
_TURNING, _SURE = 80, 0.8
# A monster that walks on beyond this y turns back soon; from so far off, along the corridor, a
# player shoots at monsters, in map units.
_TURNS_BACK, _STORMS = 560, 420


def step_and_shoot(env: DoomBasic, params: Any) -> Choose:
    """Step aside until the shot will leave in front of the monster, then shoot."""
    del params
    left, right, shoot = (env.index_of(name) for name in (MOVE_LEFT, MOVE_RIGHT, ATTACK))

    def choose(key: jax.Array, state: DoomBasicState) -> jax.Array:
        del key
        gap = (state.target[1] - state.fixed_position[1]).astype(jnp.float32) * (1 / ONE)
        speed = state.fixed_velocity[1].astype(jnp.float32) * (1 / ONE)
        aligned = jnp.abs(gap - _COASTS[env.weapon.shot] * speed) < _NEAR
        step = jnp.where(gap - _STOPS * speed > 0, jnp.int32(left), jnp.int32(right))
        acts = jnp.where(aligned, jnp.int32(shoot), step)
        return jnp.where(_locked(env, state), NO_OP, acts)

    return choose


def _locked(env: DoomShooter[Any, Any], state: Any) -> jax.Array | bool:
    """Whether ATTACK must not be held yet, since the weapon would stay locked."""
    return env.weapon.locks & (state.time <= env.draw_tics)


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


def lead_and_shoot(env: DoomPredictPosition, params: Any) -> Choose:
    """Turn to where the monster will be when the rocket gets there, and shoot."""
    del params
    left, right, shoot = (env.index_of(name) for name in (TURN_LEFT, TURN_RIGHT, ATTACK))
    weapon, step = env.weapon, int(env.roster.speeds[0])
    angles = np.arange(8) * (math.pi / 4)
    ways = np.stack([np.cos(angles), np.sin(angles)], axis=1) * (step / env.roster.tics.min())

    def choose(key: jax.Array, state: DoomPredictState) -> jax.Array:
        del key
        monster = state.creatures
        place = offsets(state.fixed_position, monster.position)[0]
        way = jnp.asarray(ways, jnp.float32)[monster.direction[0] % 8]
        target = place
        for _ in range(3):
            flight = weapon.shot + jnp.sqrt(jnp.sum(target**2)) / weapon.speed
            target = place + way * flight
        error = bearing((target * ONE).astype(jnp.int32)) - state.angle.astype(jnp.int32)
        off = jnp.abs(error.astype(jnp.float32)) * jnp.float32(math.pi * 2.0**-31)
        aligned = off * jnp.sqrt(jnp.sum(target**2)) < _NEAR
        turn = jnp.where(error > 0, jnp.int32(left), jnp.int32(right))
        acts = jnp.where(aligned, jnp.int32(shoot), turn)
        # It turns back soon: nobody knows where it will be.
        vain = (jnp.abs(target[1]) > _TURNS_BACK) | (state.trigger.ammo == 0) | _locked(env, state)
        return jnp.where(vain, NO_OP, acts)

    return choose


LEAD_AND_SHOOT = Player(
    "turns to where the monster will be, and shoots; sees the whole state",
    lead_and_shoot,
    waits="waits: the monster turns back, or the rocket is fired",
)


def storm(env: DoomDeadlyCorridor, params: Any) -> Choose:
    """Shoot the monsters that see the player and are near; then walk on to the armour."""
    fight, walk = turn_and_shoot(env, params), walker(env)
    goal = jnp.asarray((env.goals[0] * ONE).astype(np.int32))

    def choose(key: jax.Array, state: DoomCorridorState) -> jax.Array:
        creatures = state.creatures
        distance = offsets(state.fixed_position, creatures.position)[:, 0]
        near = sight(creatures, state.fixed_position, env.opaque_walls)
        near = near & creatures.living & (jnp.abs(distance) < _STORMS)
        shown = creatures.replace(health=jnp.where(near, creatures.health, 0))
        shoots = fight(key, state.replace(creatures=shown))
        return jnp.where(jnp.any(near), shoots, walk(state, goal))

    return choose


STORM = Player("shoots who is near, then walks on; sees the whole state", storm)


def run(env: DoomDeadlyCorridor, params: Any) -> Choose:
    """Run straight on."""
    del params
    ahead = env.index_of(FORWARD)
    return lambda key, state: jnp.int32(ahead)


RUN = Player("runs straight on, whatever comes", run)
