"""Sliding along walls, as ZDoom's players do when their way is blocked.

Three corners of the body are traced along the move. The body moves up to the first wall that one
of them meets, and then along it. If that is blocked too, it tries once more, then only along y,
then only along x. A trace only tests the walls in the blocks that it passes, and it meets the
infinite lines through them: a corner may catch on a wall that ends before it.
"""

from __future__ import annotations

import functools
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from ..._jax.batching import varying
from ..._jax.staging import staged
from .collision import (
    BLOCK_BITS,
    BLOCKS,
    EDGE,
    MEMBERS,
    ORDER,
    ORDER_BITS,
    PLACE,
    RADIUS,
    SIGN,
    VISITS,
    WINDOW,
    Geometry,
)
from .fixed import FRACTION_BITS, ONE, divide, multiply, rounded_fraction

ATTEMPTS = 6
"""How many positions a sliding body tries after the first: two in each of two rounds, two later."""
# A body stays away from a wall by this fraction of its move.
_FUDGE = ONE // 32
_HALF = RADIUS * ONE
# The three corners, as signs of the leading corner: that one, and its two neighbours.
_CORNERS = np.array(((1, -1, 1), (1, 1, -1)), np.int32)
_BLOCK = 1 << BLOCK_BITS
# The slope of a coordinate across a border that the trace does not cross: practically parallel.
_PARALLEL = 256 * ONE
# The parts of the keys that order the lines met; see `_nearest`.
_RANK_BITS, _GAP_OFFSET = 3, 16
_KEY_BITS = ORDER_BITS + _RANK_BITS
_TRACE_BITS = 2
_NONE = 2**31 - 1

# A pair of a value for x and a value for y.
Pair = tuple[jax.Array, jax.Array]
# A position, a velocity, the remaining move, whether the body slides, and whether it is done.
_Way = tuple[jax.Array, jax.Array, jax.Array, jax.Array, jax.Array]


def slide(
    geometry: Geometry, position: jax.Array, velocity: jax.Array
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Move a body that cannot continue with its velocity.

    Args:
        geometry: the walls.
        position: int32[2].
        velocity: int32[2], not zero.

    Returns:
        int32[2], the position; int32[2], the velocity before friction; int32[6, 2], the positions
        that the body tried, padded with the final position.
    """
    free = partial(_attempt, geometry)

    def round_(carry: _Way, _: None) -> tuple[_Way, tuple[jax.Array, ...]]:
        position, velocity, move, sliding, stairs = carry
        found, fraction, level = first_wall(geometry, position, move)
        stairs = stairs | (sliding & ~found)
        sliding = sliding & found
        near = jnp.clip(fraction - _FUDGE, 0, ONE)
        first = sliding & (near > 0), position + multiply(move, near)
        position, failed = free(position, *first)
        stairs, sliding = stairs | failed, sliding & ~failed & (fraction < ONE)
        rest = jnp.clip(ONE - fraction, 0, ONE)
        move = jnp.where(sliding, multiply(move, rest), move)
        along = jnp.where(jnp.stack([level, ~level]), move, 0)
        velocity = jnp.where(sliding, along, velocity)
        second = sliding, position + along
        position, sliding = free(position, *second)
        return (position, velocity, move, sliding, stairs), (*first, *second)

    start = position, velocity, velocity, jnp.bool_(True), jnp.bool_(False)
    way, tries = jax.lax.scan(round_, varying(start, start), length=2)
    position, velocity, move, sliding, stairs = way
    third = sliding | stairs, position.at[1].add(move[1])
    position, failed = free(position, *third)
    fourth = failed, position.at[0].add(move[0])
    position, _ = free(position, *fourth)
    wanted = jnp.concatenate([tries[0], tries[2], jnp.stack([third[0], fourth[0]])])
    places = jnp.concatenate([tries[1], tries[3], jnp.stack([third[1], fourth[1]])])
    return position, velocity, jnp.where(wanted[:, None], places, position[None])


def _attempt(
    geometry: Geometry, position: jax.Array, wanted: jax.Array, target: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """The target if it is wanted and free, else the position; and whether it was not free."""
    blocked = geometry.blocked(target)
    return jnp.where(wanted & ~blocked, target, position), wanted & blocked


def first_wall(
    geometry: Geometry, position: jax.Array, move: jax.Array
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """The first wall that a corner of a body meets on a move.

    Returns:
        bool[], whether there is one; int32[], the fraction of the move up to it, 0 to `ONE`;
        bool[], whether it runs east and west.
    """
    start, end, block, visited = staged(partial(_traces, geometry))(position, move)
    table = jnp.asarray(geometry.windows.reshape(-1, *geometry.windows.shape[2:]))
    window = table.at[block].get(mode="promise_in_bounds")
    keys = [_nearest(window[i], position[i], start[i], end[i], visited) for i in (0, 1)]
    best = jnp.minimum(*(jnp.min(_by_fraction(*keys[i], axis=i)) for i in (0, 1)))
    return best != _NONE, best >> (_KEY_BITS + _TRACE_BITS + 1), best & 1 == 1


def _traces(
    geometry: Geometry, position: jax.Array, move: jax.Array
) -> tuple[Pair, Pair, jax.Array, jax.Array]:
    """The three traces: starts and ends int32[3], window, blocks visited (see `_visited`)."""
    start, end, begin, stop, first = [], [], [], [], []
    for i, origin in enumerate(geometry.origin):
        lead = jnp.where(move[i] > 0, jnp.int32(_HALF), jnp.int32(-_HALF))
        corner = position[i] + lead * _CORNERS[i]
        end.append(corner + move[i])
        # The game moves the start of a trace off the border of a block.
        on_border = (corner - origin) & (_BLOCK - 1) == 0
        start.append(corner + jnp.where(on_border, jnp.int32(ONE), 0))
        begin.append(start[i] - origin)
        stop.append(end[i] - origin)
        least = jnp.min(jnp.minimum(begin[i], stop[i])) >> BLOCK_BITS
        first.append(jnp.clip(least, 0, geometry.windows.shape[i] - 1))
    visited = _visited((begin[0], begin[1]), (stop[0], stop[1]), (first[0], first[1]))
    block = first[0] * geometry.windows.shape[1] + first[1]
    return (start[0], start[1]), (end[0], end[1]), block, visited


def _nearest(
    walls: jax.Array, centre: jax.Array, start: jax.Array, end: jax.Array, visited: jax.Array
) -> Pair:
    """The first walls that the three traces meet, among those that share one coordinate.

    Args:
        walls: int32[5, L], one kind of wall in a window of `Geometry.windows`.
        centre: int32[], the body's coordinate.
        start: int32[3], the coordinate of each trace's start.
        end: int32[3], the coordinate of each trace's end.
        visited: int32[3], the blocks of the window that each trace visits; see `_visited`.

    Returns:
        int32[3], keys, lowest for the first wall, or `_NONE`; int32[3], the lengths of the traces.
        A key contains the distance to the wall, then the index of the first visited block with the
        wall, then the wall's number: the game orders walls by these.
    """
    sign, edge, place, members, order = (
        walls[i][None] for i in (SIGN, EDGE, PLACE, MEMBERS, ORDER)
    )
    behind = [value[:, None] * sign >= edge for value in (start, end, centre[None])]
    way = end - start
    length = jnp.abs(way)[:, None]
    gap = (place - start[:, None]) * jnp.sign(way)[:, None]
    seen = members & visited[:, None]
    later = [seen & ((1 << BLOCKS * i) - 1) == 0 for i in range(1, VISITS)]
    rank = functools.reduce(jnp.add, (none.astype(jnp.int32) for none in later))
    # Fractions that round to 0 or to the whole move count as well.
    slack = length >> 17
    met = (behind[0] != behind[1]) & ~behind[2] & (seen != 0)
    met = met & (gap >= -slack) & (gap <= length + slack)
    key = (gap + _GAP_OFFSET) << _KEY_BITS | rank << ORDER_BITS | order
    return jnp.min(jnp.where(met, key, _NONE), axis=1), jnp.abs(way)


def _by_fraction(key: jax.Array, length: jax.Array, *, axis: int) -> jax.Array:
    """int32[3]: keys of `_nearest` with the distance as a fraction, the trace, and the kind."""
    gap = jnp.clip((key >> _KEY_BITS) - _GAP_OFFSET, 0, length)
    fraction = rounded_fraction(gap, jnp.maximum(length, 1))
    trace = np.arange(len(_CORNERS[0]), dtype=np.int32)
    low = (trace << _KEY_BITS) | (key & ((1 << _KEY_BITS) - 1))
    full = (fraction << (_KEY_BITS + _TRACE_BITS)) | low
    return jnp.where(key == _NONE, _NONE, (full << 1) | axis)


def _visited(start: Pair, end: Pair, corner: Pair) -> jax.Array:
    """int32[3]: the blocks that traces visit, in order, four bits each; see `Geometry`.

    This is the game's way of stepping from block to block, with its rounding: the first block,
    both neighbours if the trace leaves through their common corner, the next one, the last one.

    Args:
        start: int32[3], x and y of the traces' starts, from the map's origin.
        end: int32[3], x and y of their ends, less than a block away.
        corner: int32[], column and row of the first block of the window.
    """
    here = [value >> BLOCK_BITS for value in start]
    step = [(value >> BLOCK_BITS) - at for value, at in zip(end, here, strict=True)]
    way = [b - a for a, b in zip(start, end, strict=True)]
    place = [value >> (BLOCK_BITS - FRACTION_BITS) for value in start]
    part = [_to_border(place[i], step[i]) for i in (0, 1)]
    # The slope of each coordinate over a block of the other, and its value at the first border.
    slope = [
        jnp.where(step[1 - i] == 0, jnp.int32(_PARALLEL), divide(way[i], jnp.abs(way[1 - i])))
        for i in (0, 1)
    ]
    diagonal = _diagonal(slope, part)
    cut = [
        jnp.where(diagonal, here[i] << FRACTION_BITS, place[i] + multiply(slope[i], part[1 - i]))
        for i in (0, 1)
    ]
    # If the value is still in its block, the trace continues into the next block of the other axis.
    through = [cut[i] >> FRACTION_BITS == here[i] for i in (0, 1)]
    leaves = (step[0] != 0) | (step[1] != 0)
    both, either = through[0] & through[1] & leaves, (through[0] | through[1]) & leaves
    second = [here[i] + jnp.where(through[1 - i], step[i], 0) for i in (0, 1)]
    # After a step along one axis, the other must continue.
    later = [
        (cut[i] + jnp.where(through[i], slope[i], 0)) >> FRACTION_BITS == second[i] for i in (0, 1)
    ]
    goes_on = either & jnp.where(through[0], later[1], later[0])
    goal = [here[i] + step[i] for i in (0, 1)]
    goes_on = goes_on & ((second[0] != goal[0]) | (second[1] != goal[1]))

    def bits(column: jax.Array, row: jax.Array, valid: jax.Array | bool = True) -> jax.Array:
        x, y = column - corner[0], row - corner[1]
        known = (x >= 0) & (x < WINDOW) & (y >= 0) & (y < WINDOW) & valid
        return jnp.where(known, 1 << (x + WINDOW * y), 0)

    visits = (
        bits(here[0], here[1]),
        bits(here[0] + step[0], here[1], both),
        bits(here[0], here[1] + step[1], both),
        bits(second[0], second[1], either),
        bits(goal[0], goal[1], goes_on),
    )
    return functools.reduce(jnp.bitwise_or, (v << BLOCKS * i for i, v in enumerate(visits)))


def _to_border(place: jax.Array, step: jax.Array) -> jax.Array:
    """int32: the distance, within a block, to the border that a trace crosses, if it does."""
    inside = place & (ONE - 1)
    return jnp.where(step > 0, ONE - inside, jnp.where(step < 0, inside, jnp.int32(ONE)))


def _diagonal(slope: list[jax.Array], part: list[jax.Array]) -> jax.Array:
    """bool: whether a trace at 45 degrees passes exactly through a corner of a block."""
    steep = (jnp.abs(slope[0]) == ONE) & (jnp.abs(slope[1]) == ONE)
    turned = [jnp.where(slope[1 - i] < 0, ONE - part[i], part[i]) for i in (0, 1)]
    return steep & (turned[0] == turned[1])
