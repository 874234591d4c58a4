"""Motion through a level: turning, walking, touching. Bodies are points."""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from .level import Level, door_at, is_solid

# Headings are rounded to this many parts of a degree. This is about as fine as float32, and coarse
# enough that a heading with `DRIFT` radians of rounding still identifies its part after a turn.
PARTS = 4000
DRIFT = 1.2e-6


def turn(heading: jax.Array, angle: jax.Array) -> jax.Array:
    """float32[]: the heading after a clockwise turn on the map, in [0, 2 pi).

    If the angle is a whole number of parts of a degree, the heading stays within `DRIFT` radians of
    the exact sum after any number of turns. Other angles are added as they are.
    """
    turned = jnp.mod(heading + angle, jnp.float32(2 * math.pi))
    # A tiny negative heading rounds up to the full circle itself.
    turned = jnp.where(turned >= jnp.float32(2 * math.pi), 0, turned)
    whole = (jnp.abs(_in_parts(angle) - angle) <= jnp.abs(angle) * np.float32(2**-23)) & (
        angle != 0
    )
    near = _in_parts(turned)
    off = jnp.abs(near - turned)
    # Half a part away, the next part would be equally close.
    strayed = (off > np.float32(DRIFT)) & (off < np.float32(math.pi / 360 / PARTS))
    near = jnp.where(near >= jnp.float32(2 * math.pi), 0, near)
    exact = jnp.where(whole & strayed, near, turned)
    # Its derivative is that of the sum.
    return lax.stop_gradient(exact) + (turned - lax.stop_gradient(turned))


def _in_parts(angle: jax.Array) -> jax.Array:
    """float32[]: an angle rounded to a whole number of parts of a degree.

    The factors have so few bits that their products are exact in float32, so the sum does not
    depend on whether a compiler rounds the products.
    """
    parts = jnp.round(angle * np.float32(180 * PARTS / math.pi))
    degrees = jnp.floor(parts * np.float32(1 / PARTS))
    rest = parts - degrees * np.float32(PARTS)
    high, low = _in_two(math.pi / 180, 15)
    rest_high, rest_low = _in_two(math.pi / 180 / PARTS, 11)
    return degrees * high + (degrees * low + (rest * rest_high + rest * rest_low))


def _in_two(number: float, bits: int) -> tuple[np.float32, np.float32]:
    """Split a positive number into the sum of two numbers with `bits` bits each."""
    parts = []
    for _ in range(2):
        unit = 2.0 ** (math.floor(math.log2(number)) + 1 - bits)
        parts.append(math.floor(number / unit) * unit)
        number -= parts[-1]
    return np.float32(parts[0]), np.float32(parts[1])


def forward(heading: jax.Array) -> jax.Array:
    """float32[2]: the unit vector (x, y) of a heading."""
    return jnp.stack([jnp.cos(heading), jnp.sin(heading)])


def length(offset: jax.Array) -> jax.Array:
    """float32[...]: the lengths of float32[..., 2] offsets, bit-identical in every program.

    Compilers may or may not round a product before adding it. Here each number is split into
    halves of 12 bits, whose products are exact, so the sum is the same either way.
    """
    upper = lax.bitcast_convert_type(offset, jnp.uint32) & np.uint32(0xFFFFF000)
    high = lax.bitcast_convert_type(upper, jnp.float32)
    low = offset - high

    def dot(one: jax.Array, other: jax.Array) -> jax.Array:
        return one[..., 0] * other[..., 0] + one[..., 1] * other[..., 1]

    return jnp.sqrt(dot(high, high) + (2 * dot(high, low) + dot(low, low)))


def path_tiles(start: jax.Array, end: jax.Array) -> tuple[jax.Array, jax.Array]:
    """int32[2], int32[2]: the tiles (column, row) that a short segment enters.

    A segment shorter than one tile crosses at most one vertical and one horizontal grid line.
    The first result is the tile entered at the first crossing, the second the tile of the end.
    With fewer crossings they are equal, or equal to the tile of the start.
    """
    tile, last = jnp.floor(start), jnp.floor(end)
    crossed = tile != last
    step = end - start
    # Where the segment crosses each line, as a fraction of its length.
    line = jnp.maximum(tile, last)
    when = (line - start) / jnp.where(crossed, step, 1)
    x_first = crossed[0] & (~crossed[1] | (when[0] <= when[1]))
    first = jnp.where(jnp.stack([x_first, ~x_first]), last, tile)
    return first.astype(jnp.int32), last.astype(jnp.int32)


def walk(level: Level, closed: jax.Array, position: jax.Array, step: jax.Array) -> jax.Array:
    """float32[2]: the position after a step, or the old one if something solid is in the way.

    Args:
        level: the level.
        closed: bool[D], which doors are closed.
        position: float32[2], (x, y) in tiles.
        step: float32[2], shorter than one tile: longer ones could jump over walls.
    """
    target = position + step
    first, last = path_tiles(position, target)
    blocked = is_solid(level, closed, first[0], first[1])
    blocked = blocked | is_solid(level, closed, last[0], last[1])
    return jnp.where(blocked, position, target)


def touched_door(
    level: Level, closed: jax.Array, position: jax.Array, reach: jax.Array
) -> jax.Array:
    """bool[D]: the closed door within reach of an arm, if any; never through a wall.

    Args:
        level: the level.
        closed: bool[D], which doors are closed.
        position: float32[2], (x, y) in tiles.
        reach: float32[2], the arm, shorter than one tile.
    """
    first, last = path_tiles(position, position + reach)
    blocked = is_solid(level, closed, first[0], first[1])
    tile = jnp.where(blocked, first, last) + level.margin
    return closed & door_at(level, tile[0], tile[1])
