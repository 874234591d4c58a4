"""Trees packed into words come back bit for bit, on the device and on the host."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from jaxenstein._jax.packing import Packing
from tests.x64 import enable_x64

TYPES = ("float32", "int32", "uint32", "bool", "uint8", "int8", "int16", "float16", "bfloat16")
ROWS = 3


def tree_of(seed: int) -> dict[str, Any]:
    """Numbers of all types and ranks with random bits, among them NaNs and negative ones."""
    rng = np.random.default_rng(seed)
    tree = {}
    for i, name in enumerate(TYPES):
        dtype, shape = jnp.dtype(name), ((), (3,), (2, 2), (0,))[i % 4]
        bits = rng.integers(0, 256, (*shape, dtype.itemsize), np.uint8)
        numbers = bits[..., 0] % 2 == 1 if name == "bool" else bits.view(dtype)[..., 0]
        tree[name] = jnp.asarray(numbers)
    return tree


def assert_same_bits(one: Any, other: Any) -> None:
    assert jax.tree.structure(one) == jax.tree.structure(other)
    for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        assert (a.shape, a.dtype) == (b.shape, b.dtype)
        assert np.asarray(a).tobytes() == np.asarray(b).tobytes()


def test_round_trip_of_all_types() -> None:
    trees = [tree_of(seed) for seed in range(ROWS)]
    packing = Packing(lambda: trees[0])
    rows = jnp.stack([jax.jit(packing.pack)(tree) for tree in trees])
    assert (rows.shape, rows.dtype) == ((ROWS, packing.words), np.uint32)
    read = packing.read(rows)
    for i, tree in enumerate(trees):
        assert_same_bits(jax.jit(packing.unpack)(rows[i]), tree)
        assert_same_bits(jax.tree.map(lambda leaf, i=i: np.array(leaf[i]), read), tree)


def test_read_one_returns_the_first_row_of_read() -> None:
    packing = Packing(lambda: tree_of(0))
    rows = packing.pack(tree_of(0))[None]
    one = packing.read_one(rows)
    assert_same_bits(
        jax.tree.map(np.asarray, one), jax.tree.map(lambda a: a[0], packing.read(rows))
    )
    scalars = [leaf for leaf in jax.tree.leaves(one) if not np.shape(leaf)]
    assert all(isinstance(leaf, bool | np.generic) for leaf in scalars)


def test_read_returns_a_copy() -> None:
    packing = Packing(lambda: tree_of(0))
    rows = packing.pack(tree_of(0))[None]
    for read in (packing.read, packing.read_one):
        for leaf in jax.tree.leaves(read(rows)):
            if np.shape(leaf):
                leaf[...] = 0
    assert_same_bits(packing.unpack(rows[0]), tree_of(0))


def test_round_trip_of_wide_numbers() -> None:
    with enable_x64(True):
        tree = {"pi": jnp.float64(np.pi), "far": jnp.array([-(2**40), 7], jnp.int64)}
        packing = Packing(lambda: tree)
        row = packing.pack(tree)
        assert_same_bits(packing.unpack(row), tree)
        assert packing.read(row[None])["pi"].item() == np.pi
        assert packing.read(row[None])["far"].tolist() == [[-(2**40), 7]]
        assert packing.read_one(row[None])["pi"] == np.pi


@pytest.mark.parametrize("kind", ["threefry2x32", "rbg"])
def test_round_trip_of_random_keys(kind: str) -> None:
    keys = jax.random.split(jax.random.key(5, impl=kind), 2)
    packing = Packing(lambda: {"keys": keys})
    back = packing.unpack(packing.pack({"keys": keys}))["keys"]
    assert back.dtype == keys.dtype
    np.testing.assert_array_equal(jax.random.key_data(back), jax.random.key_data(keys))


def test_equal_trees_have_equal_packings() -> None:
    env, params = jaxenstein.make("key-corridor-s3r1", height=4, width=4)
    one, other = (Packing(env.init_state, jax.random.key(seed), params) for seed in (0, 1))
    assert one == other
    assert hash(one) == hash(other)
    smaller = Packing(lambda: params)
    assert one != smaller
    assert one != "a packing"
    state = env.init_state(jax.random.key(3), params)
    assert_same_bits(one.unpack(one.pack(state)), state)
