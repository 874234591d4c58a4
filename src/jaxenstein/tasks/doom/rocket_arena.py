"""Scenarios with monsters in which the player fires rockets."""

from __future__ import annotations

import dataclasses
from typing import TypeVar

import jax
import jax.numpy as jnp

from .arena import DoomArenaParams
from .blasts import MOST, exploded, launched
from .creatures import hurt
from .dice import byte
from .fireballs import DoomFireArena, DoomFireState
from .projectiles import Projectiles
from .weapons import ROCKET_LAUNCHER


class DoomRocketState(DoomFireState):
    """State of a player among monsters that throw, with rockets.

    Attributes:
        rockets: the player's, if it fires any.
    """

    rockets: Projectiles


S = TypeVar("S", bound=DoomRocketState)
P = TypeVar("P", bound=DoomArenaParams)


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoomRocketArena(DoomFireArena[S, P]):
    """Base of scenarios in which the player fires rockets at monsters."""

    def fly_rockets(self, key: jax.Array, state: S, fires: jax.Array, params: P) -> S:
        """The state after a tic of the player's rockets, one more if bool[] it fires."""
        weapon = self.weapon if self.weapon.speed else ROCKET_LAUNCHER
        bits = jax.random.bits(key, (MOST + len(self.roster),), jnp.uint32)
        origin, creatures = state.fixed_position, state.creatures
        rockets = launched(state.rockets, weapon, fires, origin, state.angle)
        direct = weapon.damage(byte(bits[:MOST], 0))
        rockets, lost, dealt = exploded(
            rockets, self.roster, creatures, origin, direct, self.opaque_walls
        )
        after = hurt(self.roster, creatures, dealt, bits[MOST:])
        killed = jnp.sum(creatures.living & ~after.living, dtype=jnp.int32)
        state = state.replace(rockets=rockets, creatures=after, kills=state.kills + killed)
        return self.suffer(state, rockets.position, lost, params)
