"""The player's body in the state, its start, and its place in the rendered map."""

from __future__ import annotations

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np

from ...environment import State
from ..draws import sample_index
from .fixed import FRACTION_BITS, ONE, to_fixed
from .maps import TileGrid
from .physics import Body

# The headings from which a script chooses, in 65536ths of a turn: all, both ends included.
ANY_ANGLE = (0, ONE)


class DoomState(State):
    """The state of a body in Doom.

    The four fields after `heading` are the game's own, and observations are rendered from them.
    Each step computes `position` and `heading` from them, for maps, `info` and players that know
    tiles. If you change the four, the state continues as the game would.

    Attributes:
        fixed_position: int32[2], map units in 16.16, x eastwards and y northwards.
        fixed_velocity: int32[2], units per tic.
        angle: uint32[], 2**32 per turn, 0 east, growing counter-clockwise.
        turn_tics: int32[], for how many tics a turn button has been held.
        gait: int32[2, 2], the velocity from the player's own steps, after friction and before it,
            which makes the eye bob with `look="game"` or `"random"` and in `doom-take-cover`; else
            None.
    """

    fixed_position: jax.Array
    fixed_velocity: jax.Array
    angle: jax.Array
    turn_tics: jax.Array
    gait: jax.Array | None = dataclasses.field(default=None, kw_only=True)


def pose_fields(body: Body, tiles: TileGrid, bobs: bool) -> dict[str, jax.Array]:
    """The fields of a state for a body.

    Args:
        body: the body.
        tiles: the map as tiles.
        bobs: whether the eye bobs, which adds `gait`.
    """
    fields = {
        "position": to_tiles(body.position, tiles),
        "heading": to_heading(body.angle),
        "fixed_position": body.position,
        "fixed_velocity": body.velocity,
        "angle": body.angle,
        "turn_tics": body.turn_tics,
    }
    if bobs:
        # The velocity before the friction of the last tic.
        fields["gait"] = jnp.stack([body.velocity, body.velocity * 32 // 29])
    return fields


def game_tic(state: State, first_tic: int) -> jax.Array:
    """int32[]: the game's count of tics, `first_tic` of which pass before an episode starts."""
    return state.time + np.int32(first_tic)


def sample_start(starts: np.ndarray, bits: jax.Array) -> jax.Array:
    """int32[2]: one of float[n, 2] positions in map units, drawn with uint32[], in 16.16."""
    table = [[to_fixed(value) for value in spot] for spot in starts.tolist()]
    spots = jnp.asarray(np.array(table, np.int32))
    return spots[sample_index(bits, len(table))]


def sample_angle(bits: jax.Array, angles: tuple[int, int]) -> jax.Array:
    """uint32[]: an angle drawn as in the game's scripts, in 65536ths of a turn, ends included."""
    low, high = angles
    return (sample_index(bits, high - low + 1) + low).astype(jnp.uint32) << 16


def to_tiles(place: jax.Array, tiles: TileGrid) -> jax.Array:
    """float32[..., 2]: (x, y) in tiles of int32[..., 2] map units in 16.16."""
    east = place[..., 0] - tiles.west * ONE
    south = tiles.north * ONE - place[..., 1]
    tile = tiles.unit << FRACTION_BITS
    return jnp.stack([east, south], axis=-1).astype(jnp.float32) * jnp.float32(1 / tile)


def to_heading(angle: jax.Array) -> jax.Array:
    """float32[]: Doom's angle as a heading in radians, clockwise, in [0, 2 pi)."""
    turned = (jnp.uint32(0) - angle) >> 8
    return turned.astype(jnp.float32) * jnp.float32(2 * math.pi * 2.0**-24)
