"""Convolutions for networks in flax."""

from __future__ import annotations

from collections.abc import Sequence

import flax.linen as nn
import jax
import jax.numpy as jnp
from jax import lax
from jax.typing import DTypeLike

from ..convolution import Padding, pair, patch_convolution


class PatchConvolution(nn.Module):
    """`flax.linen.Conv` by matrix products, many times faster in a compiled training on a CPU.

    It has the parameters of `flax.linen.Conv`, `kernel` float[rows, columns, channels, features]
    and `bias` float[features], in the same order, so that either module takes those of the other.
    `jaxenstein.patch_convolution` is the same without flax.

    Attributes:
        features: number of channels of the result.
        kernel_size: rows and columns of the kernel, or one number for both.
        strides: pixels from one window to the next: down and across, or one number for both.
        padding: "SAME" or "VALID", as in `jaxenstein.patch_convolution`.
        use_bias: whether to add a number for each feature.
        dtype: of the computation and the result; None: the widest of images and parameters.
        param_dtype: of the parameters.
        kernel_init: draws the kernel.
        bias_init: draws the bias.

    Raises:
        SettingError: when it is called, as in `jaxenstein.patch_convolution`.

    Examples:
        >>> import jax
        >>> import jax.numpy as jnp
        >>> from jaxenstein.baselines import PatchConvolution
        >>> layer = PatchConvolution(32, kernel_size=(8, 8), strides=4, padding="VALID")
        >>> frames = jnp.zeros((16, 64, 64, 3))
        >>> params = layer.init(jax.random.key(0), frames)
        >>> layer.apply(params, frames).shape
        (16, 15, 15, 32)
    """

    features: int
    kernel_size: int | Sequence[int]
    strides: int | Sequence[int] = 1
    padding: Padding = "SAME"
    use_bias: bool = True
    dtype: DTypeLike | None = None
    param_dtype: DTypeLike = jnp.float32
    kernel_init: nn.initializers.Initializer = nn.initializers.lecun_normal()
    bias_init: nn.initializers.Initializer = nn.initializers.zeros_init()

    @nn.compact
    def __call__(self, images: jax.Array) -> jax.Array:
        """Return float[..., height', width', features] of float[..., height, width, channels]."""
        shape = (*pair("kernel_size", self.kernel_size), images.shape[-1], self.features)
        kernel = self.param("kernel", self.kernel_init, shape, self.param_dtype)
        dtype = self.dtype or jnp.promote_types(images.dtype, kernel.dtype)
        images, kernel = images.astype(dtype), kernel.astype(dtype)
        images = patch_convolution(images, kernel, self.strides, self.padding)
        if not self.use_bias:
            return images
        bias = self.param("bias", self.bias_init, (self.features,), self.param_dtype)
        return images + bias.astype(dtype).reshape((1,) * (images.ndim - 1) + (-1,))


def conv_lax(images: jax.Array, weights: jax.Array, stride: int) -> jax.Array:
    """As `jaxenstein.patch_convolution` without padding, by `jax.lax`."""
    lead = images.shape[:-3]
    flat = images.reshape(-1, *images.shape[-3:])
    out = lax.conv_general_dilated(
        flat, weights, (stride, stride), "VALID", dimension_numbers=("NHWC", "HWIO", "NHWC")
    )
    return out.reshape(*lead, *out.shape[1:])
