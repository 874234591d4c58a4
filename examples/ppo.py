"""PPO with the JAX interface: rollouts, resets and updates are one compiled program.

    python examples/ppo.py                            a small room, 40 s on two cores
    python examples/ppo.py --env simple --updates 300

It needs only jax and jaxenstein; the network and Adam are in this file. The style is that of
PureJaxRL (Lu et al., "Discovered Policy Optimisation", 2022), the algorithm PPO (Schulman et al.,
arXiv:1707.06347) with generalised advantage estimation (arXiv:1506.02438).
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

import jaxenstein

# The agent starts anywhere with any heading, and has to find the goal in the corner.
ROOM = """
#######
#SSSSS#
#SSSSS#
#SS#SS#
#SSSSS#
#SSSSG#
#######
"""


class Settings(NamedTuple):
    """Hyperparameters."""

    envs: int = 32
    steps: int = 128
    updates: int = 60
    epochs: int = 4
    minibatches: int = 8
    learning_rate: float = 1e-3
    gae_lambda: float = 0.95
    clip: float = 0.2
    entropy_cost: float = 0.01
    value_cost: float = 0.5
    largest_gradient: float = 0.5


class Transition(NamedTuple):
    """A step of N environments, or a trajectory with leading axes [T, N]."""

    observation: jax.Array
    action: jax.Array
    log_prob: jax.Array
    value: jax.Array
    reward: jax.Array
    terminated: jax.Array
    ended: jax.Array
    chosen: jax.Array


class Report(NamedTuple):
    """Statistics of the episodes that ended in each update; means are NaN if none ended."""

    episodes: jax.Array
    mean_return: jax.Array
    mean_length: jax.Array


def init_network(key: jax.Array, shape: Sequence[int], num_actions: int) -> dict[str, jax.Array]:
    """Orthogonal initial weights of a small convolutional network with policy and value."""
    height, width, channels = shape
    layers = {
        "conv1": (4, 4, channels, 16, 2**0.5),
        "conv2": (2, 2, 16, 32, 2**0.5),
        "dense": (-(-height // 8) * -(-width // 8) * 32, 128, 2**0.5),
        "policy": (128, num_actions, 0.01),
        "value": (128, 1, 1.0),
    }
    weights = {}
    keys = jax.random.split(key, len(layers))
    for layer_key, (name, (*size, gain)) in zip(keys, layers.items(), strict=True):
        weights[name] = jax.nn.initializers.orthogonal(gain)(layer_key, size, jnp.float32)
        weights[f"{name}_bias"] = jnp.zeros(size[-1])
    return weights


def apply_network(weights: dict[str, jax.Array], images: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Map images uint8[B, H, W, C] to logits float32[B, actions] and values float32[B]."""

    def dense(name: str, x: jax.Array) -> jax.Array:
        return x @ weights[name] + weights[f"{name}_bias"]

    def convolution(name: str, x: jax.Array, stride: int) -> jax.Array:
        x = jaxenstein.patch_convolution(x, weights[name], stride, "SAME")
        return x + weights[f"{name}_bias"]

    x = images.astype(jnp.float32) / 255
    # In compiled training on a CPU, gradients of `jax.lax.conv`, and of the layers of flax and
    # equinox that call it, take many times as long (docs/faq.md).
    x = jax.nn.relu(convolution("conv1", x, 4))
    x = jax.nn.relu(convolution("conv2", x, 2))
    x = jax.nn.relu(dense("dense", x.reshape(len(x), -1)))
    return dense("policy", x), dense("value", x)[:, 0]


def advantages(
    values: jax.Array,
    reward: jax.Array,
    terminated: jax.Array,
    ended: jax.Array,
    discount: jax.Array | float,
    gae_lambda: float,
) -> jax.Array:
    """Generalised advantage estimates float32[T, N].

    Args:
        values: float32[T + 1, N], values of the observations before each step and after the last
            one. At the end of an episode, the value must be that of its last observation.
        reward: float32[T, N].
        terminated: bool[T, N], whether the task ended the episode.
        ended: bool[T, N], whether the task or the time limit ended the episode.
        discount: the discount factor.
        gae_lambda: lambda of generalised advantage estimation.
    """
    # After a truncation, the value of the last observation stands for the rest of the episode.
    # After a termination, there are no more rewards.
    errors = reward + discount * values[1:] * ~terminated - values[:-1]

    def back(later: jax.Array, step: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, jax.Array]:
        error, ended = step
        advantage = error + discount * gae_lambda * ~ended * later
        return advantage, advantage

    return jax.lax.scan(back, jnp.zeros_like(errors[0]), (errors, ended), reverse=True)[1]


def loss(
    weights: dict[str, jax.Array], batch: tuple[Transition, jax.Array], settings: Settings
) -> jax.Array:
    """PPO's clipped loss for a batch of transitions and their advantages."""
    past, advantage = batch
    logits, value = apply_network(weights, past.observation)
    log_probs = jax.nn.log_softmax(logits)
    log_prob = jnp.take_along_axis(log_probs, past.action[:, None], 1)[:, 0]
    entropy = -jnp.sum(jnp.exp(log_probs) * log_probs, axis=1)

    def mean(x: jax.Array) -> jax.Array:
        # Leave out steps that only reset: their action had no effect.
        return jnp.sum(x * past.chosen) / jnp.maximum(jnp.sum(past.chosen), 1)

    centred = advantage - mean(advantage)
    normal = centred / (jnp.sqrt(mean(centred**2)) + 1e-8)
    ratio = jnp.exp(log_prob - past.log_prob)
    clipped = jnp.clip(ratio, 1 - settings.clip, 1 + settings.clip)
    policy_loss = -mean(jnp.minimum(ratio * normal, clipped * normal))
    value_loss = mean((value - past.value - advantage) ** 2) / 2
    return policy_loss + settings.value_cost * value_loss - settings.entropy_cost * mean(entropy)


class Adam(NamedTuple):
    """Adam's running means (Kingma and Ba, arXiv:1412.6980)."""

    mean: Any
    square: Any
    steps: jax.Array


def descend(weights: Any, adam: Adam, gradient: Any, settings: Settings) -> tuple[Any, Adam]:
    """One step of Adam, with the gradient clipped to the norm `largest_gradient`."""
    norm = jnp.sqrt(sum(jnp.sum(g**2) for g in jax.tree.leaves(gradient)))
    scale = jnp.minimum(1, settings.largest_gradient / (norm + 1e-6))
    gradient = jax.tree.map(lambda g: g * scale, gradient)
    steps = adam.steps + 1
    mean = jax.tree.map(lambda m, g: 0.9 * m + 0.1 * g, adam.mean, gradient)
    square = jax.tree.map(lambda s, g: 0.999 * s + 0.001 * g**2, adam.square, gradient)
    rate = settings.learning_rate * jnp.sqrt(1 - 0.999**steps) / (1 - 0.9**steps)
    weights = jax.tree.map(
        lambda w, m, s: w - rate * m / (jnp.sqrt(s) + 1e-5), weights, mean, square
    )
    return weights, Adam(mean, square, steps)


def collect(
    env: Any, params: Any, settings: Settings, weights: Any, start: tuple, key: jax.Array
) -> tuple[tuple, tuple[Transition, dict[str, jax.Array]]]:
    """Let the policy act for `settings.steps` steps from `start`, (observations, states).

    Returns:
        The new `start`, the trajectory, and the infos [T, N].
    """

    def act(start: tuple, key: jax.Array) -> tuple[tuple, tuple]:
        observation, state = start
        action_key, step_key = jax.random.split(key)
        logits, value = apply_network(weights, observation)
        action = jax.random.categorical(action_key, logits)
        log_prob = jnp.take_along_axis(jax.nn.log_softmax(logits), action[:, None], 1)[:, 0]
        after, next_state, reward, terminated, truncated, info = jax.vmap(
            env.step, (0, 0, 0, None)
        )(jax.random.split(step_key, settings.envs), state, action, params)
        ends = terminated, terminated | truncated
        past = Transition(observation, action, log_prob, value, reward, *ends, ~state.done)
        return (after, next_state), (past, info)

    return jax.lax.scan(act, start, jax.random.split(key, settings.steps))


def learn(
    settings: Settings, weights: Any, adam: Adam, data: tuple[Transition, jax.Array], key: jax.Array
) -> tuple[Any, Adam]:
    """Train for some epochs on transitions and advantages [T, N], in minibatches."""
    data = jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), data)

    def descend_once(carry: tuple, rows: jax.Array) -> tuple[tuple, None]:
        weights, adam = carry
        gradient = jax.grad(loss)(weights, jax.tree.map(lambda x: x[rows], data), settings)
        return descend(weights, adam, gradient, settings), None

    keys = jax.random.split(key, settings.epochs)
    orders = jax.vmap(lambda key: jax.random.permutation(key, len(data[1])))(keys)
    rows = orders.reshape(settings.epochs * settings.minibatches, -1)
    return jax.lax.scan(descend_once, (weights, adam), rows)[0]


def make_train(
    env: Any, params: Any, settings: Settings, show: Callable[[Any, Any], None]
) -> Callable[[jax.Array], tuple[Any, Report]]:
    """The whole training as one function of a random key.

    Args:
        env: an environment with `autoreset="next-step"`. The step that ends an episode then
            returns its last observation, whose value is needed, and the next step resets. With
            `"same-step"`, that observation would have to be drawn in addition.
        params: the params.
        settings: the hyperparameters.
        show: called on the host with the number of each update and its `Report`.
    """

    def update(carry: tuple, number: jax.Array) -> tuple[tuple, Report]:
        key, weights, adam, start = carry
        key, act_key, learn_key = jax.random.split(key, 3)
        start, (past, info) = collect(env, params, settings, weights, start, act_key)
        values = jnp.concatenate([past.value, apply_network(weights, start[0])[1][None]])
        advantage = advantages(
            values, past.reward, past.terminated, past.ended, params.discount, settings.gae_lambda
        )
        weights, adam = learn(settings, weights, adam, (past, advantage), learn_key)
        episodes = jnp.sum(past.ended)
        report = Report(
            episodes,
            jnp.sum(info["episode_return"] * past.ended) / episodes,
            jnp.sum(info["episode_length"] * past.ended) / episodes,
        )
        jax.debug.callback(show, number, report)
        return (key, weights, adam, start), report

    def train(key: jax.Array) -> tuple[Any, Report]:
        key, network_key, reset_key = jax.random.split(key, 3)
        reset_keys = jax.random.split(reset_key, settings.envs)
        start = jax.vmap(env.reset, (0, None))(reset_keys, params)
        weights = init_network(network_key, start[0].shape[1:], env.num_actions)
        zeros = jax.tree.map(jnp.zeros_like, weights)
        carry = key, weights, Adam(zeros, zeros, jnp.int32(0)), start
        carry, report = jax.lax.scan(update, carry, jnp.arange(settings.updates))
        return carry[1], report

    return train


def main(argv: Sequence[str] | None = None) -> tuple[Any, Report]:
    """Train, print the mean return of each update, and return the weights and the curve."""
    parser = argparse.ArgumentParser(description="PPO in one compiled program.")
    parser.add_argument("--env", help="an id of `jaxenstein list` (default: a small room)")
    parser.add_argument("--size", type=int, default=32, help="pixels a side (default 32)")
    parser.add_argument("--limit", type=int, help="steps in an episode")
    parser.add_argument("--seed", type=int, default=0)
    for name in ("envs", "steps", "updates"):
        default = Settings._field_defaults[name]
        parser.add_argument(f"--{name}", type=int, default=default, help=f"(default {default})")
    options = parser.parse_args(argv)
    camera = {"height": options.size, "width": options.size, "autoreset": "next-step"}
    if options.env is None:
        env, params = jaxenstein.from_ascii(ROOM, **camera)
        # Twice the usual stride, so that a random policy sometimes finds the goal.
        params = params.replace(max_steps_in_episode=100, move_distance=0.3, turn_angle=math.pi / 6)
    else:
        env, params = jaxenstein.make(options.env, **camera)
    if options.limit is not None:
        params = params.replace(max_steps_in_episode=options.limit)
    settings = Settings(envs=options.envs, steps=options.steps, updates=options.updates)

    def show(number: Any, report: Report) -> None:
        steps = (int(number) + 1) * settings.envs * settings.steps
        print(
            f"{steps:>9,} steps: return {report.mean_return:.3f}, length "
            f"{report.mean_length:.0f}, {int(report.episodes)} episodes",
            flush=True,
        )

    train = jax.jit(make_train(env, params, settings, show))
    return jax.block_until_ready(train(jax.random.key(options.seed)))


if __name__ == "__main__":
    main()
