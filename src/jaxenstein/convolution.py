"""A convolution that is fast inside a compiled loop on a CPU.

Inside a loop, XLA's CPU compiler makes the gradient of a convolution many times slower than that
of matrix products. It turns `jax.vmap` over kernels into grouped convolutions, which are slow on
all devices. `python -m benchmarks convolutions` measures both effects.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Literal

import jax
import jax.numpy as jnp
from jax import lax

from .errors import SettingError, quoted
from .fields import check_whole

Padding = Literal["VALID", "SAME"]


def patch_convolution(
    images: jax.Array,
    weights: jax.Array,
    stride: int | Sequence[int] = 1,
    padding: Padding = "VALID",
) -> jax.Array:
    """Convolve images by matrix products.

    Returns the values of `jax.lax.conv_general_dilated` with layouts NHWC and HWIO, up to
    rounding. If kernels do not overlap (the stride equals the kernel size), each image is cut into
    patches, and a single matrix product handles all of them. In a compiled training loop on a CPU
    this takes a fraction of the time of `jax.lax.conv` and of `flax.linen.Conv`.

    Args:
        images: float[..., height, width, channels], any leading axes.
        weights: float[rows, columns, channels, features], with the dtype of the images.
        stride: pixels between windows: (down, across), or one number for both.
        padding: "VALID": only windows inside the image; "SAME": pad with zeros, so that with
            stride 1 the result has the size of the image.

    Returns:
        float[..., height', width', features].

    Raises:
        SettingError: shapes or dtypes do not match, or the image is smaller than the kernel.

    Examples:
        >>> import jax
        >>> import jax.numpy as jnp
        >>> from jaxenstein import patch_convolution
        >>> frames = jnp.zeros((16, 64, 64, 3), jnp.uint8).astype(jnp.float32) / 255
        >>> weights = jax.random.normal(jax.random.key(0), (8, 8, 3, 32)) / 14
        >>> patch_convolution(frames, weights, stride=4).shape
        (16, 15, 15, 32)
    """
    strides = pair("stride", stride)
    _check(images, weights, padding)
    if padding == "SAME":
        images = _padded(images, weights.shape[:2], strides)
    rows, columns = (
        output_size(*sizes)
        for sizes in zip(images.shape[-3:-1], weights.shape[:2], strides, strict=True)
    )
    # If the kernel size is a multiple of the stride, turn blocks of pixels into channels: this
    # leaves few products, each over many channels.
    down, across = (
        step if size % step == 0 else 1
        for size, step in zip(weights.shape[:2], strides, strict=True)
    )
    height = (rows - 1) * strides[0] + weights.shape[0]
    width = (columns - 1) * strides[1] + weights.shape[1]
    images = _folded(images[..., :height, :width, :], down, across)
    weights = _folded_weights(weights, down, across)
    steps = strides[0] // down, strides[1] // across

    def tap(i: int, j: int) -> jax.Array:
        chosen_rows = slice(i, i + steps[0] * (rows - 1) + 1, steps[0])
        chosen_columns = slice(j, j + steps[1] * (columns - 1) + 1, steps[1])
        return images[..., chosen_rows, chosen_columns, :] @ weights[i, j]

    # Gathering patches for a single product would move more bytes and take longer.
    taps = [(i, j) for i in range(weights.shape[0]) for j in range(weights.shape[1])]
    return functools.reduce(jnp.add, (tap(i, j) for i, j in taps))


def output_size(size: int, kernel: int, stride: int) -> int:
    """The length of one side after a convolution without padding."""
    return (size - kernel) // stride + 1


def pair(name: str, value: int | Sequence[int]) -> tuple[int, int]:
    """Expand a number to both directions; check a pair.

    Raises:
        SettingError: a number is not whole or is below 1, or there are not two numbers.
    """
    numbers = tuple(value) if isinstance(value, Sequence) else (value, value)
    if len(numbers) != 2:
        raise SettingError(f"{name} must be a whole number or two of them, not {quoted(value)}")
    for number in numbers:
        check_whole(name, number)
    return numbers[0], numbers[1]


def _check(images: jax.Array, weights: jax.Array, padding: str) -> None:
    shown = f"images of shape {list(images.shape)}, weights of shape {list(weights.shape)}"
    if images.ndim < 3 or weights.ndim != 4 or images.shape[-1] != weights.shape[2]:
        raise SettingError(
            "images must be [..., height, width, channels] and weights [rows, columns, channels, "
            f"features] with the same number of channels, not {shown}"
        )
    if images.dtype != weights.dtype or not jnp.issubdtype(images.dtype, jnp.floating):
        raise SettingError(
            "images and weights must have the same float dtype, not "
            f"{images.dtype} and {weights.dtype}"
        )
    if padding not in ("VALID", "SAME"):
        raise SettingError(f"padding must be 'VALID' or 'SAME', not {quoted(padding)}")
    height, width = images.shape[-3:-1]
    small = height < weights.shape[0] or width < weights.shape[1]
    if 0 in (height, width, *weights.shape[:2]) or (padding == "VALID" and small):
        raise SettingError(f"the kernel must fit into the image, not {shown}")


def _padded(images: jax.Array, kernel: tuple[int, ...], strides: tuple[int, int]) -> jax.Array:
    """Pad with zeros for "SAME"."""
    sides = lax.padtype_to_pads(images.shape[-3:-1], kernel, strides, "SAME")
    return jnp.pad(images, [(0, 0)] * (images.ndim - 3) + [*sides, (0, 0)])


def _folded(images: jax.Array, down: int, across: int) -> jax.Array:
    """Turn blocks of down x across pixels into channels; pixels left over at the edges are cut."""
    if down == across == 1:
        return images
    *lead, height, width, channels = images.shape
    height, width = height // down, width // across
    images = images[..., : height * down, : width * across, :]
    images = images.reshape(*lead, height, down, width, across, channels)
    images = jnp.swapaxes(images, -4, -3)
    return images.reshape(*lead, height, width, down * across * channels)


def _folded_weights(weights: jax.Array, down: int, across: int) -> jax.Array:
    """The kernel for folded images."""
    rows, columns, channels, features = weights.shape
    rows, columns = rows // down, columns // across
    weights = weights.reshape(rows, down, columns, across, channels, features)
    return weights.transpose(0, 2, 1, 3, 4, 5).reshape(rows, columns, -1, features)
