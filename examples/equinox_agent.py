"""The same agent as `flax_agent.py` in equinox: PPO in one compiled program.

    python -m examples.equinox_agent                   learns `miniworld-hallway` on a CPU
    jaxenstein score runs/own/equinox_agent-miniworld-hallway-0.json

This file defines the network; `recurrent_ppo.py` has the algorithm, `own_training.py` flags, logs
and evaluation. Needs pip install equinox optax.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import equinox as eqx  # pyright: ignore[reportMissingImports]
import jax
import jax.numpy as jnp

import jaxenstein
from examples.own_training import make_env, parse, run


class Patches(eqx.Module):
    """A convolution of patches without overlap, with `jaxenstein.patch_convolution`.

    `eqx.nn.Conv2d` takes many times as long on a CPU (docs/faq.md).
    """

    weights: jax.Array
    bias: jax.Array

    def __init__(self, side: int, channels: int, features: int, key: jax.Array) -> None:
        """Initialise the weights."""
        initial = jax.nn.initializers.lecun_normal()
        self.weights = initial(key, (side, side, channels, features))
        self.bias = jnp.zeros(features)

    def __call__(self, images: jax.Array) -> jax.Array:
        """Map float32[..., height, width, channels] to float32[..., rows, columns, features]."""
        side = self.weights.shape[0]
        return jaxenstein.patch_convolution(images, self.weights, side, "SAME") + self.bias


class Network(eqx.Module):
    """Image patches, a GRU, a policy and a value."""

    patches: Patches
    features: eqx.nn.Linear
    cell: eqx.nn.GRUCell
    policy: eqx.nn.MLP
    value: eqx.nn.MLP

    def __init__(self, shape: Sequence[int], actions: int, hidden: int, key: jax.Array) -> None:
        """Initialise the weights for images of a shape."""
        keys, (height, width, channels) = jax.random.split(key, 5), shape
        size = -(-height // 4) * -(-width // 4) * 32
        self.patches = Patches(4, channels, 32, keys[0])
        self.features = eqx.nn.Linear(size, hidden, key=keys[1])
        self.cell = eqx.nn.GRUCell(hidden, hidden, key=keys[2])
        self.policy = eqx.nn.MLP(hidden, actions, hidden, 1, key=keys[3])
        self.value = eqx.nn.MLP(hidden, "scalar", hidden, 1, key=keys[4])

    def __call__(self, memory: jax.Array, images: jax.Array, first: jax.Array) -> Any:
        """See `examples.recurrent_ppo.Network`; images are uint8[T, N, H, W, C]."""
        each = lambda layer: jax.vmap(jax.vmap(layer))  # noqa: E731
        # Subtract the mean of all frames and increase the contrast.
        x = jax.nn.relu(self.patches(10 * (images.astype(jnp.float32) / 255 - 0.3)))
        x = jax.nn.relu(each(self.features)(x.reshape(*x.shape[:2], -1)))

        def step(memory: jax.Array, seen: tuple[jax.Array, jax.Array]) -> Any:
            features, first = seen
            memory = jax.vmap(self.cell)(features, jnp.where(first[:, None], 0.0, memory))
            return memory, memory

        memory, x = jax.lax.scan(step, memory, (x, first))
        return memory, each(self.policy)(x), each(self.value)(x)


def save(path: Path, weights: Any) -> None:
    """Write a checkpoint."""
    eqx.tree_serialise_leaves(path.with_suffix(".eqx"), weights)


def load(path: Path, like: Any) -> Any:
    """Read a checkpoint with the structure of `like`."""
    return eqx.tree_deserialise_leaves(path.with_suffix(".eqx"), like)


def make_network(env: Any, params: Any, hidden: int, key: jax.Array) -> tuple[Any, Any]:
    """The network of an environment as a function, and its initial weights."""
    obs, _ = jax.eval_shape(env.reset, key, params)
    model = Network(obs.shape, env.num_actions, hidden, key)
    # Small initial logits make all actions equally likely.
    model = eqx.tree_at(lambda m: m.policy.layers[-1].weight, model, replace_fn=lambda w: w / 100)
    weights, rest = eqx.partition(model, eqx.is_array)
    return lambda weights, *seen: eqx.combine(weights, rest)(*seen), weights


def main(argv: Sequence[str] | None = None) -> tuple[Any, jaxenstein.Results]:
    """Train and evaluate; return the weights and the results."""
    options = parse("A recurrent agent in equinox.", argv)
    env, params = make_env(options)
    network, weights = make_network(env, params, options.hidden, jax.random.key(options.seed))
    return run(options, (env, params), network, weights, save, "equinox_agent")


if __name__ == "__main__":
    main()
