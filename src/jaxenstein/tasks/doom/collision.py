"""Collisions of bodies, bullets and lines of sight: walls as tables and segments, boxes, and rays.

Positions are int32 map units (16.16). A body is a box with sides along the axes. Distances along
rays are float32 map units. Rays meet boxes and segments exactly, without sampling.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np

from ..._jax.batching import varying
from .fixed import ONE, direction
from .maps import THING_RADIUS, Line, ends_of, load_map

RADIUS = 16
"""Half the side of the player's box in map units."""
REACH = RADIUS + THING_RADIUS
"""Along both axes, the player touches things that are nearer than this, in map units."""
CELL_BITS = 20
BLOCK_BITS = 23
"""The bits of the width, in 16.16, of a cell here, and of a block of the game's index of lines."""
ORDER_BITS = 7
"""The bits of the number of a wall in its window."""
LATTICE = 1 << (CELL_BITS - 16)
# A body overlaps at most 2 by 2 blocks with everything that it may touch in a tic: a window.
WINDOW = 2
BLOCKS = WINDOW**2
# The most blocks that a trace visits; a set of blocks times this is repeated for each visit.
VISITS = 5
_EACH_VISIT = sum(1 << BLOCKS * i for i in range(VISITS))
# Indices into the third axis of `Geometry.windows`.
SIGN, EDGE, PLACE, MEMBERS, ORDER = range(5)
_NEVER = 2**31 - 1
# A ray with a component below this runs along an axis.
_PARALLEL = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class Geometry:
    """The walls of a map as tables on the host; constants of a program.

    Attributes:
        origin: int32[2], west and south end of the map, 16.16 map units.
        cells: uint8[n, m], whether the box of a body whose centre is in a cell (x, y) overlaps a
            wall: bit 0 inside the cell, 1 on its west edge, 2 on its south edge, 3 on both.
        windows: int32[columns, rows, 2, 5, L], the walls of the window of 2 by 2 blocks that
            starts at each block: first the walls with a single x (running north and south), then
            those with a single y. A coordinate is behind the wall if `SIGN` times it is at least
            `EDGE`; the wall is at `PLACE`. Bit i + 2 j of `MEMBERS` says whether block (i, j) of
            the window contains it, repeated five times at intervals of 4 bits. `ORDER` is its
            number in the window. With fewer than L walls, nothing is ever behind the last entries.
    """

    origin: np.ndarray
    cells: np.ndarray
    windows: np.ndarray

    def blocked(self, position: jax.Array) -> jax.Array:
        """bool: whether the body's box overlaps a wall at a position int32[2]."""
        place = position - self.origin
        column, row = (
            jnp.clip(place[i] >> CELL_BITS, 0, size - 1) for i, size in enumerate(self.cells.shape)
        )
        on_edge = (place & ((1 << CELL_BITS) - 1)) == 0
        bit = on_edge[0].astype(jnp.uint8) + 2 * on_edge[1].astype(jnp.uint8)
        flat = jnp.asarray(self.cells.reshape(-1))
        code = flat.at[column * self.cells.shape[1] + row].get(mode="promise_in_bounds")
        return (code >> bit) & 1 == 1


@functools.cache
def load_geometry(name: str) -> Geometry:
    """The tables of a map in `maps/`."""
    return build_geometry(load_map(name).walls)


def build_geometry(walls: Sequence[Line]) -> Geometry:
    """The tables of walls on a lattice of 16 map units.

    Raises:
        ValueError: a wall is not on the lattice.
    """
    ends = ends_of(walls)
    if (ends % LATTICE).any():
        raise ValueError(f"walls must be on a lattice of {LATTICE} map units")
    low, high = ends.min(axis=(0, 1)), ends.max(axis=(0, 1))
    return Geometry(
        origin=(low * ONE).astype(np.int32),
        cells=_cells(ends, low, high),
        windows=_windows(ends, low, high),
    )


def _cells(ends: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Build `Geometry.cells`; half cells represent the interiors."""
    least, most = ends.min(axis=1), ends.max(axis=1)
    counts = (high - low) // LATTICE + 1
    axes = [low[i] + np.arange(2 * counts[i]) * (LATTICE / 2) for i in (0, 1)]
    # Strictly between the ends, for each wall and coordinate: bool[walls, 2 * count].
    near = [
        (axis[None] < most[:, i, None] + RADIUS) & (axis[None] > least[:, i, None] - RADIUS)
        for i, axis in enumerate(axes)
    ]
    hit = np.einsum("wx,wy->xy", near[0].astype(np.int32), near[1].astype(np.int32)) > 0
    edges = hit.reshape(counts[0], 2, counts[1], 2)
    inside, west, south, both = (edges[:, 1 - i, :, 1 - j] for j in (0, 1) for i in (0, 1))
    return (inside + 2 * west + 4 * south + 8 * both).astype(np.uint8)


def _windows(ends: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Build `Geometry.windows`."""
    shift = BLOCK_BITS - 16
    first, last = (ends.min(axis=1) - low) >> shift, (ends.max(axis=1) - low) >> shift
    counts = ((high - low) >> shift) + 1
    steps = np.arange(WINDOW)
    # Whether each wall is in a window's blocks, for each coordinate: int[walls, count, WINDOW].
    near = []
    for i in (0, 1):
        blocks = np.arange(counts[i])[:, None] + steps
        within = (first[:, i, None, None] <= blocks) & (blocks <= last[:, i, None, None])
        near.append(within.astype(int))
    members = np.einsum("wci,wrj,ij->crw", *near, 1 << (steps[:, None] + WINDOW * steps))
    lists: dict[tuple[int, int, int], list[list[int]]] = {}
    # The place of each wall among those of its window.
    order = np.cumsum(members > 0, axis=-1) - 1
    assert order.max() < 1 << ORDER_BITS
    for column, row, number in np.argwhere(members).tolist():
        line, index = ends[number], (column, row, number)
        axis = int(line[0, 0] != line[1, 0])
        entry = [*_side(line, axis), int(members[index]) * _EACH_VISIT, int(order[index])]
        lists.setdefault((column, row, axis), []).append(entry)
    longest = max(map(len, lists.values()))
    table = np.zeros((*counts, 2, longest, 5), np.int32)
    table[..., EDGE] = _NEVER
    for place, entries in lists.items():
        table[place][: len(entries)] = entries
    return np.ascontiguousarray(np.swapaxes(table, -1, -2))


def _side(line: np.ndarray, axis: int) -> tuple[int, int, int]:
    """(sign, edge, place) of a wall whose points share the coordinate `axis`.

    In the game, a point is behind a wall if a 64-bit product reaches 2**32. This is so from a
    certain distance on, a fraction of a map unit that depends on the wall's length.
    """
    run = int(line[1, 1 - axis] - line[0, 1 - axis])
    # Walls that go north have their back in the west, walls that go east in the north.
    sign = -1 if (run > 0) == (axis == 0) else 1
    place = int(line[0, axis]) * ONE
    slack = -(-(1 << 32) // (abs(run) * ONE))
    return sign, sign * place + slack, place


def segments(walls: Sequence[Line]) -> np.ndarray:
    """float32[L, 4]: walls as x0, y0, x1, y1 in map units."""
    return ends_of(walls).reshape(-1, 4).astype(np.float32)


def along(angle: jax.Array) -> jax.Array:
    """float32[..., 2]: the unit vector of an angle (uint32), from Doom's table."""
    return jnp.stack(direction(angle), axis=-1).astype(jnp.float32) * jnp.float32(1 / ONE)


def bearing(offset: jax.Array) -> jax.Array:
    """int32[...]: the angle of int32[..., 2], 2**32 per turn, about as exact as float32."""
    x, y = offset[..., 0].astype(jnp.float32), offset[..., 1].astype(jnp.float32)
    return (jnp.arctan2(y, x) * jnp.float32(2**22 / math.pi)).astype(jnp.int32) << 9


def offsets(origin: jax.Array, places: jax.Array) -> jax.Array:
    """float32[..., 2]: the offset from int32[..., 2] to int32[..., 2], in map units."""
    rank = max(origin.ndim, places.ndim)
    way = ranked(places, rank) - ranked(origin, rank)
    return way.astype(jnp.float32) * jnp.float32(1 / ONE)


def way_to(origin: jax.Array, places: jax.Array) -> jax.Array:
    """float32[..., 2]: the unit vector from int32[..., 2] to int32[..., 2]."""
    way = offsets(origin, places)
    return way / jnp.maximum(jnp.sqrt(jnp.sum(way**2, axis=-1, keepdims=True)), 1)


def to_boxes(offset: jax.Array, ray: jax.Array, half_width: jax.Array | np.ndarray) -> jax.Array:
    """float32[...]: the distance along a ray to a box, `inf` if the ray misses it.

    A ray that only touches a side hits, as in the game.

    Args:
        offset: float32[..., 2], from the ray's origin to the box's centre.
        ray: float32[..., 2], its direction.
        half_width: float32[...], of the box.
    """
    parallel = jnp.abs(ray) < _PARALLEL
    safe = jnp.where(parallel, jnp.float32(1), ray)
    sides = ranked(jnp.asarray(half_width, jnp.float32)[..., None], offset.ndim)
    one, other = (offset - sides) / safe, (offset + sides) / safe
    beside = jnp.where(jnp.abs(offset) <= sides, -jnp.inf, jnp.inf)
    enters = jnp.max(jnp.where(parallel, beside, jnp.minimum(one, other)), axis=-1)
    leaves = jnp.min(jnp.where(parallel, jnp.inf, jnp.maximum(one, other)), axis=-1)
    return jnp.where((enters <= leaves) & (leaves >= 0), jnp.maximum(enters, 0), jnp.inf)


def to_walls(origin: jax.Array, ray: jax.Array, walls: np.ndarray) -> jax.Array:
    """float32[...]: the distance along rays to the first wall, `inf` if there is none.

    Args:
        origin: int32[..., 2].
        ray: float32[..., 2].
        walls: float32[L, 4] of `segments`.
    """
    if not len(walls):
        return jnp.full(ray.shape[:-1], jnp.inf, jnp.float32)
    first, way = walls[:, :2], walls[:, 2:] - walls[:, :2]
    rank = ray.ndim + 1
    first, way = ranked(jnp.asarray(first), rank), ranked(jnp.asarray(way), rank)
    gap = first - offsets(jnp.zeros_like(origin), origin)[..., None, :]
    turn = _cross(ray[..., None, :], way)
    safe = jnp.where(turn == 0, jnp.float32(1), turn)
    distance = _cross(gap, way) / safe
    part = _cross(gap, ray[..., None, :]) / safe
    met = (turn != 0) & (distance >= 0) & (part >= 0) & (part <= 1)
    return jnp.min(jnp.where(met, distance, jnp.inf), axis=-1)


def is_seen(origin: jax.Array, target: jax.Array, walls: np.ndarray) -> jax.Array:
    """bool[...]: whether no wall is between positions int32[..., 2]."""
    return to_walls(origin, offsets(origin, target), walls) > 1


def first_body(
    origin: jax.Array,
    ray: jax.Array,
    places: jax.Array,
    half_widths: np.ndarray,
    there: jax.Array,
    walls: np.ndarray,
    reach: float | np.ndarray = np.inf,
) -> jax.Array:
    """bool[..., N]: the body that each ray hits first; all False if none, or if a wall is first.

    Args:
        origin: int32[..., 2].
        ray: float32[..., 2], of length 1.
        places: int32[N, 2], positions of the bodies.
        half_widths: float32[N].
        there: bool[..., N], which bodies can be hit.
        walls: float32[L, 4], walls that stop rays.
        reach: the length of the rays.
    """
    offset = offsets(origin[..., None, :], places)
    distance = to_boxes(offset, ray[..., None, :], half_widths)
    limit = to_walls(origin, ray, walls)
    limit = jnp.minimum(limit, ranked(jnp.asarray(reach, jnp.float32), limit.ndim))
    there = ranked(there, distance.ndim)
    distance = jnp.where(there & (distance <= limit[..., None]), distance, jnp.inf)
    nearest = jnp.argmin(distance, axis=-1)
    index = ranked(jnp.arange(places.shape[0]), distance.ndim)
    return (index == nearest[..., None]) & (distance < jnp.inf)


def ranked(values: jax.Array, rank: int) -> jax.Array:
    """The values with `rank` axes; new axes are leading."""
    return values.reshape((1,) * (rank - values.ndim) + values.shape)


def _cross(a: jax.Array, b: jax.Array) -> jax.Array:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def overlap(
    place: jax.Array,
    half_width: jax.Array | np.ndarray | int,
    others: jax.Array,
    half_widths: jax.Array | np.ndarray | int,
) -> jax.Array:
    """bool[...]: whether boxes overlap; boxes that touch do not.

    Args:
        place: int32[..., 2], the centre of a box, map units in 16.16.
        half_width: int32[...], its half-width in map units.
        others: int32[..., 2], the centre of the other box.
        half_widths: int32[...], its half-width.
    """
    gap = place - others
    reach = ranked(jnp.asarray(half_width + half_widths) * ONE, gap.ndim - 1)
    return jnp.all(jnp.abs(gap) < reach[..., None], axis=-1)


def crosses(place: jax.Array, half_width: jax.Array | np.ndarray, walls: np.ndarray) -> jax.Array:
    """bool[...]: whether a box crosses a wall; touching one is allowed.

    Args:
        place: int32[..., 2], the centre of the box.
        half_width: float32[...], in map units.
        walls: float32[L, 4], from `segments`.
    """
    if not len(walls):
        return jnp.zeros(place.shape[:-1], bool)
    # Flattened, because this vectorises even if the last axis is short.
    shape = place.shape[:-1]
    x, y = (place[..., i].reshape(-1).astype(jnp.float32) * jnp.float32(1 / ONE) for i in (0, 1))
    side = ranked(jnp.asarray(half_width, jnp.float32), len(shape))
    side = jnp.broadcast_to(side, shape).reshape(-1)
    table = jnp.asarray(walls)

    # One wall after another: a reduction along a short axis takes several times as long.
    def visit(i: jax.Array, found: jax.Array) -> jax.Array:
        x0, y0, x1, y1 = table[i]
        near_x = (x + side > jnp.minimum(x0, x1)) & (x - side < jnp.maximum(x0, x1))
        near_y = (y + side > jnp.minimum(y0, y1)) & (y - side < jnp.maximum(y0, y1))
        way_x, way_y = x1 - x0, y1 - y0
        beside = jnp.abs((x - x0) * way_y - (y - y0) * way_x)
        return found | (near_x & near_y & (beside < side * (jnp.abs(way_x) + jnp.abs(way_y))))

    none = varying(jnp.zeros(x.shape, bool), place, side)
    return jax.lax.fori_loop(0, len(walls), visit, none).reshape(shape)
