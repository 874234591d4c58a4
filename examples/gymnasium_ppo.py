"""PPO in one file on Gymnasium's interface, with numpy buffers and a small network in JAX.

    python examples/gymnasium_ppo.py
    python examples/gymnasium_ppo.py --id jaxenstein/key-door-v0 --updates 500

Schulman et al., "Proximal Policy Optimization Algorithms" (2017), with generalised advantage
estimation. It runs on any vector environment of images and discrete actions that resets in the
next step, which is what `gymnasium.make_vec` makes; `jaxenstein` is imported for its ids alone.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
import time
from collections.abc import Callable
from typing import Any

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np

import jaxenstein  # noqa: F401  (registers its environments)


@dataclasses.dataclass(frozen=True)
class Settings:
    """Numbers of the training; `steps` is how many each environment takes between updates."""

    updates: int = 120
    steps: int = 64
    epochs: int = 4
    minibatches: int = 4
    learning_rate: float = 1e-3
    discount: float = 0.99
    decay: float = 0.95
    clip: float = 0.2
    entropy: float = 0.02
    value: float = 0.5
    max_gradient: float = 0.5
    units: int = 64
    seed: int = 0


def init_network(rng: np.random.Generator, inputs: int, units: int, actions: int) -> Any:
    """Two layers that the heads of the policy and of the value share."""

    def layer(size_in: int, size_out: int, scale: float) -> dict[str, jax.Array]:
        weights = rng.normal(0, scale / np.sqrt(size_in), (size_in, size_out))
        return {"w": jnp.asarray(weights, jnp.float32), "b": jnp.zeros(size_out, jnp.float32)}

    return {
        "one": layer(inputs, units, 1.5),
        "two": layer(units, units, 1.5),
        "policy": layer(units, actions, 0.01),
        "value": layer(units, 1, 1.0),
    }


def network(params: Any, observations: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Log probabilities [B, actions] and values [B] for uint8 images [B, ...]."""

    def linear(name: str, x: jax.Array) -> jax.Array:
        return x @ params[name]["w"] + params[name]["b"][None]

    x = observations.reshape(observations.shape[0], -1).astype(jnp.float32) / 255 - 0.5
    x = jnp.tanh(linear("two", jnp.tanh(linear("one", x))))
    return jax.nn.log_softmax(linear("policy", x)), linear("value", x)[:, 0]


@jax.jit
def act(params: Any, observations: jax.Array, key: jax.Array) -> tuple[jax.Array, ...]:
    """Draw actions: their numbers, log probabilities, and the values."""
    log_probs, values = network(params, observations)
    actions = jax.random.categorical(key, log_probs)
    return actions, jnp.take_along_axis(log_probs, actions[:, None], 1)[:, 0], values


@dataclasses.dataclass
class Rollout:
    """Arrays [T, N] of T steps of N environments; observations and values have T + 1 rows."""

    observations: np.ndarray
    values: np.ndarray
    actions: np.ndarray
    log_probs: np.ndarray
    rewards: np.ndarray
    terminated: np.ndarray
    over: np.ndarray
    counts: np.ndarray


def new_rollout(steps: int, envs: Any) -> Rollout:
    """Room for a rollout."""
    shape, space = (steps, envs.num_envs), envs.single_observation_space
    numbers = [np.zeros(shape, dtype) for dtype in (int, np.float32, np.float32, bool, bool, bool)]
    observations = np.zeros((steps + 1, envs.num_envs, *space.shape), space.dtype)
    return Rollout(observations, np.zeros((steps + 1, envs.num_envs), np.float32), *numbers)


def collect(
    envs: Any, params: Any, rollout: Rollout, last: Any, key: jax.Array
) -> tuple[Any, list[float]]:
    """Fill the rollout.

    Args:
        envs: a vector environment that resets in the next step.
        params: of the network.
        rollout: is written to.
        last: the newest observations and bool[N], where they are the last ones of an episode.
        key: for the actions.

    Returns:
        A new `last`, and the returns of the episodes that ended.
    """
    returns: list[float] = []
    observations, over = last
    steps = len(rollout.actions)
    for t, step_key in enumerate(jax.random.split(key, steps + 1)):
        rollout.observations[t] = observations
        actions, log_probs, values = map(np.asarray, act(params, observations, step_key))
        rollout.values[t] = values
        if t == steps:
            break
        # After an end this step resets: it ignores the action and is nothing to learn from.
        rollout.counts[t] = ~over
        observations, rewards, terminated, truncated, infos = envs.step(actions)
        over = terminated | truncated
        rollout.actions[t], rollout.log_probs[t], rollout.rewards[t] = actions, log_probs, rewards
        rollout.terminated[t], rollout.over[t] = terminated, over
        returns.extend(infos["episode_return"][over].tolist())
    return (observations, over), returns


def advantages(rollout: Rollout, discount: float, decay: float) -> np.ndarray:
    """float32[T, N]: generalised advantage estimates.

    The observation after step t is the last one of an episode that ended there, since the reset
    comes later. So its value stands for the rewards that a time limit cut off; where the task
    itself ended there are none. Nothing flows back from the next episode.
    """
    result = np.zeros_like(rollout.rewards)
    after = np.zeros_like(rollout.rewards[0])
    for t in reversed(range(len(result))):
        ahead = discount * rollout.values[t + 1] * ~rollout.terminated[t]
        delta = rollout.rewards[t] + ahead - rollout.values[t]
        after = delta + discount * decay * after * ~rollout.over[t]
        result[t] = after
    return result


def loss(params: Any, batch: dict[str, jax.Array], settings: Settings) -> jax.Array:
    """The clipped objective, the error of the values, and the entropy."""
    log_probs, values = network(params, batch["observations"])
    chosen = jnp.take_along_axis(log_probs, batch["actions"][:, None], 1)[:, 0]
    ratio = jnp.exp(chosen - batch["log_probs"])
    clipped = jnp.clip(ratio, 1 - settings.clip, 1 + settings.clip)
    policy = -jnp.minimum(ratio * batch["advantages"], clipped * batch["advantages"])
    error = 0.5 * jnp.square(values - batch["targets"])
    entropy = -jnp.sum(jnp.exp(log_probs) * log_probs, -1)
    each = policy + settings.value * error - settings.entropy * entropy
    counts = batch["counts"].astype(jnp.float32)
    return jnp.sum(each * counts) / jnp.maximum(jnp.sum(counts), 1)


def init_adam(params: Any) -> tuple[Any, Any, jax.Array]:
    """First and second moments, and the number of updates."""
    zeros = jax.tree.map(jnp.zeros_like, params)
    return zeros, zeros, jnp.float32(0)


@functools.partial(jax.jit, static_argnames="settings")
def improve(params: Any, adam: Any, batch: dict[str, jax.Array], settings: Settings) -> Any:
    """One step of Adam (Kingma and Ba, 2015) along a gradient of limited norm."""
    value, gradient = jax.value_and_grad(loss)(params, batch, settings)
    norm = jnp.sqrt(sum(jnp.sum(jnp.square(leaf)) for leaf in jax.tree.leaves(gradient)))
    shrink = jnp.minimum(1.0, settings.max_gradient / (norm + 1e-6))
    first, second, count = adam
    count = count + 1
    first = jax.tree.map(lambda m, g: 0.9 * m + 0.1 * g * shrink, first, gradient)
    second = jax.tree.map(lambda v, g: 0.999 * v + 0.001 * jnp.square(g * shrink), second, gradient)
    rate = settings.learning_rate * jnp.sqrt(1 - 0.999**count) / (1 - 0.9**count)
    params = jax.tree.map(
        lambda p, m, v: p - rate * m / (jnp.sqrt(v) + 1e-5), params, first, second
    )
    return params, (first, second, count), value


def learn(
    params: Any, adam: Any, rollout: Rollout, settings: Settings, rng: np.random.Generator
) -> Any:
    """Some epochs over the rollout in shuffled minibatches: params, Adam's state, mean loss."""
    found = advantages(rollout, settings.discount, settings.decay)
    flat = {
        "observations": rollout.observations[:-1],
        "actions": rollout.actions,
        "log_probs": rollout.log_probs,
        "targets": found + rollout.values[:-1],
        "advantages": (found - found[rollout.counts].mean()) / (found[rollout.counts].std() + 1e-8),
        "counts": rollout.counts,
    }
    flat = {name: array.reshape(-1, *array.shape[2:]) for name, array in flat.items()}
    losses = []
    for _ in range(settings.epochs):
        order = rng.permutation(len(flat["actions"]))
        for chosen in np.array_split(order, settings.minibatches):
            batch = {name: array[chosen] for name, array in flat.items()}
            params, adam, value = improve(params, adam, batch, settings)
            losses.append(value)
    return params, adam, float(np.mean(losses))


def train(envs: Any, settings: Settings, report: Callable[[str], None] = print) -> Any:
    """Train: the params of the network, and the returns of the episodes of each update."""
    assert envs.metadata["autoreset_mode"] == gymnasium.vector.AutoresetMode.NEXT_STEP
    rng = np.random.default_rng(settings.seed)
    inputs = int(np.prod(envs.single_observation_space.shape))
    params = init_network(rng, inputs, settings.units, int(envs.single_action_space.n))
    adam = init_adam(params)
    rollout = new_rollout(settings.steps, envs)
    last = envs.reset(seed=settings.seed)[0], np.zeros(envs.num_envs, bool)
    history = []
    start = time.perf_counter()
    for update, key in enumerate(jax.random.split(jax.random.key(settings.seed), settings.updates)):
        last, returns = collect(envs, params, rollout, last, key)
        params, adam, value = learn(params, adam, rollout, settings, rng)
        history.append(returns)
        if (update + 1) % 10 == 0:
            speed = (update + 1) * rollout.actions.size / (time.perf_counter() - start)
            recent = [episode for returns in history[-10:] for episode in returns]
            mean = f"{np.mean(recent):.2f}" if recent else "-"
            report(
                f"update {update + 1}: return {mean} ({len(recent)} episodes), "
                f"loss {value:.3f}, {speed:,.0f} steps/s"
            )
    return params, history


def main() -> None:
    """Train from the command line."""
    parser = argparse.ArgumentParser(description="PPO on a vector environment of Gymnasium.")
    parser.add_argument("--id", default="jaxenstein/simple-v0")
    parser.add_argument("--envs", type=int, default=32)
    parser.add_argument("--updates", type=int, default=Settings.updates)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    # Long steps and quarter turns, as in a grid world, so that a minute of training is enough.
    envs = gymnasium.make_vec(
        options.id,
        num_envs=options.envs,
        height=24,
        width=32,
        observation="gray",
        move_distance=0.5,
        turn_angle=np.pi / 2,
        max_steps_in_episode=100,
    )
    train(envs, Settings(updates=options.updates, seed=options.seed))
    envs.close()


if __name__ == "__main__":
    main()
