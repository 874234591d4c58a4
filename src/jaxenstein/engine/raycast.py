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

The rays are aimed, marched and looked up in three stages (see `fusion`): every result of a stage
that used a march directly would repeat it, and a place rounded twice might be two tiles.
"""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
from jax import lax

from ..batching import varying
from ..pytree import PyTreeNode, static
from .camera import Camera
from .fusion import staged
from .level import WORD, Level, occupancy

# More lines than this are marched in a loop of blocks of this size, to bound the program; in
# smaller ones where a line has more than two words, which makes each line dearer to compile.
BLOCK = 64
SMALL_BLOCK = 16
# A direction component below this never crosses a line inside any map.
PARALLEL = 1e-12
# What a ray enters is looked up for one so much of a tile beside it. A ray through a corner then
# passes it on one side for both kinds of line, whichever way each is rounded: it slips neither
# through the tile across nor between two that touch there. Where it hits a face counts as so much
# further on.
NUDGE = 2.0**-16
# On a line that is met at a small angle the ray beside is this many times as far off at most.
SLANT = 64.0


class Hits(PyTreeNode):
    """What each ray hit; W is the number of image columns.

    Attributes:
        depth: float32[W], perpendicular distance in tiles.
        wall: uint8[W], the entry of `Level.walls` of the face that was hit.
        along: float32[W] in [0, 1], place on the face from its left edge to its right as seen.
        horizontal: bool[W], whether the face looks north or south.
        tile: int32[W, 2], (column, row) of the tile that was hit, without the margin.
    """

    depth: jax.Array
    wall: jax.Array
    along: jax.Array
    horizontal: jax.Array
    tile: jax.Array


class Aim(PyTreeNode):
    """Each ray on its way to the grid lines of one kind; named for the vertical ones.

    Attributes:
        first: float32[W], depth of the first line.
        spacing: float32[W], depth from one line to the next.
        place: int32[W], y at the first line of the ray beside it, in fixed point.
        shift: int32[W], from there to the ray's own place.
        stride: int32[W], y from one line to the next.
        forwards: bool[W], whether x grows along the ray.
        home: int32[], column of the eye.
        ahead: int32[K, words], bits of the solid rows of the columns entered by rays that go
            forwards.
        behind: int32[K, words], the same for the others.
        fraction_bits: bits of a place after the point.
    """

    first: jax.Array
    spacing: jax.Array
    place: jax.Array
    shift: jax.Array
    stride: jax.Array
    forwards: jax.Array
    home: jax.Array
    ahead: jax.Array
    behind: jax.Array
    fraction_bits: int = static()


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
    aims = staged(partial(aim, camera=camera))(position, heading, closed, level)
    return look_up(aims, staged(march)(aims), level)


def aim(
    position: jax.Array, heading: jax.Array, closed: jax.Array, level: Level, camera: Camera
) -> tuple[Aim, Aim]:
    """Aim the rays at the vertical and at the horizontal lines."""
    columns, rows = occupancy(level, closed)
    # The tile and the place in it apart, so that the margin rounds nothing.
    floor = jnp.floor(position)
    home, inside = floor.astype(jnp.int32) + level.margin, position - floor
    ray_x, ray_y = rays(heading, camera)
    # Towards the centre of the eye's tile, or the ray beside might begin beyond a line.
    centre = 0.5 - inside
    left = ray_x * centre[1] < ray_y * centre[0]
    side = jnp.where(left, jnp.float32(-NUDGE), jnp.float32(NUDGE))
    vertical = _aim_at_lines(columns, home, inside, ray_x, ray_y, side)
    return vertical, _aim_at_lines(rows, home[::-1], inside[::-1], ray_y, ray_x, -side)


def _aim_at_lines(
    words: jax.Array,
    home: jax.Array,
    inside: jax.Array,
    ray: jax.Array,
    across: jax.Array,
    side: jax.Array,
) -> Aim:
    """Aim at the lines of one kind; described here for the vertical ones.

    Args:
        words: uint32[C, words], solid rows of each column.
        home: int32[2], (column, row) of the eye's tile.
        inside: float32[2], (x, y) of the eye within that tile.
        ray: float32[W], x component of each ray.
        across: float32[W], y component.
        side: float32[W], how far the ray beside is on the side where y grows for who looks along x.
    """
    lines, n_words = words.shape
    fraction_bits = WORD - 1 - max(lines, n_words * WORD).bit_length()
    one = 2.0**fraction_bits
    forwards = ray >= 0
    spacing = 1 / jnp.maximum(jnp.abs(ray), PARALLEL)
    first = jnp.where(forwards, 1 - inside[0], inside[0]) * spacing
    onwards = jnp.sign(across) * NUDGE
    place = jnp.floor((inside[1] + first * across + onwards) * one).astype(jnp.int32)
    aside = jnp.where(forwards, side, -side) * jnp.minimum(spacing, SLANT)
    shift = ((onwards - aside) * one).astype(jnp.int32)
    words = lax.bitcast_convert_type(words, jnp.int32)
    column = jnp.clip(home[0], 0, lines - 1)
    order = jnp.arange(lines - 1, dtype=jnp.int32)
    ahead, behind = jnp.minimum(column + 1 + order, lines - 1), jnp.maximum(column - 1 - order, 0)
    return Aim(
        first=first,
        spacing=spacing,
        place=place - shift + (home[1] << fraction_bits),
        shift=shift,
        stride=jnp.rint(across * spacing * one).astype(jnp.int32),
        forwards=forwards,
        home=column,
        ahead=words.at[ahead].get(mode="promise_in_bounds"),
        behind=words.at[behind].get(mode="promise_in_bounds"),
        fraction_bits=fraction_bits,
    )


def march(aims: tuple[Aim, Aim]) -> tuple[jax.Array, jax.Array]:
    """int32[W] twice: how many lines of each kind a ray crosses before the one it hits."""
    return _march(aims[0]), _march(aims[1])


def _march(aim: Aim) -> jax.Array:
    """int32[W]: how many lines each ray crosses before the one at which it hits."""
    steps, words = aim.ahead.shape
    most = BLOCK if words <= 2 else SMALL_BLOCK
    if steps <= most:
        hit = jnp.full(aim.place.shape, steps, jnp.int32)
        return _march_block(aim, aim.ahead, aim.behind, jnp.int32(0), hit)
    blocks = -(-steps // most)
    size = -(-steps // blocks)
    filler = ((0, blocks * size - steps), (0, 0))
    ahead, behind = jnp.pad(aim.ahead, filler), jnp.pad(aim.behind, filler)

    def visit(i: jax.Array, hit: jax.Array) -> jax.Array:
        base = (blocks - 1 - i) * size
        far = lax.dynamic_slice_in_dim(ahead, base, size)
        near = lax.dynamic_slice_in_dim(behind, base, size)
        return _march_block(aim, far, near, base, hit)

    return lax.fori_loop(
        0, blocks, visit, varying(jnp.full(aim.place.shape, steps, jnp.int32), aim)
    )


def _march_block(
    aim: Aim, ahead: jax.Array, behind: jax.Array, base: jax.Array, hit: jax.Array
) -> jax.Array:
    """`hit` after the lines from `base` on, the farthest first, one for each pair of words."""
    steps = ahead.shape[0]
    # The complement of a place has that of its tile, by which the tile's bit becomes a word's sign.
    place = ~(aim.place + aim.stride * (base + steps - 1))
    for k in reversed(range(steps)):
        tile = lax.shift_right_arithmetic(place, jnp.int32(aim.fraction_bits))
        bit = tile & (WORD - 1)
        solid = lax.shift_left(_word(aim, ahead[k], behind[k], tile), bit) < 0
        hit = jnp.where(solid, base + k, hit)
        place = place + aim.stride
    return hit


def _word(aim: Aim, ahead: jax.Array, behind: jax.Array, tile: jax.Array) -> jax.Array:
    """int32[W]: of the words of one line, int32[words] each way, the one with the tile's bit.

    `tile` is the complement of the tile's number.
    """
    word = jnp.where(aim.forwards, ahead[0], behind[0])
    for i in range(1, ahead.shape[0]):
        word = jnp.where(tile < -i * WORD, jnp.where(aim.forwards, ahead[i], behind[i]), word)
    return word


def look_up(aims: tuple[Aim, Aim], hits: tuple[jax.Array, jax.Array], level: Level) -> Hits:
    """What the rays hit at the nearer of the two lines that the marches found."""
    vertical, crosswise = aims
    depths = [
        aim.first + hit.astype(jnp.float32) * aim.spacing
        for aim, hit in zip(aims, hits, strict=True)
    ]
    lines = [
        aim.home + jnp.where(aim.forwards, 1 + hit, -1 - hit)
        for aim, hit in zip(aims, hits, strict=True)
    ]
    places = [aim.place + aim.stride * hit for aim, hit in zip(aims, hits, strict=True)]
    horizontal = depths[1] < depths[0]
    place = jnp.where(horizontal, places[1], places[0])
    shift = jnp.where(horizontal, crosswise.shift, vertical.shift)
    bits = jnp.where(
        horizontal, jnp.int32(crosswise.fraction_bits), jnp.int32(vertical.fraction_bits)
    )
    across = lax.shift_right_arithmetic(place, bits)
    column = jnp.clip(jnp.where(horizontal, across, lines[0]), 0, level.size[0] - 1)
    row = jnp.clip(jnp.where(horizontal, lines[1], across), 0, level.size[1] - 1)
    one = 1 << bits
    within = jnp.clip(place + shift - (across << bits), 0, one)
    along = within.astype(jnp.float32) / one.astype(jnp.float32)
    # Seen from outside, places on the north and east faces run against the axis.
    mirrored = jnp.where(horizontal, crosswise.forwards, ~vertical.forwards)
    return Hits(
        depth=jnp.where(horizontal, depths[1], depths[0]),
        wall=_face(aims, level, column, row, horizontal),
        along=jnp.where(mirrored, 1 - along, along),
        horizontal=horizontal,
        tile=jnp.stack([column, row], axis=-1) - level.margin,
    )


def _face(
    aims: tuple[Aim, Aim],
    level: Level,
    column: jax.Array,
    row: jax.Array,
    horizontal: jax.Array,
) -> jax.Array:
    """uint8[W]: the entry of `level.walls` for the faces hit; one gather a column."""
    faces, rows, columns = level.walls.shape
    flat = jnp.asarray(level.walls).reshape(-1)
    index = row * columns + column
    if faces == 4:
        west_or_east = jnp.where(aims[0].forwards, jnp.int32(0), jnp.int32(1))
        north_or_south = jnp.where(aims[1].forwards, jnp.int32(2), jnp.int32(3))
        index = index + jnp.where(horizontal, north_or_south, west_or_east) * (rows * columns)
    return flat.at[index].get(mode="promise_in_bounds")
