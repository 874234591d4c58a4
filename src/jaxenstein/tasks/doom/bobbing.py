"""The bobbing of the eye: up and down in 20 tics, the farther the faster the player walks.

By what the player's own steps make of its velocity: blows push the body, and not the eye (ZDoom's
p_user.cpp, read for its rule, and held against heights that the game tells).
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from .buttons import Buttons
from .fixed import ONE
from .motion import friction, thrust

_PERIOD = 20
# A quarter of the squared speed, up to 16, is twice as far as the eye goes in map units.
_SHARE, _MOST = 0.25, 16.0


def walked(
    pace: jax.Array, angle: jax.Array, buttons: Buttons, velocity: jax.Array, slid: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """The velocity by its own steps, int32[2], as the eye bobs in a tic and as the tic leaves it.

    Args:
        pace: as the tic before left it.
        angle: uint32[], of the player.
        buttons: held in the tic.
        velocity: int32[2], of the body after it.
        slid: bool[], whether it met a wall, which slows both.
    """
    steps = pace + thrust(angle, buttons)
    after = friction(steps, buttons)
    after = jnp.where(slid & (jnp.abs(after) > jnp.abs(velocity)), velocity, after)
    return steps, jnp.where(jnp.any(velocity != 0), after, 0)


def height(steps: jax.Array, time: jax.Array) -> jax.Array:
    """float32[]: map units by which the eye is above its usual height.

    Args:
        steps: int32[2], of `walked`.
        time: int32[], tics since the game began.
    """
    speed = steps.astype(jnp.float32) * np.float32(1 / ONE)
    swing = jnp.minimum(jnp.sum(speed * speed) * np.float32(_SHARE), np.float32(_MOST))
    phase = (time % _PERIOD).astype(jnp.float32) * np.float32(2 * np.pi / _PERIOD)
    return swing * jnp.sin(phase) * np.float32(0.5)
