"""Spaces contain their samples, and nothing else."""

import functools
from typing import Any

import jax
import numpy as np
import pytest

from jaxenstein.spaces import Box, Dict, Discrete

BYTES = Box(0, 255, (2, 3), np.dtype(np.uint8))
BELOW = Box(-np.inf, -5.0, (3,), np.dtype(np.float32))
DEPTHS = Box(0.0, np.inf, (4,), np.dtype(np.float32))


@functools.cache
def sampled(space: Any) -> Any:
    """Two thousand samples."""
    keys = jax.random.split(jax.random.key(0), 2000)
    return jax.tree.map(np.asarray, jax.jit(jax.vmap(space.sample))(keys))


@pytest.mark.parametrize(
    "space", [Discrete(5), BYTES, BELOW, DEPTHS, Dict({"image": BYTES, "depth": DEPTHS})]
)
def test_samples_are_in_the_space(space):
    samples = sampled(space)
    for i in range(50):
        assert space.contains(jax.tree.map(lambda leaf, i=i: leaf[i], samples))


def test_samples_cover_the_whole_range():
    assert set(sampled(Discrete(5)).tolist()) == set(range(5))
    assert (sampled(BYTES).min(), sampled(BYTES).max()) == (0, 255)


@pytest.mark.parametrize("value", [5, -1, 1.0, [1], True])
def test_discrete_does_not_contain_other_values(value):
    assert not Discrete(5).contains(value)


def test_equal_spaces_hash_alike():
    spaces = {Dict({"a": BYTES, "b": DEPTHS}): 1, Dict({"b": DEPTHS, "a": BYTES}): 2, BYTES: 3}
    assert list(spaces.values()) == [2, 3]


def test_box_does_not_contain_other_values():
    assert not BYTES.contains(np.zeros((2, 3), np.int32))
    assert not BYTES.contains(np.zeros((3, 2), np.uint8))
    assert not DEPTHS.contains(np.full(4, -1, np.float32))
    assert not Dict({"image": BYTES}).contains({"picture": np.zeros((2, 3), np.uint8)})
    assert not Dict({"image": BYTES}).contains(np.zeros((2, 3), np.uint8))
