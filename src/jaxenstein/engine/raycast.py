"""Ray casting: one ray per column through a level, without a gather per step.

A ray is `forward + right * slope`, so its parameter is the perpendicular depth. The vertical grid
lines x = 0, 1, 2, ... are marched separately from the horizontal ones. All rays of the image share
the occupancy word of the k-th line, so a ray only shifts that word by the tile where it crosses
the line, and tests one bit. The march goes from far to near and keeps the last hit, which needs no
branch. If the map is a constant of the program, only lines with a wall face are tested, in the
same order for every position of the eye.

Places along a grid line are fixed-point numbers, so that adding a step and finding the tile are
one integer operation each. A ray that leaves the map wraps around and may report a false hit. But
it has left the map through a solid tile of the other kind of line, which is nearer, and the nearer
hit of the two kinds wins.

Aiming, marching and looking up are three stages (see `staging`). Otherwise the compiler would
repeat the march in everything that uses it, and a place that is rounded twice might be in two
different tiles.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from .._jax.batching import varying
from .._jax.staging import staged
from ..pytree import PyTreeNode, static
from .camera import Camera
from .free_walls import meet
from .hits import Hits
from .level import WORD, Level, occupancy
from .lines import Crossed, Fixed, crossed, fixed_lines, shut

# More lines than this are marched in a loop over blocks of this size, to bound the program. Blocks
# are smaller if a line has more than two words, because such lines take longer to compile.
BLOCK = 64
SMALL_BLOCK = 16
# A ray with a direction component below this never crosses a line inside any map.
PARALLEL = 1e-12
# Which tile a ray enters is looked up this fraction of a tile beside the ray. A ray through a
# corner then passes it on the same side for both kinds of line, however each is rounded: it can
# neither slip through the tile opposite nor between two tiles that touch there. The place of a hit
# on a face is shifted by as much.
NUDGE = 2.0**-16
# On a line met at a small angle, that shift is at most this many times as large.
SLANT = 64.0


class Aim(PyTreeNode):
    """The rays relative to the grid lines of one kind; names describe the vertical lines.

    Attributes:
        first: float32[W], depth of the first line.
        spacing: float32[W], depth from one line to the next.
        place: int32[W], y at the first line of the shifted ray, in fixed point.
        shift: int32[W], from there to the place of the ray itself.
        stride: int32[W], y from one line to the next.
        forwards: bool[W], whether x grows along the ray.
        home: int32[], column of the eye.
        lines: the lines to test.
        fraction_bits: the number of fractional bits of a place.
    """

    first: jax.Array
    spacing: jax.Array
    place: jax.Array
    shift: jax.Array
    stride: jax.Array
    forwards: jax.Array
    home: jax.Array
    lines: Crossed | Fixed
    fraction_bits: int = static()


def direction(heading: jax.Array) -> tuple[jax.Array, jax.Array]:
    """float32[] twice: cosine and sine of a heading (see `scene.Scene`)."""
    if heading.ndim:
        return heading[0], heading[1]
    return jnp.cos(heading), jnp.sin(heading)


def rays(heading: jax.Array, camera: Camera) -> tuple[jax.Array, jax.Array]:
    """float32[W] x and y of the ray through each column, scaled to depth 1."""
    slopes = jnp.asarray(camera.column_slopes())
    cos, sin = direction(heading)
    return cos - sin * slopes, sin + cos * slopes


def cast(
    position: jax.Array,
    heading: jax.Array,
    closed: jax.Array,
    level: Level,
    camera: Camera,
    sides: bool = False,
) -> Hits:
    """Cast the rays of one image.

    Args:
        position: float32[2], (x, y) of the eye in tiles.
        heading: as `Scene.heading`.
        closed: bool[D], which doors are closed.
        level: the level.
        camera: width and field of view of the image.
        sides: whether to tell `Hits.side` and `Hits.face`.
    """
    if level.free_walls is not None:
        return meet(position, direction(heading), level.free_walls, camera)
    pose = position, heading, closed, level
    aims = staged(partial(aim, camera=camera, fixed=fixed_lines(level)))(*pose)
    return look_up(aims, staged(march)(aims), level, sides)


def aim(
    position: jax.Array,
    heading: jax.Array,
    closed: jax.Array,
    level: Level,
    camera: Camera,
    fixed: tuple[Fixed, Fixed] | None = None,
) -> tuple[Aim, Aim]:
    """Aim the rays at the vertical and the horizontal lines, or at those of `fixed_lines`."""
    columns, rows = occupancy(level, closed)
    # The tile and the place in it separately, so that adding the margin rounds nothing.
    floor = jnp.floor(position)
    home, inside = floor.astype(jnp.int32) + level.margin, position - floor
    ray_x, ray_y = rays(heading, camera)
    # Shift towards the centre of the eye's tile, or the shifted ray might start beyond a line.
    centre = 0.5 - inside
    left = ray_x * centre[1] < ray_y * centre[0]
    side = jnp.where(left, jnp.float32(-NUDGE), jnp.float32(NUDGE))
    lines = fixed or (None, None)
    vertical = _aim_at_lines(columns, lines[0], home, inside, ray_x, ray_y, side)
    crosswise = home[::-1], inside[::-1], ray_y, ray_x, -side
    return vertical, _aim_at_lines(rows, lines[1], *crosswise)


def _aim_at_lines(
    words: jax.Array,
    fixed: Fixed | None,
    home: jax.Array,
    inside: jax.Array,
    ray: jax.Array,
    across: jax.Array,
    side: jax.Array,
) -> Aim:
    """Aim at the lines of one kind; described here for the vertical ones.

    Args:
        words: uint32[C, words], solid rows of each column.
        fixed: the columns that rays can hit; None if the map may change.
        home: int32[2], (column, row) of the eye's tile.
        inside: float32[2], (x, y) of the eye within that tile.
        ray: float32[W], x component of each ray.
        across: float32[W], y component.
        side: float32[W], the sideways shift of each ray, positive to the right seen along +x.
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
    return Aim(
        first=first,
        spacing=spacing,
        place=place - shift + (home[1] << fraction_bits),
        shift=shift,
        stride=jnp.rint(across * spacing * one).astype(jnp.int32),
        forwards=forwards,
        home=column,
        lines=crossed(words, column) if fixed is None else shut(words, fixed),
        fraction_bits=fraction_bits,
    )


def march(aims: tuple[Aim, Aim]) -> tuple[jax.Array, jax.Array]:
    """int32[W] twice: how many lines of each kind a ray crosses before it hits one."""
    return _march(aims[0]), _march(aims[1])


def _march(aim: Aim) -> jax.Array:
    """int32[W]: how many lines each ray crosses before it hits one."""
    lines = aim.lines
    if isinstance(lines, Fixed):
        return _march_fixed(aim, lines)
    steps, words = lines.ahead.shape
    hit = jnp.full(aim.place.shape, steps, jnp.int32)
    if steps <= (most := _most_lines(words)):
        return _march_block(aim, lines.ahead, lines.behind, jnp.int32(0), hit)
    blocks = -(-steps // most)
    size = -(-steps // blocks)
    filler = ((0, blocks * size - steps), (0, 0))
    ahead, behind = jnp.pad(lines.ahead, filler), jnp.pad(lines.behind, filler)

    def visit(i: jax.Array, hit: jax.Array) -> jax.Array:
        base = (blocks - 1 - i) * size
        far = lax.dynamic_slice_in_dim(ahead, base, size)
        near = lax.dynamic_slice_in_dim(behind, base, size)
        return _march_block(aim, far, near, base, hit)

    return lax.fori_loop(0, blocks, visit, varying(hit, aim))


def _most_lines(words: int) -> int:
    """How many lines of this many words are marched without a loop."""
    return BLOCK if words <= 2 else SMALL_BLOCK


def _march_fixed(aim: Aim, lines: Fixed) -> jax.Array:
    """As `_march`, over the lines of a constant map that have a wall face, in any order."""
    count = len(lines.columns)
    words = np.asarray(lines.words, np.int32) if lines.doors is None else lines.doors
    columns = np.asarray(lines.columns, np.int32)
    hit = jnp.full(aim.place.shape, lines.most, jnp.int32)
    size = _most_lines(words.shape[1])
    if count <= size:
        for column, word in zip(columns, words, strict=True):
            hit = _look_at(aim, column, list(word), lines.most, hit)
        return hit
    blocks = -(-count // size)
    # The last block starts earlier, and tests some lines again.
    starts = np.minimum(np.arange(blocks, dtype=np.int32) * size, count - size)

    def visit(i: jax.Array, hit: jax.Array) -> jax.Array:
        at = jnp.asarray(starts)[i]
        block = lax.dynamic_slice_in_dim(jnp.asarray(columns), at, size)
        found = lax.dynamic_slice_in_dim(jnp.asarray(words), at, size)
        for k in range(size):
            hit = _look_at(aim, block[k], list(found[k]), lines.most, hit)
        return hit

    return lax.fori_loop(0, blocks, visit, varying(hit, aim))


def _look_at(aim: Aim, column: Any, words: list[Any], most: int, hit: jax.Array) -> jax.Array:
    """Update `hit`: how many lines each ray crosses before that of a column, if it hits there."""
    passed = column - aim.home - 1
    forwards = jnp.where(passed >= 0, passed, most)
    backwards = jnp.where(passed <= -2, -2 - passed, most)
    passed = jnp.where(aim.forwards, forwards, backwards)
    # The complement of the tile shifts the tile's bit to the sign of the word.
    place = ~aim.place - aim.stride * passed
    tile = lax.shift_right_arithmetic(place, jnp.int32(aim.fraction_bits))
    word = jnp.broadcast_to(words[0], tile.shape)
    for i, further in enumerate(words[1:], 1):
        word = jnp.where(tile < -i * WORD, further, word)
    solid = lax.shift_left(word, tile & (WORD - 1)) < 0
    return jnp.minimum(hit, jnp.where(solid, passed, most))


def _march_block(
    aim: Aim, ahead: jax.Array, behind: jax.Array, base: jax.Array, hit: jax.Array
) -> jax.Array:
    """`hit` after the lines from `base` on, farthest first, one for each pair of words."""
    steps = ahead.shape[0]
    # The complement of the tile shifts the tile's bit to the sign of the word.
    place = ~(aim.place + aim.stride * (base + steps - 1))
    for k in reversed(range(steps)):
        tile = lax.shift_right_arithmetic(place, jnp.int32(aim.fraction_bits))
        bit = tile & (WORD - 1)
        solid = lax.shift_left(_word(aim, ahead[k], behind[k], tile), bit) < 0
        hit = jnp.where(solid, base + k, hit)
        place = place + aim.stride
    return hit


def _word(aim: Aim, ahead: jax.Array, behind: jax.Array, tile: jax.Array) -> jax.Array:
    """int32[W]: the word with the tile's bit, from the words of one line in each direction.

    `tile` is the complement of the tile's number.
    """
    word = jnp.where(aim.forwards, ahead[0], behind[0])
    for i in range(1, ahead.shape[0]):
        word = jnp.where(tile < -i * WORD, jnp.where(aim.forwards, ahead[i], behind[i]), word)
    return word


def look_up(
    aims: tuple[Aim, Aim], hits: tuple[jax.Array, jax.Array], level: Level, sides: bool = False
) -> Hits:
    """Look up the nearer of the two hits that the marches found."""
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
    # Seen from outside, left to right on north and east faces runs against the axis.
    mirrored = jnp.where(horizontal, crosswise.forwards, ~vertical.forwards)
    side = _side(aims, horizontal)
    index = row * level.size[0] + column
    face = side * (level.size[0] * level.size[1]) + index
    every = jnp.asarray(level.walls).reshape(-1)
    wall = every.at[face if len(level.walls) == 4 else index].get(mode="promise_in_bounds")
    return Hits(
        depth=jnp.where(horizontal, depths[1], depths[0]),
        wall=wall,
        along=jnp.where(mirrored, 1 - along, along),
        horizontal=horizontal,
        tile=jnp.stack([column, row], axis=-1) - level.margin,
        side=side if sides else None,
        face=face if sides else None,
    )


def _side(aims: tuple[Aim, Aim], horizontal: jax.Array) -> jax.Array:
    """int32[W]: where the faces that were hit look (see `Hits.side`)."""
    west_or_east = jnp.where(aims[0].forwards, jnp.int32(0), jnp.int32(1))
    north_or_south = jnp.where(aims[1].forwards, jnp.int32(2), jnp.int32(3))
    return jnp.where(horizontal, north_or_south, west_or_east)
