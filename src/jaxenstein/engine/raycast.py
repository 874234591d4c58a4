"""Casting one ray a column through a level, without a gather a step.

A ray is `forward + right * slope`, so its parameter is the perpendicular depth. The vertical
grid lines x = 0, 1, 2, ... that it crosses are marched apart from the horizontal ones. The
k-th line crossed has its occupancy word in common for all rays of the image, so a ray only
shifts that word by the tile it crosses the line at and looks at one bit. The march goes from
far to near and keeps the last hit, which needs no branch.

Places along a grid line are fixed-point numbers: adding a step and taking the tile are then one
integer operation each. A ray that leaves the map wraps around and may report a hit that is not
there, but always farther away than where it left the map through a solid tile of the other
kind of line, and the nearer hit of the two kinds wins.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jax import lax

from ..pytree import Record, record
from .camera import Camera
from .level import WORD, Level, occupancy

# More lines than this are marched in a loop of blocks of this size, to bound the program.
BLOCK = 64
# Place of the line at hand; number and place of the nearest hit so far.
_March = tuple[jax.Array, jax.Array, jax.Array]
# Crossings count as this much of a tile further on. A ray through a corner then enters the tile
# across it on both kinds of line, whichever way each is rounded, and does not slip between.
NUDGE = 2.0**-16
# A direction component below this never crosses a line inside any map.
PARALLEL = 1e-12


@record
class Hits(Record):
    """What each ray hit; W is the number of image columns.

    Attributes:
        depth: float32[W], perpendicular distance in tiles.
        wall: uint8[W], the entry of `Level.walls` of the face that was hit.
        along: float32[W] in [0, 1), place on the face from its left edge to its right as seen.
        horizontal: bool[W], whether the face looks north or south.
        tile: int32[W, 2], (column, row) of the tile that was hit, without the margin.
    """

    depth: jax.Array
    wall: jax.Array
    along: jax.Array
    horizontal: jax.Array
    tile: jax.Array


def rays(heading: jax.Array, camera: Camera) -> tuple[jax.Array, jax.Array]:
    """float32[W] x and y of the ray through each column's centre, scaled to depth one."""
    slopes = jnp.asarray(camera.column_slopes())
    cos, sin = jnp.cos(heading), jnp.sin(heading)
    return cos - sin * slopes, sin + cos * slopes


def cast(
    position: jax.Array, heading: jax.Array, closed: jax.Array, level: Level, camera: Camera
) -> Hits:
    """Cast the rays of one image.

    Args:
        position: float32[2], (x, y) of the eye in tiles.
        heading: float32[], in radians, 0 along +x, growing clockwise on the map.
        closed: bool[D], which doors are closed.
        level: the level.
        camera: width and field of view of the image.
    """
    columns, rows = occupancy(level, closed)
    # The tile and the place in it apart, so that the margin rounds nothing.
    floor = jnp.floor(position)
    home, inside = floor.astype(jnp.int32) + level.margin, position - floor
    ray_x, ray_y = rays(heading, camera)
    vertical = _march(columns, home, inside, ray_x, ray_y)
    crosswise = _march(rows, home[::-1], inside[::-1], ray_y, ray_x)
    horizontal = crosswise.depth < vertical.depth
    column = jnp.where(horizontal, crosswise.across, vertical.line)
    row = jnp.where(horizontal, crosswise.line, vertical.across)
    column = jnp.clip(column, 0, level.size[0] - 1)
    row = jnp.clip(row, 0, level.size[1] - 1)
    along = jnp.where(horizontal, crosswise.along, vertical.along)
    # Seen from outside, places on the north and east faces run against the axis.
    mirrored = jnp.where(horizontal, ray_y > 0, ray_x < 0)
    return Hits(
        depth=jnp.where(horizontal, crosswise.depth, vertical.depth),
        wall=_face(level, column, row, horizontal, ray_x, ray_y),
        along=jnp.where(mirrored, 1 - along, along),
        horizontal=horizontal,
        tile=jnp.stack([column, row], axis=-1) - level.margin,
    )


def _face(
    level: Level,
    column: jax.Array,
    row: jax.Array,
    horizontal: jax.Array,
    ray_x: jax.Array,
    ray_y: jax.Array,
) -> jax.Array:
    """uint8[W]: the entry of `level.walls` for the faces hit; one gather a column."""
    faces, rows, columns = level.walls.shape
    flat = jnp.asarray(level.walls).reshape(-1)
    index = row * columns + column
    if faces == 4:
        west_east = (ray_x < 0).astype(jnp.int32)
        north_south = 2 + (ray_y < 0).astype(jnp.int32)
        index = index + jnp.where(horizontal, north_south, west_east) * (rows * columns)
    return flat.at[index].get(mode="promise_in_bounds")


@record
class _Crossing(Record):
    """The nearest hit of each ray on grid lines of one kind; named for the vertical ones.

    Attributes:
        depth: float32[W].
        line: int32[W], column entered.
        across: int32[W], row entered.
        along: float32[W] in [0, 1), y within that row.
    """

    depth: jax.Array
    line: jax.Array
    across: jax.Array
    along: jax.Array


def _march(
    words: jax.Array, home: jax.Array, inside: jax.Array, ray: jax.Array, across: jax.Array
) -> _Crossing:
    """March the grid lines of one kind; described here for the vertical ones.

    Args:
        words: uint32[C, words], solid rows of each column.
        home: int32[2], (column, row) of the eye's tile.
        inside: float32[2], (x, y) of the eye within that tile.
        ray: float32[W], x component of each ray.
        across: float32[W], y component.
    """
    lines, n_words = words.shape
    steps = lines - 1
    blocks = -(-steps // BLOCK)
    block = -(-steps // blocks)
    fraction_bits = WORD - 1 - max(lines, n_words * WORD).bit_length()
    one = 2.0**fraction_bits

    home_line = jnp.clip(home[0], 0, lines - 1)
    forwards = ray >= 0
    spacing = 1 / jnp.maximum(jnp.abs(ray), PARALLEL)
    first = jnp.where(forwards, 1 - inside[0], inside[0]) * spacing
    place = inside[1] + first * across + jnp.sign(across) * NUDGE
    place = jnp.floor(place * one).astype(jnp.int32) + (home[1] << fraction_bits)
    stride = jnp.rint(across * spacing * one).astype(jnp.int32)

    order = jnp.arange(blocks * block, dtype=jnp.int32)
    ahead = words.at[jnp.minimum(home_line + 1 + order, lines - 1)].get(mode="promise_in_bounds")
    behind = words.at[jnp.maximum(home_line - 1 - order, 0)].get(mode="promise_in_bounds")

    def visit(k: jax.Array | int, state: _March, far: jax.Array, near: jax.Array) -> _March:
        place, hit, hit_place = state
        tile = lax.shift_right_arithmetic(place, jnp.int32(fraction_bits))
        word = _select_word(jnp.where(forwards[:, None], far[None], near[None]), tile)
        solid = lax.shift_right_logical(word, (tile & (WORD - 1)).astype(jnp.uint32)) & 1
        hit, hit_place = jnp.where(solid != 0, k, hit), jnp.where(solid != 0, place, hit_place)
        return place - stride, hit, hit_place

    def visit_block(i: jax.Array | int, state: _March) -> _March:
        base = (blocks - 1 - i) * block
        far = lax.dynamic_slice_in_dim(ahead, base, block)
        near = lax.dynamic_slice_in_dim(behind, base, block)
        for k in reversed(range(block)):
            state = visit(base + k, state, far[k], near[k])
        return state

    # The place of the hit is kept, not computed again: another rounding could be another tile.
    state: _March = (
        place + stride * (blocks * block - 1),
        jnp.full(ray.shape, steps, jnp.int32),
        place,
    )
    if blocks == 1:
        _, hit, place = visit_block(0, state)
    else:
        _, hit, place = lax.fori_loop(0, blocks, visit_block, state)
    return _Crossing(
        depth=first + hit.astype(jnp.float32) * spacing,
        line=jnp.where(forwards, home_line + 1 + hit, home_line - 1 - hit),
        across=lax.shift_right_arithmetic(place, jnp.int32(fraction_bits)),
        along=(place & (2**fraction_bits - 1)).astype(jnp.float32) / one,
    )


def _select_word(words: jax.Array, tile: jax.Array) -> jax.Array:
    """uint32[W]: the word of `words` [W, n] that holds each tile's bit."""
    word = words[:, 0]
    for i in range(1, words.shape[1]):
        word = jnp.where(tile >= i * WORD, words[:, i], word)
    return word
