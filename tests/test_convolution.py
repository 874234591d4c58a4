"""The convolution as matrix products against `jax.lax`."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from jaxenstein import SettingError, patch_convolution

KEY = jax.random.key(0)


def by_lax(images, weights, stride, padding):
    strides = stride if isinstance(stride, tuple) else (stride, stride)
    flat = images.reshape(-1, *images.shape[-3:])
    out = lax.conv_general_dilated(
        flat, weights, strides, padding, dimension_numbers=("NHWC", "HWIO", "NHWC")
    )
    return out.reshape(*images.shape[:-3], *out.shape[1:])


@pytest.mark.parametrize(
    ("size", "kernel", "stride", "padding"),
    [
        pytest.param((64, 64), (8, 8), 4, "VALID", marks=pytest.mark.slow),
        pytest.param((16, 21), (5, 5), 3, "VALID", marks=pytest.mark.slow),
        ((6, 6), (3, 3), 1, "VALID"),
        pytest.param((7, 9), (3, 3), 2, "VALID", marks=pytest.mark.slow),
        ((9, 13), (4, 4), 4, "VALID"),
        ((7, 10), (2, 6), (2, 3), "VALID"),
        ((7, 9), (4, 4), 2, "SAME"),
        ((3, 2), (5, 4), (1, 2), "SAME"),
        pytest.param((5, 6), (3, 4), 1, "SAME", marks=pytest.mark.slow),
        pytest.param((7, 7), (2, 2), 3, "SAME", marks=pytest.mark.slow),
    ],
)
def test_values_and_gradients_match_lax(size, kernel, stride, padding):
    keys = jax.random.split(KEY, 2)
    images = jax.random.normal(keys[0], (2, 3, *size, 3))
    weights = jax.random.normal(keys[1], (*kernel, 3, 4))

    def run(convolve):
        total = lambda *args: jnp.sum(jnp.sin(convolve(*args, stride, padding)))  # noqa: E731
        gradients = jax.grad(total, (0, 1))(images, weights)
        return convolve(images, weights, stride, padding), gradients

    ours, lax = (jax.jit(run, static_argnums=0)(one) for one in (patch_convolution, by_lax))
    assert ours[0].shape == lax[0].shape
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-4, atol=2e-3), ours, lax)


def test_one_image_and_other_data_types():
    images, weights = jnp.ones((5, 5, 2), jnp.bfloat16), jnp.ones((2, 2, 2, 3), jnp.bfloat16)
    out = patch_convolution(images, weights, [2, 2])
    assert (out.shape, out.dtype) == ((2, 2, 3), jnp.bfloat16)
    np.testing.assert_array_equal(out.astype(jnp.float32), 8)


@pytest.mark.parametrize(
    ("images", "weights", "options", "message"),
    [
        ((6, 6), (3, 3, 1, 4), {}, r"images must be \[..., height, width, channels\]"),
        (
            (6, 6, 3),
            (3, 3, 1, 4),
            {},
            r"the same number of channels, not images of shape \[6, 6, 3\], weights",
        ),
        ((6, 6, 3), (3, 3, 3), {}, "weights .rows, columns, channels, features"),
        ((2, 6, 3), (3, 3, 3, 4), {}, "the kernel must fit into the image"),
        ((0, 6, 3), (3, 3, 3, 4), {"padding": "SAME"}, "the kernel must fit into the image"),
        ((6, 6, 3), (3, 3, 3, 4), {"stride": 0}, "stride must be a whole number >= 1, not 0"),
        ((6, 6, 3), (3, 3, 3, 4), {"stride": (1, 2, 3)}, "stride must be .* or two of them"),
        ((6, 6, 3), (3, 3, 3, 4), {"padding": "same"}, "'VALID' or 'SAME', not 'same'"),
    ],
)
def test_mismatched_shapes_are_refused(images, weights, options, message):
    with pytest.raises(SettingError, match=message):
        patch_convolution(jnp.zeros(images), jnp.zeros(weights), **options)


@pytest.mark.parametrize("kinds", [("uint8", "float32"), ("float16", "float32"), ("int32",) * 2])
def test_mixed_data_types_are_refused(kinds):
    images, weights = jnp.zeros((4, 4, 1), kinds[0]), jnp.zeros((2, 2, 1, 1), kinds[1])
    with pytest.raises(SettingError, match=f"the same float dtype, not {kinds[0]} and {kinds[1]}"):
        patch_convolution(images, weights)
