"""A scripted player who shoots who is in sight, else fetches what is wanted, else goes on."""

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
    from ..shooter import Shooter
    from .deathmatch import DoomDeathmatch

# Map units from which it shoots.
_RANGE = 800


def hunt(env: Shooter | DoomDeathmatch, params: Any) -> Choose:
    """Shoot the nearest monster in sight; else fetch what is `wanted`, or go by `errand`."""
    fight, walk = turn_and_shoot(env, params), walker(env)
    floor = jnp.asarray(np.pad(open_tiles(env.tilemap), 1))

    def choose(key: jax.Array, state: Any) -> jax.Array:
        creatures, origin = state.creatures, state.fixed_position
        distance = jnp.sum(offsets(origin, creatures.position) ** 2, axis=-1)
        seen = creatures.living & sight(creatures, origin, env.opaque_walls)
        seen = seen & (distance < _RANGE**2) & (state.trigger.ammo > 0)
        shown = creatures.replace(health=jnp.where(seen, creatures.health, 0))
        shoots = fight(key, state.replace(creatures=shown))
        field = flood(floor, jnp.pad(_next(env, state), 1))[1:-1, 1:-1]
        (column, row), _ = next_tile(field, state)
        east = env.tiles.west * ONE + (2 * column + 1) * (env.unit * ONE // 2)
        north = env.tiles.north * ONE - (2 * row + 1) * (env.unit * ONE // 2)
        centre = jnp.stack([east, north])
        return jnp.where(jnp.any(seen), shoots, walk(state, centre))

    return choose


def _next(env: Shooter | DoomDeathmatch, state: Any) -> jax.Array:
    """bool[rows, columns]: where it goes."""
    fetches = state.left & env.wanted(state)
    supplies = env.tiles_of(env.supply_places(state), fetches)
    return jnp.where(jnp.any(fetches), supplies, env.errand(state))


HUNT = Player("shoots who is in sight, else walks on to the aim; sees the whole state", hunt)
