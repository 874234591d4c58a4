"""The adapters as subjects, `adapter-KIND-B`, beside the native loop `adapter-loop-B`.

All play `my-way-home` at 64x64 under the same random policy, which reads one pixel of every
environment's frame: an adapter that only promised its frames would not be measured.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.subjects.common import (
    SIZE,
    STEPS_A_CALL,
    Builder,
    Chunk,
    Options,
    Subjects,
    random_loop,
)
from benchmarks.subjects.own import own_environment, repeat

MIDDLE = SIZE // 2


def on_host(
    build: Callable[[Any, Any, int], Callable[[Any], Any]], convert: Any = np.asarray
) -> Builder:
    """The subject of an adapter that is called from Python.

    Args:
        build: of environment, params and B; gives what steps with int32[B] and returns
            uint8[B, H, W, 3].
        convert: makes of NumPy's actions what that takes.
    """

    def prepared(batch: int, options: Options) -> Chunk:
        # Waiting for each frame, one only pays for another thread; JAX must not run before.
        jax.config.update("jax_cpu_enable_async_dispatch", False)
        env, params = own_environment(options)
        step, calls = build(env, params, batch), max(8, 1024 // batch)
        return random_loop(
            lambda actions: step(actions)[:, MIDDLE, MIDDLE, 0],
            env.num_actions, calls, batch, batch, convert=convert,
        )  # fmt: skip

    return prepared


def loop(env: Any, params: Any, batch: int) -> Any:
    """The native environments under `jax.vmap`, one jitted call a step."""

    @jax.jit
    def step(key: jax.Array, state: Any, actions: Any) -> Any:
        key, step_key = jax.random.split(key)
        keys = jax.random.split(step_key, batch)
        return key, *jax.vmap(env.step, (0, 0, 0, None))(keys, state, actions, params)

    key = jax.random.key(0)
    reset = jax.jit(lambda keys: jax.vmap(env.reset, (0, None))(keys, params))
    _, state = reset(jax.random.split(key, batch))

    def advance(actions: np.ndarray) -> np.ndarray:
        nonlocal key, state
        key, observation, state, *_ = step(key, state, actions)
        return np.asarray(observation)

    return advance


def gymnasium_vector(env: Any, params: Any, batch: int, mode: str) -> Any:
    """Gymnasium's vector interface."""
    from jaxenstein.adapters.gymnasium_vector import GymnasiumVectorEnv

    adapter = GymnasiumVectorEnv(env, params, batch, autoreset_mode=mode)
    adapter.reset(seed=0)
    return lambda actions: adapter.step(actions)[0]


def gymnasium_single(env: Any, params: Any, batch: int) -> Any:
    """Gymnasium's plain interface: one environment, reset by the loop."""
    from jaxenstein.adapters.gymnasium import GymnasiumEnv

    assert batch == 1
    adapter = GymnasiumEnv(env, params)

    def step(actions: np.ndarray) -> np.ndarray:
        observation, _, terminated, truncated, _ = adapter.step(int(actions[0]))
        if terminated or truncated:
            observation, _ = adapter.reset()
        return observation[None]

    adapter.reset(seed=0)
    return step


def torch(env: Any, params: Any, batch: int) -> Any:
    """Torch: the policy computes on tensors."""
    import torch as package  # pyright: ignore[reportMissingImports]

    from jaxenstein.adapters.torch import TorchBatch

    package.set_num_threads(1)
    adapter = TorchBatch(env, params, batch)
    adapter.reset(0)
    return lambda actions: adapter.step(actions).observation


def to_tensor(actions: np.ndarray) -> Any:
    """Actions as Torch takes them."""
    import torch as package  # pyright: ignore[reportMissingImports]

    return package.from_numpy(actions)


def sb3(env: Any, params: Any, batch: int) -> Any:
    """Stable-Baselines3's `VecEnv`."""
    from jaxenstein.adapters.sb3 import SB3VecEnv

    adapter = SB3VecEnv(env, params, batch)
    adapter.seed(0)
    adapter.reset()
    return lambda actions: adapter.step(actions)[0]


def scan_over(batch: int, reset: Any, step: Any, count: int) -> Chunk:
    """A compiled scan over an adapter that lives in JAX, in the manner of `random_rollout`.

    Args:
        batch: B.
        reset: of keys [B]: states and images [B, H, W, 3].
        step: of keys, states and int32[B] actions: states, images and rewards.
        count: number of actions.
    """
    steps = max(1, STEPS_A_CALL // batch)

    def advance(carry: Any, _: None) -> tuple[Any, None]:
        key, state, image, total = carry
        key, policy_key, step_key = jax.random.split(key, 3)
        sampled = jax.random.randint(policy_key, (batch,), 0, count, jnp.int32)
        action = (sampled + image[:, MIDDLE, MIDDLE, 0].astype(jnp.int32)) % count
        state, image, reward = step(jax.random.split(step_key, batch), state, action)
        return (key, state, image, total + reward), None

    rollout = jax.jit(lambda carry: jax.lax.scan(advance, carry, length=steps)[0], donate_argnums=0)
    state, image = jax.jit(reset)(jax.random.split(jax.random.key(0), batch))
    carry = jax.random.key(1), state, image, jnp.zeros(batch, jnp.float32)
    return repeat(rollout, carry, batch * steps)


def gymnax(batch: int, options: Options) -> Chunk:
    """gymnax' contract, of five or six values."""
    from jaxenstein.adapters.gymnax import from_env

    env, params = from_env(*own_environment(options))

    def reset(keys: jax.Array) -> Any:
        return jax.vmap(env.reset, (0, None))(keys, params)[::-1]

    def step(keys: jax.Array, state: Any, action: jax.Array) -> Any:
        values = jax.vmap(env.step, (0, 0, 0, None))(keys, state, action, params)
        return values[1], values[0], values[2]

    return scan_over(batch, reset, step, env.num_actions)


def stoa(batch: int, options: Options) -> Chunk:
    """Stoa's interface, with the resets of the environment inside."""
    from jaxenstein.adapters.stoa import StoaEnvironment

    env = StoaEnvironment(*own_environment(options))

    def reset(keys: jax.Array) -> Any:
        state, first = jax.vmap(env.reset)(keys)
        return state, first.observation

    def step(_: jax.Array, state: Any, action: jax.Array) -> Any:
        state, told = jax.vmap(env.step)(state, action)
        return state, told.observation, told.reward

    return scan_over(batch, reset, step, env.env.num_actions)


SUBJECTS: Subjects = {
    "adapter-loop": on_host(loop),
    "adapter-gymnasium-single": on_host(gymnasium_single),
    **{
        f"adapter-gymnasium-{words}": on_host(functools.partial(gymnasium_vector, mode=mode))
        for words, mode in (("same-step", "SameStep"), ("next-step", "NextStep"))
    },
    "adapter-torch": on_host(torch, to_tensor),
    "adapter-sb3": on_host(sb3),
    "adapter-gymnax": gymnax,
    "adapter-stoa": stoa,
}
