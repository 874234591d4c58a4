"""One tic of Doom's player: turn, thrust, move or slide, friction.

All in integers, so that a trajectory is that of the game to the last bit. Positions and
velocities are 16.16 map units, x eastwards and y northwards; angles are uint32, 2**32 a circle,
0 east and growing counterclockwise. The rules are those of ZDoom's engine in ViZDoom 1.3, found
by reading it (p_user.cpp, p_mobj.cpp, p_map.cpp, p_maputl.cpp) and held against recordings.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from ..._jax.batching import where_few
from ...pytree import PyTreeNode
from .buttons import Buttons
from .fixed import direction
from .geometry import Geometry
from .slide import ATTEMPTS, slide

# Turning adds this much a tic, the less of the two in a turn's first tics.
SLOW_TURN, FAST_TURN = 320 << 16, 640 << 16
SLOW_TICS = 6
# Below this speed (a sixteenth of a unit) a body without thrust stands.
STANDS = 4096


class Body(PyTreeNode):
    """The player's body.

    Attributes:
        position: int32[2], 16.16 map units.
        velocity: int32[2], units a tic; components stay below 15 units in the game.
        angle: uint32[].
        turn_tics: int32[], tics that a turn button has been held.
    """

    position: jax.Array
    velocity: jax.Array
    angle: jax.Array
    turn_tics: jax.Array


class Tried(PyTreeNode):
    """Where a body was put in a tic, for what it touches there, even if a wall sent it back.

    Attributes:
        moving: bool[], whether it was put anywhere.
        target: int32[2], the first place.
        slid: bool[], whether there were others.
        others: int32[6, 2], those, or the first one again.
    """

    moving: jax.Array
    target: jax.Array
    slid: jax.Array
    others: jax.Array


Blocked = Callable[[jax.Array], jax.Array]
"""Whether bodies block a place, int32[2] -> bool[]."""


def tic(
    geometry: Geometry, body: Body, buttons: Buttons, bodies: Blocked | None = None
) -> tuple[Body, Tried]:
    """The body after one tic, and the places at which it was tried.

    Args:
        geometry: the walls.
        body: before the tic.
        buttons: held in it.
        bodies: what else is in its way, where there is anything.
    """
    angle, turn_tics = _turn(body, buttons)
    added = thrust(angle, buttons)
    velocity = body.velocity + added
    moving = jnp.any(velocity != 0)
    target = body.position + velocity
    slides = geometry.blocked(target)
    glide = where_few(partial(slide, geometry))
    position, slid_velocity, others = glide(slides, body.position, velocity)
    position = jnp.where(slides, position, target)
    velocity = jnp.where(slides, slid_velocity, velocity)
    if bodies is not None:
        bumps = moving & bodies(target)
        beside, slowed = _bump(geometry, bodies, body.position, body.velocity + added)
        position, velocity = jnp.where(bumps, beside, position), jnp.where(bumps, slowed, velocity)
    others = jnp.where(slides, others, jnp.broadcast_to(target[None], (ATTEMPTS, 2)))
    after = Body(position, friction(velocity, buttons), angle, turn_tics)
    return after, Tried(moving, target, slides, others)


def _bump(
    geometry: Geometry, bodies: Blocked, position: jax.Array, velocity: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """Position and velocity of one that runs into another: north or south alone, else the rest."""
    north, east = velocity * np.array([0, 1], np.int32), velocity * np.array([1, 0], np.int32)

    def free(move: jax.Array) -> jax.Array:
        return ~bodies(position + move) & ~geometry.blocked(position + move)

    aside, ahead = free(north), free(east)
    still = jnp.zeros_like(velocity)
    move = jnp.where(aside, north, jnp.where(ahead, east, still))
    return position + move, move


def _turn(body: Body, buttons: Buttons) -> tuple[jax.Array, jax.Array]:
    """uint32[] angle and int32[] tics of turning."""
    turns = buttons.turn_left | buttons.turn_right
    tics = jnp.where(turns, body.turn_tics + 1, 0)
    yaw = jnp.where(tics < SLOW_TICS, jnp.uint32(SLOW_TURN), jnp.uint32(FAST_TURN))
    angle = body.angle + jnp.where(buttons.turn_left, yaw, 0)
    return angle - jnp.where(buttons.turn_right, yaw, 0), tics


def thrust(angle: jax.Array, buttons: Buttons) -> jax.Array:
    """int32[2]: what the buttons add to the velocity.

    A forward thrust is 51200 = 25 * 2048, one to the side 49152 = 24 * 2048, along the angle less
    90 degrees; so the products of 16.16 numbers are shifts by 5 bits.
    """
    cosine, sine = direction(angle)
    forward = jnp.stack([cosine, sine]) * (25 * buttons.ahead) >> 5
    return forward + (jnp.stack([sine, -cosine]) * (24 * buttons.aside) >> 5)


def friction(velocity: jax.Array, buttons: Buttons) -> jax.Array:
    """int32[2]: 29/32 of a velocity, or none."""
    slow = jnp.all(jnp.abs(velocity) < STANDS)
    stands = slow & (buttons.ahead == 0) & (buttons.aside == 0)
    return jnp.where(stands, 0, velocity * 29 >> 5)
