"""A random way through a maze, and doors that leave it open."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from .._jax.batching import varying
from ..engine.level import Array
from .draws import draw_index
from .straighten import shift

# (row, column) of the cells beside one.
_AROUND = ((0, 1), (0, -1), (1, 0), (-1, 0))


def draw_path(bits: jax.Array, walkable: jax.Array, start: jax.Array, end: jax.Array) -> jax.Array:
    """bool[N, N]: the cells of a random path, both ends included.

    From each cell the path goes on to a random one beside it where it has not been, to the end as
    soon as that is beside it, and back where it can go nowhere. That is the rule of DeepMind Lab's
    `visitRandomPath`.

    Args:
        bits: uint32[N * N], random.
        walkable: bool[N, N], whose border is not; one can walk from start to end.
        start: int32[2], (column, row) of a cell.
        end: int32[2], another one, or the same.
    """
    size = walkable.shape[0]
    index = np.arange(size * size, dtype=np.int32).reshape(size, size)
    last = end[1] * size + end[0]
    first = jnp.where(index == start[1] * size + start[0], 1, 0)

    def there(depth: jax.Array) -> jax.Array:
        return jnp.any((index == last) & (depth > 0))

    def go(carry: tuple[jax.Array, ...]) -> tuple[jax.Array, ...]:
        time, depth, left = carry
        deepest = jnp.max(depth)
        here = depth == deepest
        ways = jnp.stack([shift(here, *step) for step in _AROUND]) & left[None]
        beside = jnp.any(ways, axis=(1, 2))
        upto = jnp.cumsum(beside, dtype=jnp.int32)
        way = jnp.argmax(upto > draw_index(bits[time], jnp.maximum(upto[-1], 1)))
        final = jnp.any(ways, axis=0) & (index == last)
        target = jnp.where(jnp.any(final), final, ways[way]) & (upto[-1] > 0)
        # Where nothing is left beside, the path goes back.
        depth = jnp.where(here & (upto[-1] == 0), 0, depth)
        depth = jnp.where(target, deepest + 1, depth)
        # Only cells that are new take another one of the random numbers.
        return time + (upto[-1] > 0).astype(jnp.int32), depth, left & ~target

    carry = jnp.int32(0), first.astype(jnp.int32), walkable & (first == 0)
    carry = varying(carry, bits, walkable, start, end)
    return jax.lax.while_loop(lambda c: ~there(c[1]) & (jnp.max(c[1]) > 0), go, carry)[1] > 0


def draw_closed(
    bits: jax.Array, walkable: jax.Array, doors: Array, start: jax.Array, end: jax.Array
) -> jax.Array:
    """bool[D]: which doors are closed: of those that are not on a random way, half, rounded up.

    Args:
        bits: uint32[N * N + D], random.
        walkable: as in `draw_path`, doors included.
        doors: int32[D, 2], (column, row) of each; in column 0 if it is absent.
        start: as in `draw_path`.
        end: likewise.
    """
    column, row = jnp.asarray(doors).T
    path = draw_path(bits[: walkable.size], walkable, start, end)
    shut = (column > 0) & ~path[row, column]
    # A door's rank in a random order of those that are not on the way.
    drawn = jnp.where(shut, bits[walkable.size :] >> 1, jnp.uint32(2**32 - 1))
    rank = jnp.argsort(jnp.argsort(drawn))
    return shut & (rank >= jnp.sum(shut, dtype=jnp.int32) // 2)
