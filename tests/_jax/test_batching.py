"""Computations that no member of a batch needs are skipped."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from jaxenstein._jax.batching import by_most, by_own, where_any, where_few
from jaxenstein._jax.staging import repeat, staged

NEEDS = [np.zeros((2, 3), bool), np.array([[0, 0, 0], [0, 1, 0]], bool), np.ones((2, 3), bool)]


@pytest.mark.parametrize("where", [where_any, where_few])
@pytest.mark.parametrize("needed", NEEDS, ids=["none", "one", "all"])
@pytest.mark.parametrize("axes", [((0, 0), (0, 0)), ((0, None), (0, 0)), ((0, 0), (None, 0))])
def test_function_is_right_where_needed(where, needed, axes) -> None:
    def function(key, x):
        return {"drawn": jax.random.uniform(key), "twice": (x * 2, x > 1)}

    def chosen(needed, key, x):
        out = where(function)(needed, key, x)
        return jax.tree.map(lambda leaf: jnp.where(needed, leaf, jnp.zeros_like(leaf)), out)

    def plain(needed, key, x):
        out = function(key, x)
        return jax.tree.map(lambda leaf: jnp.where(needed, leaf, jnp.zeros_like(leaf)), out)

    # Keys and numbers are batched with the outer axis, the inner one, or both.
    keys = jax.random.split(jax.random.key(0), 6).reshape(2, 3)
    x = jnp.arange(6, dtype=jnp.int32).reshape(2, 3)
    outer, inner = axes
    keys = keys if inner[0] == 0 else keys[:, 0]
    x = x if outer[1] == 0 else x[0]

    def nested(run):
        once = jax.vmap(run, (0, *inner))
        return jax.jit(jax.vmap(once, (0, *outer)))(jnp.asarray(needed), keys, x)

    jax.tree.map(np.testing.assert_array_equal, nested(chosen), nested(plain))


def test_where_any_skips_unneeded_calls() -> None:
    """On the CPU, the function must not be called."""
    called = []

    def function(x):
        jax.debug.callback(lambda: called.append(1))
        return x + 1

    run = jax.jit(jax.vmap(where_any(function)))
    x = jnp.arange(3, dtype=jnp.int32)
    jax.block_until_ready(run(jnp.zeros(3, bool), x))
    jax.effects_barrier()
    assert not called
    out = run(jnp.array([False, True, False]), x)
    jax.effects_barrier()
    assert called
    assert out[1] == 2


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 1.0])
def test_where_few_gathers_the_needed_members(share: float) -> None:
    """More than one round, the last of them not full."""
    rng = np.random.default_rng(5)
    needed = jnp.asarray(rng.random(101) < share)
    x, y = (jnp.asarray(rng.integers(0, 99, (101, n)), jnp.int32) for n in (2, 3))

    def function(x, y):
        return x * 2, y.sum()

    twice, total = jax.jit(jax.vmap(where_few(function)))(needed, x, y)
    chosen = np.asarray(needed)
    np.testing.assert_array_equal(twice[chosen], 2 * x[chosen])
    np.testing.assert_array_equal(total[chosen], y.sum(axis=1)[chosen])
    # Unneeded results are never computed, so they keep their initial values.
    assert not np.asarray(twice)[~chosen].any()


@pytest.mark.parametrize("shape", [(), (3,)])
def test_by_most_runs_as_often_as_the_neediest_member_needs(shape: tuple[int, ...]) -> None:
    """On the CPU; each branch adds its own number."""
    offset = jnp.float32(0.5)
    run = by_most([lambda x, i=i: x + offset + 10 * i for i in range(3)])
    x = jnp.arange(8, dtype=jnp.float32).reshape(4, 2)
    twice = jax.jit(jax.vmap(jax.vmap(run, (0, None)), (0, 0)))
    for most in range(3):
        needed = np.zeros((4, 5, *shape), np.int32)
        needed[2, 3] = most
        out = twice(jnp.asarray(needed), x)
        wanted = np.broadcast_to(np.asarray(x)[:, None] + 0.5 + 10 * most, (4, 5, 2))
        np.testing.assert_array_equal(out, wanted)
    assert run(jnp.full(shape, 1, jnp.int32), x[0, 1]) == 11.5


def test_by_own_runs_as_often_as_each_member_needs() -> None:
    """Also for nested batches that share an argument, and for an empty batch."""
    offset = jnp.float32(0.5)
    run = by_own([lambda x, y, i=i: x * y + offset + 10 * i for i in range(3)])
    needed = jnp.asarray(np.random.default_rng(3).integers(0, 3, (4, 5)), jnp.int32)
    x = jnp.arange(8, dtype=jnp.float32).reshape(4, 2)
    y = jnp.arange(5, dtype=jnp.float32)
    twice = jax.jit(jax.vmap(jax.vmap(run, (0, None, 0)), (0, 0, None)))
    wanted = (
        np.asarray(x)[:, None] * np.asarray(y)[:, None] + 0.5 + 10 * np.asarray(needed)[..., None]
    )
    np.testing.assert_array_equal(twice(needed, x, y), wanted)
    np.testing.assert_array_equal(run(needed[0, 0], x[0], y[0]), wanted[0, 0])
    assert jax.jit(jax.vmap(run))(needed[0, :0], x[:0], y[:0]).shape == (0, 2)


TABLE = jnp.asarray(np.random.default_rng(7).integers(0, 99, 11), jnp.int32)


def _repeated(needed, x):
    def body(i, carry, constants):
        return carry + TABLE[i % 11] * constants

    return jnp.where(needed, repeat(body)(jnp.int32(4), x, x), 0)


@pytest.mark.parametrize("nested", [False, True])
@pytest.mark.parametrize("run", [
    lambda needed, x: jnp.where(needed, where_any(lambda x: TABLE[x % 11] + x)(needed, x), 0),
    lambda needed, x: jnp.where(needed, where_few(lambda x: TABLE[x % 11] + x)(needed, x), 0),
    lambda needed, x: jnp.where(needed, by_most([lambda x: TABLE[x % 11] + x])(x * 0, x), 0),
    lambda needed, x: jnp.where(needed, by_own([lambda x: TABLE[x % 11] + x])(x * 0, x), 0),
    lambda needed, x: staged(lambda x: TABLE[x % 11] * needed.astype(jnp.int32))(x),
    _repeated,
], ids=["where_any", "where_few", "by_most", "by_own", "staged", "repeat"])  # fmt: skip
def test_inside_cond_with_batched_predicate(run, nested: bool) -> None:
    """`lax.cond` batches all arrays in its branches, including those they close over."""

    def choose(chosen, needed, x):
        return lax.cond(chosen, run, lambda needed, x: x - 1, needed, x)

    def plain(chosen, needed, x):
        return jnp.where(chosen, run(needed, x), x - 1)

    chosen, needed = (jnp.array(row, bool) for row in ([1, 0, 1, 1, 0, 0], [0, 1, 1, 1, 0, 1]))
    x = jnp.arange(6, dtype=jnp.int32)
    args = (chosen, needed, x)
    expected = [plain(*row) for row in zip(*args, strict=True)]
    if nested:
        args = jax.tree.map(lambda v: v.reshape(2, 3), args)
        got = jax.jit(jax.vmap(jax.vmap(choose)))(*args).reshape(-1)
    else:
        got = jax.jit(jax.vmap(choose))(*args)
    np.testing.assert_array_equal(got, expected)
