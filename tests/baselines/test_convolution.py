"""The convolution as a module of flax against `flax.linen.Conv`."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("flax")

import flax.linen as nn

from jaxenstein import SettingError, patch_convolution
from jaxenstein.baselines import PatchConvolution
from jaxenstein.baselines.convolution import conv_lax

KEY = jax.random.key(0)


@pytest.mark.parametrize(
    "options",
    [
        {"strides": 2, "padding": "VALID"},
        {"strides": (1, 2), "use_bias": False},
        {"dtype": jnp.bfloat16},
    ],
)
def test_matches_flax_conv_with_the_same_parameters(options):
    images = jax.random.normal(KEY, (2, 7, 6, 3))
    ours, other = (make(4, kernel_size=(3, 2), **options) for make in (PatchConvolution, nn.Conv))
    params = ours.init(KEY, images)
    jax.tree.map(np.testing.assert_array_equal, params, other.init(KEY, images))
    params = jax.tree.map(lambda leaf: leaf + jnp.float32(0.3), params)
    outs: list[Any] = [module.apply(params, images) for module in (ours, other)]
    mine, theirs = outs
    assert (mine.shape, mine.dtype) == (theirs.shape, theirs.dtype)
    mine, theirs = (np.asarray(out, np.float32) for out in (mine, theirs))
    np.testing.assert_allclose(mine, theirs, atol=0.1 if "dtype" in options else 1e-5)


def test_one_number_sets_both_sides():
    images = jnp.ones((6, 6, 1))
    made: Any = PatchConvolution(2, 3, strides=3).init_with_output(KEY, images)
    out, params = made
    assert out.shape == (2, 2, 2)
    assert params["params"]["kernel"].shape == (3, 3, 1, 2)
    with pytest.raises(SettingError, match="kernel_size must be a whole number or two of them"):
        PatchConvolution(2, (3, 3, 3)).init(KEY, images)


def test_both_implementations_agree():
    keys = jax.random.split(KEY, 2)
    images = jax.random.normal(keys[0], (2, 3, 9, 8, 3))
    weights = jax.random.normal(keys[1], (4, 4, 3, 5))
    ours = patch_convolution(images, weights, 2)
    np.testing.assert_allclose(conv_lax(images, weights, 2), ours, rtol=1e-4, atol=1e-4)
