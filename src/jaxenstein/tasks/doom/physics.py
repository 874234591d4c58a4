"""One tic of Doom's player: buttons, turn, thrust, move or slide, friction, and the bobbing eye.

Everything is in integers, so that trajectories match the game bit by bit. Positions and velocities
are 16.16 map units, x eastwards and y northwards; angles are uint32, 2**32 per turn, 0 east,
growing counter-clockwise. The rules are those of ZDoom's engine in ViZDoom 1.3 (p_user.cpp,
p_mobj.cpp, p_map.cpp, p_maputl.cpp), and were checked against recordings.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Sequence

import jax
import jax.numpy as jnp
import numpy as np

from ..._jax.batching import where_few
from ...pytree import PyTreeNode
from .collision import Geometry
from .fixed import ONE, direction
from .slide import ATTEMPTS, slide

TURN_LEFT, TURN_RIGHT = "turn left", "turn right"
FORWARD, BACKWARD = "forward", "backward"
MOVE_LEFT, MOVE_RIGHT = "move left", "move right"
ATTACK = "attack"
NOTHING = "nothing"
ALL_MOVES = (MOVE_LEFT, MOVE_RIGHT, ATTACK, FORWARD, BACKWARD, TURN_LEFT, TURN_RIGHT)
"""The buttons of a player who can move in every direction, and shoot."""
# How much a turn adds per tic; the smaller one in the first tics of a turn.
SLOW_TURN, FAST_TURN = 320 << 16, 640 << 16
SLOW_TICS = 6
# Below this speed (a sixteenth of a unit), a body without thrust stops.
STANDS = 4096
# The highest speeds in map units per tic: of a player that runs (8.33 ahead and 8 sideways), and,
# along each axis, of one that a blow has pushed. Below 32 the products of `fixed` do not overflow.
RUN_SPEED, MOST_SPEED = 12, 30
# The tics of one bobbing period; a quarter of the squared speed, up to 16, is twice the amplitude
# of the eye in map units.
_BOB_TICS, _BOB_SHARE, _BOB_MOST = 20, 0.25, 16.0


class Buttons(PyTreeNode):
    """The buttons held in a tic.

    Attributes:
        turn_left: bool[].
        turn_right: bool[].
        ahead: int32[], 1 forward, -1 backward, 0 neither or both.
        aside: int32[], 1 to the right, -1 to the left, 0 neither or both.
        attack: bool[].
    """

    turn_left: jax.Array
    turn_right: jax.Array
    ahead: jax.Array
    aside: jax.Array
    attack: jax.Array | bool = False


def hold(names: Sequence[str], held: jax.Array) -> Buttons:
    """Decode the buttons held in a tic.

    Args:
        names: the scenario's buttons, in the order of its configuration.
        held: int32[]; bit i says whether button i is held.
    """

    def is_down(name: str) -> jax.Array:
        if name not in names:
            return jnp.zeros_like(held)
        return (held >> names.index(name)) & 1

    return Buttons(
        turn_left=is_down(TURN_LEFT) == 1,
        turn_right=is_down(TURN_RIGHT) == 1,
        ahead=is_down(FORWARD) - is_down(BACKWARD),
        aside=is_down(MOVE_RIGHT) - is_down(MOVE_LEFT),
        attack=is_down(ATTACK) == 1,
    )


def numbered(count: int, at_most: int) -> np.ndarray:
    """int32[actions]: the buttons of each action, as bits for `hold`.

    The order is that of ViZDoom's Gymnasium wrapper: all choices of at most `at_most` of `count`
    buttons, in the order of binary numbers whose first digit is the first button. With one button
    at a time, that is none, then the buttons from the last to the first.
    """
    choices = itertools.product((0, 1), repeat=count)
    bits = [
        sum(d << i for i, d in enumerate(digits)) for digits in choices if sum(digits) <= at_most
    ]
    return np.array(bits, np.int32)


def action_name(names: Sequence[str], held: int) -> str:
    """The name of the action that holds these buttons, such as `"turn left + forward"`."""
    return " + ".join(name for i, name in enumerate(names) if held >> i & 1) or NOTHING


class Body(PyTreeNode):
    """The player's body.

    Attributes:
        position: int32[2], 16.16 map units.
        velocity: int32[2], units per tic; components are at most `MOST_SPEED`, and a thrust.
        angle: uint32[].
        turn_tics: int32[], for how many tics a turn button has been held.
    """

    position: jax.Array
    velocity: jax.Array
    angle: jax.Array
    turn_tics: jax.Array


class Reached(PyTreeNode):
    """The positions at which a body may touch things in a tic, even if a wall sent it back.

    Attributes:
        moving: bool[], whether it moved at all.
        target: int32[2], the first position.
        slid: bool[], whether there were others.
        others: int32[6, 2], the others, or copies of the first.
    """

    moving: jax.Array
    target: jax.Array
    slid: jax.Array
    others: jax.Array


Blocked = Callable[[jax.Array], jax.Array]
"""A function that tells whether bodies block positions, int32[K, 2] -> bool[K]."""
# The whole move; a body that runs into another one moves along y alone, or x alone, or stops.
_WAYS = np.array([[1, 1], [0, 1], [1, 0]], np.int32)


def tic(
    geometry: Geometry, body: Body, buttons: Buttons, bodies: Blocked | None = None
) -> tuple[Body, Reached]:
    """The body after one tic, and the positions that it reached.

    Args:
        geometry: the walls.
        body: the body before the tic.
        buttons: the buttons held in it.
        bodies: other bodies in its way, if there are any.
    """
    angle, turn_tics = _turn(body, buttons)
    added = thrust(angle, buttons)
    velocity = body.velocity + added
    moving = jnp.any(velocity != 0)
    target = body.position + velocity
    places = body.position[None] + velocity[None] * _WAYS
    # Without other bodies, only the whole move matters.
    walls = jax.vmap(geometry.blocked)(places[:1] if bodies is None else places)
    slides = walls[0]
    glide = where_few(functools.partial(slide, geometry))
    position, slid_velocity, others = glide(slides, body.position, velocity)
    position = jnp.where(slides, position, target)
    velocity = jnp.where(slides, slid_velocity, velocity)
    if bodies is not None:
        met = bodies(places)
        free, still = ~met & ~walls, body.position
        beside = jnp.where(free[1], places[1], jnp.where(free[2], places[2], still))
        bumps = moving & met[0]
        position = jnp.where(bumps, beside, position)
        velocity = jnp.where(bumps, beside - still, velocity)
    others = jnp.where(slides, others, jnp.broadcast_to(target[None], (ATTEMPTS, 2)))
    after = Body(position, friction(velocity, buttons), angle, turn_tics)
    return after, Reached(moving, target, slides, others)


def _turn(body: Body, buttons: Buttons) -> tuple[jax.Array, jax.Array]:
    """uint32[], the angle; int32[], the tics of turning."""
    turns = buttons.turn_left | buttons.turn_right
    tics = jnp.where(turns, body.turn_tics + 1, 0)
    yaw = jnp.where(tics < SLOW_TICS, jnp.uint32(SLOW_TURN), jnp.uint32(FAST_TURN))
    angle = body.angle + jnp.where(buttons.turn_left, yaw, 0)
    return angle - jnp.where(buttons.turn_right, yaw, 0), tics


def thrust(angle: jax.Array, buttons: Buttons) -> jax.Array:
    """int32[2]: what the buttons add to the velocity.

    A forward thrust is 51200 = 25 * 2048; a sideways one is 49152 = 24 * 2048, along the angle
    minus 90 degrees. So the products of 16.16 numbers are shifts by 5 bits.
    """
    cosine, sine = direction(angle)
    forward = jnp.stack([cosine, sine]) * (25 * buttons.ahead) >> 5
    return forward + (jnp.stack([sine, -cosine]) * (24 * buttons.aside) >> 5)


def friction(velocity: jax.Array, buttons: Buttons) -> jax.Array:
    """int32[2]: 29/32 of a velocity, or zero."""
    slow = jnp.all(jnp.abs(velocity) < STANDS)
    stands = slow & (buttons.ahead == 0) & (buttons.aside == 0)
    return jnp.where(stands, 0, velocity * 29 >> 5)


def bobbed(
    pace: jax.Array, angle: jax.Array, buttons: Buttons, velocity: jax.Array, slid: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """int32[2] twice: the velocity from the player's own steps, in a tic and after its friction.

    The bobbing of the eye depends on it: blows push the body, but do not move the eye (the rule of
    ZDoom's p_user.cpp, checked against heights that the game reports).

    Args:
        pace: the velocity after the previous tic.
        angle: uint32[], of the player.
        buttons: the buttons held in the tic.
        velocity: int32[2], of the body after it.
        slid: bool[], whether the body met a wall, which slows both.
    """
    steps = pace + thrust(angle, buttons)
    after = friction(steps, buttons)
    after = jnp.where(slid & (jnp.abs(after) > jnp.abs(velocity)), velocity, after)
    return steps, jnp.where(jnp.any(velocity != 0), after, 0)


def bob_swing(steps: jax.Array) -> jax.Array:
    """float32[]: how far steps int32[2] make the weapon swing, and the eye half as much."""
    speed = steps.astype(jnp.float32) * np.float32(1 / ONE)
    return jnp.minimum(jnp.sum(speed * speed) * np.float32(_BOB_SHARE), np.float32(_BOB_MOST))


def bob_height(steps: jax.Array, time: jax.Array) -> jax.Array:
    """float32[]: how many map units the eye is above its usual height.

    Args:
        steps: int32[2], from `bobbed`.
        time: int32[], tics since the game began.
    """
    swing = bob_swing(steps)
    phase = (time % _BOB_TICS).astype(jnp.float32) * np.float32(2 * np.pi / _BOB_TICS)
    return swing * jnp.sin(phase) * np.float32(0.5)


def touches(reached: Reached, place: jax.Array, reach: int) -> jax.Array:
    """bool[...]: whether the body's box overlapped that of a thing at a position that it reached.

    Args:
        reached: the positions.
        place: int32[..., 2], of the things, map units in 16.16.
        reach: the sum of the half-widths, in map units.
    """

    def close(target: jax.Array) -> jax.Array:
        return jnp.all(jnp.abs(place - target) < reach * ONE, axis=-1)

    where = [reached.target, *(reached.others[i] for i in range(reached.others.shape[0]))]
    shaped = [target.reshape((1,) * (place.ndim - 1) + (2,)) for target in where]
    return functools.reduce(jnp.logical_or, map(close, shaped)) & reached.moving
