"""PPO on Gymnasium's vector interface, with the network and the update of `ppo.py`.

    python -m examples.gymnasium_ppo
    python -m examples.gymnasium_ppo --id jaxenstein/key-door-v0 --updates 500

It runs on this package's environments with next-step reset, the default of `gymnasium.make_vec`.
Others need other settings in `main`, and a sum of rewards in place of `infos["episode_return"]`.
`jaxenstein` is imported only to register its ids.
"""

from __future__ import annotations

import argparse
import functools
import time
from collections.abc import Callable
from typing import Any

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np

import jaxenstein  # noqa: F401  (registers its environments)
from examples.ppo import (
    Adam,
    Settings,
    Transition,
    advantages,
    apply_network,
    init_network,
    learn,
)

DISCOUNT = 0.99
Last = tuple[np.ndarray, np.ndarray]
"""The newest observations, and bool[N], whether they are the last ones of an episode."""


@jax.jit
def act(weights: Any, observation: jax.Array, key: jax.Array) -> tuple[jax.Array, ...]:
    """Actions, their log-probabilities and values, each [N]."""
    logits, value = apply_network(weights, observation)
    action = jax.random.categorical(key, logits)
    log_prob = jnp.take_along_axis(jax.nn.log_softmax(logits), action[:, None], 1)[:, 0]
    return action, log_prob, value


def collect(
    envs: Any, weights: Any, steps: int, last: Last, key: jax.Array
) -> tuple[Transition, Last, list[float]]:
    """Let the policy act for some steps.

    Returns:
        The trajectory [steps, N], a new `last`, and the returns of the episodes that ended.
    """
    rows, returns = [], list[float]()
    observation, over = last
    for step_key in jax.random.split(key, steps):
        action, log_prob, value = map(np.asarray, act(weights, observation, step_key))
        # After an episode has ended, this step resets and ignores the action: do not learn from it.
        chosen = ~over
        after, reward, terminated, truncated, infos = envs.step(action)
        over = terminated | truncated
        told = np.asarray(reward, np.float32), terminated, over, chosen
        rows.append((observation, action, log_prob, value, *told))
        returns.extend(infos["episode_return"][over].tolist())
        observation = after
    past: Any = [np.stack(part) for part in zip(*rows, strict=True)]
    return Transition(*past), (observation, over), returns


@functools.partial(jax.jit, static_argnums=0)
def improve(
    settings: Settings, weights: Any, adam: Adam, past: Transition, after: Any, key: jax.Array
) -> tuple[Any, Adam]:
    """Learn from a trajectory and the observations `after` it."""
    values = jnp.concatenate([past.value, apply_network(weights, after)[1][None]])
    advantage = advantages(
        values, past.reward, past.terminated, past.ended, DISCOUNT, settings.gae_lambda
    )
    return learn(settings, weights, adam, (past, advantage), key)


def train(
    envs: Any, settings: Settings, seed: int = 0, report: Callable[[str], None] = print
) -> tuple[Any, list[list[float]]]:
    """Train; return the weights, and the returns of the episodes in each update."""
    assert envs.metadata["autoreset_mode"] == gymnasium.vector.AutoresetMode.NEXT_STEP
    key, network_key = jax.random.split(jax.random.key(seed))
    shape = envs.single_observation_space.shape
    weights = init_network(network_key, shape, int(envs.single_action_space.n))
    zeros = jax.tree.map(jnp.zeros_like, weights)
    adam = Adam(zeros, zeros, jnp.int32(0))
    last = envs.reset(seed=seed)[0], np.zeros(envs.num_envs, bool)
    history, start = [], time.perf_counter()
    for update, update_key in enumerate(jax.random.split(key, settings.updates), 1):
        act_key, learn_key = jax.random.split(update_key)
        past, last, returns = collect(envs, weights, settings.steps, last, act_key)
        weights, adam = improve(settings, weights, adam, past, last[0], learn_key)
        history.append(returns)
        if update % 10 == 0:
            speed = update * past.reward.size / (time.perf_counter() - start)
            recent = [episode for returns in history[-10:] for episode in returns]
            mean = f"{np.mean(recent):.2f}" if recent else "-"
            told = f"return {mean} ({len(recent)} episodes), {speed:,.0f} steps/s"
            report(f"update {update}: {told}")
    return weights, history


def main() -> None:
    """Train from the command line."""
    parser = argparse.ArgumentParser(description="PPO on a vector environment of Gymnasium.")
    parser.add_argument("--id", default="jaxenstein/simple-v0")
    parser.add_argument("--envs", type=int, default=32)
    parser.add_argument("--updates", type=int, default=120)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    # Long steps and quarter turns, as in a grid world, so that a minute of training suffices.
    envs = gymnasium.make_vec(
        options.id,
        num_envs=options.envs,
        height=24,
        width=32,
        move_distance=0.5,
        turn_angle=np.pi / 2,
        max_steps_in_episode=100,
    )
    settings = Settings(envs=options.envs, steps=64, updates=options.updates)
    train(envs, settings, options.seed)
    envs.close()


if __name__ == "__main__":
    main()
