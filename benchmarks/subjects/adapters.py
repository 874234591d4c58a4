"""Gymnasium's adapters as subjects.

- `adapter-KIND-B` beside the native loop `adapter-loop-B`: `my-way-home` at 64x64;
- `gymnasium`: one environment of `gymnasium.make` with the default settings of JAX; options `id`,
  `size` and `frame_skip`;
- `start`: a new process until the frame of the first step of that environment.

All have the same random policy. It reads one pixel of every frame, so that frames are really
computed.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from typing import Any

import jax
import numpy as np

from benchmarks.subjects.common import (
    ENVIRONMENT_ID,
    SIZE,
    Builder,
    Chunk,
    Options,
    Subjects,
    frame_skip,
    image_size,
    random_loop,
)
from benchmarks.subjects.own import own_environment
from benchmarks.subjects.peers import gymnasium_loop

MIDDLE = SIZE // 2
FIRST_STEP = """
import sys, gymnasium, jaxenstein
env = gymnasium.make(sys.argv[1])
env.reset(seed=0)
env.step(0)
"""


def on_host(build: Callable[[Any, Any, int], Callable[[Any], Any]]) -> Builder:
    """A subject for an adapter that is called from Python.

    Args:
        build: takes environment, params and B; returns a function from int32[B] actions to frames
            uint8[B, H, W, 3].
    """

    def prepared(batch: int, options: Options) -> Chunk:
        # Dispatch to another thread only costs time, since the loop waits for each frame. This must
        # be set before JAX runs.
        jax.config.update("jax_cpu_enable_async_dispatch", False)
        env, params = own_environment(options)
        step, calls = build(env, params, batch), max(8, 1024 // batch)
        return random_loop(
            lambda actions: step(actions)[:, MIDDLE, MIDDLE, 0],
            env.num_actions, calls, batch, batch,
        )  # fmt: skip

    return prepared


def loop(env: Any, params: Any, batch: int) -> Any:
    """Native environments under `jax.vmap`, with one jitted call per step."""

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


def gymnasium_vector(env: Any, params: Any, batch: int) -> Any:
    """Gymnasium's vector interface."""
    from jaxenstein.adapters.gymnasium_vector import GymnasiumVectorEnv

    adapter = GymnasiumVectorEnv(env, params, batch, autoreset_mode="SameStep")
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


def gymnasium_default(batch: int, options: Options) -> Chunk:
    """One environment as `gymnasium.make` builds it."""
    import gymnasium

    assert batch == 1
    width, height = image_size(options)
    skip = frame_skip(options)
    env = gymnasium.make(_name(options), width=width, height=height, frame_skip=skip)
    return gymnasium_loop(env, lambda obs: obs, lambda frame: frame)


def start(batch: int, options: Options) -> Chunk:
    """New processes, each of which makes one step."""
    assert batch == 1

    def chunk() -> int:
        subprocess.run([sys.executable, "-c", FIRST_STEP, _name(options)], check=True)
        return 1

    return chunk


def _name(options: Options) -> str:
    """The name of the environment for `gymnasium.make`."""
    return f"jaxenstein/{options.get('id', ENVIRONMENT_ID)}-v0"


SUBJECTS: Subjects = {
    "gymnasium": gymnasium_default,
    "start": start,
    "adapter-loop": on_host(loop),
    "adapter-gymnasium-single": on_host(gymnasium_single),
    "adapter-gymnasium-same-step": on_host(gymnasium_vector),
}
