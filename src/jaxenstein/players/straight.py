"""Walking straight across open ground, where `walking` goes from tile to tile."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from ..engine.scene import Scene
from .walking import FAR, Gait, towards, walk_down

# Tiles from a way to the middles of those that are solid: half a tile's diagonal and a little.
_KEPT_OFF = 0.8
# Turns by which a heading may be off.
_TURNS_OFF = 0.75


def walk_straight(
    body: Gait, scene: Scene, field: jax.Array, key: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """As `walk_down`, but straight ahead where the ground is open.

    Of the tiles that lie open before the player and are nearer to the target, it goes to the one
    by which the whole way is shortest; along corners it goes from tile to tile.
    """
    stepwise, target = walk_down(body, scene, field, key)
    row, column = np.indices(field.shape, np.float32)
    tiles = jnp.asarray(np.stack([column.reshape(-1), row.reshape(-1)], axis=-1) + np.float32(0.5))
    offsets, left = tiles - scene.position[None], field.reshape(-1)
    cell = jnp.floor(scene.position).astype(jnp.int32)
    lies_open = _lies_open(offsets, left >= FAR) & (left < field[cell[1], cell[0]])
    ways = jnp.sqrt(jnp.sum(offsets**2, axis=-1)) + left.astype(jnp.float32)
    best = jnp.argmin(jnp.where(lies_open, ways, jnp.inf))
    straight = towards(body, scene, offsets[best], _TURNS_OFF)
    return jnp.where(jnp.any(lies_open), straight, stepwise), target


def _lies_open(offsets: jax.Array, solid: jax.Array) -> jax.Array:
    """bool[n]: whether a straight way to each of n tiles keeps off all that are solid.

    Args:
        offsets: float32[n, 2], from the player to the middle of each.
        solid: bool[n].
    """
    length = jnp.maximum(jnp.sum(offsets**2, axis=-1), 1e-6)
    # How far along each way (rows) the middle of each tile (columns) is passed.
    along = jnp.sum(offsets[:, None] * offsets[None], axis=-1) / length[:, None]
    past = offsets[None] - jnp.clip(along, 0, 1)[..., None] * offsets[:, None]
    # What lies behind only gets farther away.
    near = (along > 0) & (jnp.sum(past**2, axis=-1) < _KEPT_OFF**2)
    return ~jnp.any(near & solid[None], axis=1)
