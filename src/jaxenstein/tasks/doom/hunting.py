"""A scripted player of shooters of one's own: shoots who is in sight, else goes on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np

from ...about import Choose, Player
from ...maps.reach import open_tiles
from ...players.walking import flood, next_tile
from .aiming import turn_and_shoot
from .creatures import sight
from .fixed import ONE
from .players import walker
from .shots import offsets

if TYPE_CHECKING:
    from ..shooter import Shooter, ShooterState

# Map units from which it shoots; the health and the shots below which it fetches more.
_RANGE, _HURT, _SHORT = 800, 60, 8


def hunt(env: Shooter, params: Any) -> Choose:
    """Shoot the nearest monster in sight; else fetch what is short, or go where `errand` says."""
    fight, walk = turn_and_shoot(env, params), walker(env)
    floor = jnp.asarray(np.pad(open_tiles(env.tilemap), 1))

    def choose(key: jax.Array, state: ShooterState) -> jax.Array:
        creatures, origin = state.creatures, state.fixed_position
        distance = jnp.sum(offsets(origin, creatures.position) ** 2, axis=-1)
        seen = creatures.living & sight(creatures, origin, env.opaque_walls)
        seen = seen & (distance < _RANGE**2) & (state.trigger.ammo > 0)
        shown = creatures.replace(health=jnp.where(seen, creatures.health, 0))
        shoots = fight(key, state.replace(creatures=shown))
        field = flood(floor, jnp.pad(_next(env, state), 1))[1:-1, 1:-1]
        (column, row), _ = next_tile(field, state)
        north = 2 * env.tilemap.rows - 1 - 2 * row
        centre = jnp.stack([2 * column + 1, north]) * (env.unit * ONE // 2)
        return jnp.where(jnp.any(seen), shoots, walk(state, centre))

    return choose


def _next(env: Shooter, state: ShooterState) -> jax.Array:
    """bool[rows, columns]: where it goes."""
    needed = jnp.where(env.medkits, state.health < _HURT, state.trigger.ammo < _SHORT)
    fetches = state.left & needed
    supplies = env.tiles_of(env.supplies, fetches)
    return jnp.where(jnp.any(fetches), supplies, env.errand(state))


HUNT = Player("shoots who is in sight, else walks on to the aim; sees the whole state", hunt)
