"""An agent with memory in flax: PPO in one compiled program, checkpoints, evaluation.

    python -m examples.flax_agent                      learns `miniworld-hallway` on a CPU
    jaxenstein score runs/own/flax_agent-miniworld-hallway-0.json

This file defines the network; `recurrent_ppo.py` has the algorithm, `own_training.py` flags, logs
and evaluation. Needs pip install 'jaxenstein[baselines]'. Also logs to TensorBoard (tensorboardX)
and Weights & Biases (offline) if they are installed.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import flax.linen as nn
import flax.serialization
import jax
import jax.numpy as jnp

import jaxenstein
from examples.own_training import make_env, parse, run
from jaxenstein.baselines import PatchConvolution


class Cell(nn.Module):
    """A GRU that clears its memory at the start of an episode."""

    hidden: int

    @nn.compact
    def __call__(self, memory: jax.Array, seen: tuple[jax.Array, jax.Array]) -> Any:
        """The next memory float32[N, hidden], twice, from features [N, F] and bool[N]."""
        features, first = seen
        memory = jnp.where(first[:, None], 0.0, memory)
        return nn.GRUCell(self.hidden)(memory, features)


class Network(nn.Module):
    """Image patches, a GRU, a policy and a value."""

    actions: int
    hidden: int

    @nn.compact
    def __call__(self, memory: jax.Array, images: jax.Array, first: jax.Array) -> Any:
        """See `examples.recurrent_ppo.Network`; images are uint8[T, N, H, W, C]."""
        # Subtract the mean of all frames and increase the contrast.
        x = 10 * (images.astype(jnp.float32) / 255 - 0.3)
        # `nn.Conv` takes many times as long on a CPU (docs/faq.md).
        x = nn.relu(PatchConvolution(32, kernel_size=4, strides=4)(x))
        x = nn.relu(nn.Dense(self.hidden)(x.reshape(*x.shape[:2], -1)))
        core = nn.scan(Cell, variable_broadcast="params", split_rngs={"params": False})
        memory, x = core(self.hidden)(memory, (x, first))
        small = nn.initializers.orthogonal(0.01)
        policy = nn.Dense(self.actions, kernel_init=small)(nn.relu(nn.Dense(self.hidden)(x)))
        value = nn.Dense(1, kernel_init=small)(nn.relu(nn.Dense(self.hidden)(x)))
        return memory, policy, value[..., 0]


def save(path: Path, weights: Any) -> None:
    """Write a checkpoint."""
    path.with_suffix(".msgpack").write_bytes(flax.serialization.to_bytes(weights))


def load(path: Path, like: Any) -> Any:
    """Read a checkpoint with the structure of `like`."""
    return flax.serialization.from_bytes(like, path.with_suffix(".msgpack").read_bytes())


def make_network(env: Any, params: Any, hidden: int, key: jax.Array) -> tuple[Any, Any]:
    """The network of an environment as a function, and its initial weights."""
    module = Network(env.num_actions, hidden)
    obs, _ = jax.eval_shape(env.reset, key, params)
    blank = jnp.zeros((1, hidden)), jnp.zeros((1, 1, *obs.shape)), jnp.ones((1, 1), bool)
    return module.apply, jax.jit(module.init)(key, *blank)


def main(argv: Sequence[str] | None = None) -> tuple[Any, jaxenstein.Results]:
    """Train and evaluate; return the weights and the results."""
    options = parse("A recurrent agent in flax.", argv)
    env, params = make_env(options)
    network, weights = make_network(env, params, options.hidden, jax.random.key(options.seed))
    return run(options, (env, params), network, weights, save, "flax_agent")


if __name__ == "__main__":
    main()
