"""Convolutions as matrix products.

XLA's CPU compiler runs a convolution inside a loop several times slower than alone, and turns
`jax.vmap` over kernels into grouped convolutions, slow everywhere. Matrix products have neither
problem.
"""

from __future__ import annotations

import functools

import jax
import jax.numpy as jnp
from jax import lax


def output_size(size: int, kernel: int, stride: int) -> int:
    """Length of one side after a convolution without padding."""
    return (size - kernel) // stride + 1


def conv_lax(images: jax.Array, weights: jax.Array, stride: int) -> jax.Array:
    """Convolve without padding by `jax.lax`; arguments as in `conv_matmul`."""
    lead = images.shape[:-3]
    flat = images.reshape(-1, *images.shape[-3:])
    out = lax.conv_general_dilated(
        flat, weights, (stride, stride), "VALID", dimension_numbers=("NHWC", "HWIO", "NHWC")
    )
    return out.reshape(*lead, *out.shape[1:])


def conv_matmul(images: jax.Array, weights: jax.Array, stride: int) -> jax.Array:
    """Convolve without padding, as a sum of matrix products, one for each tap of the kernel.

    Blocks of stride x stride pixels are first folded into channels where the kernel is a
    multiple of the stride: then few taps remain, each of many channels.

    Args:
        images: float[..., height, width, channels], any leading axes.
        weights: float[kernel, kernel, channels, features].
        stride: of rows and columns alike.

    Returns:
        float[..., rows, columns, features].
    """
    kernel, _, channels, features = weights.shape
    height, width = images.shape[-3:-1]
    rows, columns = output_size(height, kernel, stride), output_size(width, kernel, stride)
    block = stride if kernel % stride == 0 else 1
    images = _fold(images, block, (rows - 1) * stride + kernel, (columns - 1) * stride + kernel)
    taps, step = kernel // block, stride // block
    weights = weights.reshape(taps, block, taps, block, channels, features)
    weights = weights.transpose(0, 2, 1, 3, 4, 5).reshape(taps, taps, -1, features)

    def tap(i: int, j: int) -> jax.Array:
        down = slice(i, i + step * (rows - 1) + 1, step)
        across = slice(j, j + step * (columns - 1) + 1, step)
        return images[..., down, across, :] @ weights[i, j]

    # Gathering patches for a single product would move more bytes, and takes longer.
    return functools.reduce(jnp.add, (tap(i, j) for i in range(taps) for j in range(taps)))


def _fold(images: jax.Array, block: int, height: int, width: int) -> jax.Array:
    """Crop to height x width and fold blocks of pixels into channels."""
    images = images[..., :height, :width, :]
    if block == 1:
        return images
    *lead, _, _, channels = images.shape
    images = images.reshape(*lead, height // block, block, width // block, block, channels)
    images = jnp.swapaxes(images, -4, -3)
    return images.reshape(*lead, height // block, width // block, block * block * channels)
