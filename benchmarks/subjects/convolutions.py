"""Updates of an image network in a compiled loop: `convolution-B`, with a batch of B images.

Options: `layer`, one of `LAYERS`; `network`, one of `NETWORKS`; `size` of the images.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import flax.linen as nn
import jax
import jax.numpy as jnp

from benchmarks.subjects.common import Chunk, Options, Subjects, image_size
from benchmarks.subjects.own import repeat
from jaxenstein.baselines import PatchConvolution
from jaxenstein.baselines.networks import NATURE, PATCHES, SMALL

LAYERS: Mapping[str, Callable[..., Any]] = {"flax": nn.Conv, "patches": PatchConvolution}
NETWORKS = {"paper": NATURE, "small": SMALL, "tiny": PATCHES}
UPDATES = 4


class Network(nn.Module):
    """Convolutions, then a layer with one output per image."""

    layer: str
    network: str

    @nn.compact
    def __call__(self, images: jax.Array) -> jax.Array:
        make = LAYERS[self.layer]
        for kernel, stride, features in NETWORKS[self.network]:
            sizes = (kernel, kernel), (stride, stride)
            images = nn.relu(make(features, *sizes, padding="VALID")(images))
        return nn.Dense(1)(images.reshape(len(images), -1))


def convolution(batch: int, options: Options) -> Chunk:
    """Gradient steps in a scan, each on different images."""
    network = Network(options["layer"], options.get("network", "tiny"))
    width, height = image_size(options)
    images = jax.random.uniform(jax.random.key(0), (UPDATES, batch, height, width, 3))

    def loss(params: Any, images: jax.Array) -> jax.Array:
        values: Any = network.apply(params, images)
        return jnp.mean(values**2)

    def update(params: Any, images: jax.Array) -> tuple[Any, None]:
        gradient = jax.grad(loss)(params, images)
        return jax.tree.map(lambda leaf, slope: leaf - 1e-3 * slope, params, gradient), None

    program = jax.jit(lambda params: jax.lax.scan(update, params, images)[0])
    return repeat(program, network.init(jax.random.key(1), images[0]), UPDATES * batch)


SUBJECTS: Subjects = {"convolution": convolution}
