"""Held-out levels: a hash of its content decides the side of a level.

The hash uses only whole numbers, in the order of their arrays, so equal levels have equal hashes
on every device and with every version of JAX.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any, Literal, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from .._jax.batching import varying, zeros
from ..seeds import key_of
from .draws import mixed

Split = Literal["train", "test"]
MOST_TRIES = 2**16
"""The most levels that a reset draws to find one on its side."""
# Folded into the key for the next try. Another number would change the episodes.
_AGAIN = 0x5917
_GOLDEN = np.uint32(0x9E3779B9)

T = TypeVar("T")


def fingerprint(parts: Sequence[jax.Array]) -> jax.Array:
    """uint32[2]: a 64-bit hash of arrays of whole numbers or bools.

    The arrays are concatenated to words w[i], i from 0 to n - 1. Half h of the hash, 0 or 1, is
    mixed(sum over i of mixed(w[i] ^ k[h, i])), where k[h, i] = mixed((h * n + i + 1) * 0x9E3779B9),
    `mixed` is lowbias32, and all arithmetic is modulo 2**32.

    Args:
        parts: numbers of at most 32 bits; the hash ignores their shapes.
    """
    for part in parts:
        assert not jnp.issubdtype(part.dtype, jnp.floating), "levels must be whole numbers"
    words = jnp.concatenate([jnp.ravel(part).astype(jnp.uint32) for part in parts])
    count = words.shape[0]
    keys = mixed(np.arange(1, 2 * count + 1, dtype=np.uint32) * _GOLDEN).reshape(2, count)
    return mixed(jnp.sum(mixed(words[None] ^ keys), axis=1, dtype=jnp.uint32))


def is_in_split(split: str, fraction: float, level: Any) -> Any:
    """bool[]: whether a level is in a split, `"train"` or `"test"`.

    The test levels are those with the smallest hashes, so a larger fraction includes the test
    levels of a smaller one.

    Args:
        split: the split.
        fraction: the fraction of all levels in the test split.
        level: uint32[2], a hash from `fingerprint`, as a JAX or NumPy array.
    """
    bound = min(max(round(fraction * 2**32), 1), 2**32 - 1)
    held_out = level[0] < np.uint32(bound)
    return held_out if split == "test" else ~held_out


def first_accepted(
    draw: Callable[[jax.Array, Any], T],
    accepts: Callable[[T], jax.Array],
    needed: jax.Array,
    key: jax.Array,
    given: Any,
) -> T:
    """Draw until a draw is accepted, first from `key` and then from keys derived from it.

    Returns the last draw if none of `MOST_TRIES` is accepted, and zeros if none is needed.

    Args:
        draw: a function of a key and `given`.
        accepts: a function of a draw that returns bool[].
        needed: bool[], whether a draw is needed at all.
        key: a random key that is not used elsewhere.
        given: passed to `draw`.
    """

    def going(carry: tuple[jax.Array, jax.Array, jax.Array, T]) -> jax.Array:
        _, tries, found, _ = carry
        return ~found & (tries < MOST_TRIES)

    def again(
        carry: tuple[jax.Array, jax.Array, jax.Array, T],
    ) -> tuple[jax.Array, jax.Array, jax.Array, T]:
        key, tries, _, _ = carry
        drawn = varying(draw(key, given), key, given, needed)
        return jax.random.fold_in(key, _AGAIN), tries + 1, accepts(drawn), drawn

    nothing = zeros(jax.eval_shape(draw, key, given))
    start = varying((jnp.int32(0), ~needed, nothing), key, given, needed)
    return lax.while_loop(going, again, (key, *start))[3]


@functools.partial(jax.jit, static_argnums=(0, 1))
def sample_levels(env: Any, count: int, seed: int | jax.Array) -> jax.Array:
    """uint32[count, 2]: the hashes of the levels of `count` first states.

    Args:
        env: a `GeneratedTask`; its split is ignored.
        count: the number of draws.
        seed: the seed of the draws.
    """
    params = env.check_params()

    def one(key: jax.Array) -> jax.Array:
        return fingerprint(env.level_parts(env.init_state(key, params)))

    # In batches, to bound the memory for large worlds.
    keys = jax.random.split(key_of(seed), count)
    return lax.map(one, keys, batch_size=256)
