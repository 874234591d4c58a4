"""This project as a subject.

- `scan-B`: a random policy in one compiled scan; options `id`, `size`, and those of `SETTINGS`,
  which other kinds have, too;
- `loop`: one environment, with one call per step;
- `compile`: tracing and compiling a function of one environment; options `id` and `of`, which is
  `reset`, `step` or `observe`;
- `spread-B devices=N`: the scan over simulated devices (`benchmarks/spread.py`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import numpy as np

import jaxenstein
from benchmarks.subjects.common import (
    ENVIRONMENT_ID,
    SIZE,
    STEPS_A_CALL,
    Chunk,
    Options,
    Subjects,
    image_size,
    middle,
    random_loop,
)
from jaxenstein.speed.random_rollout import make_random_rollout

# Options that are settings of the environments.
SETTINGS = ("observation", "look")


def own_environment(options: Options, **settings: Any) -> tuple[Any, Any]:
    """Make the environment from the options."""
    settings["width"], settings["height"] = image_size(options)
    settings |= {name: options[name] for name in SETTINGS if name in options}
    return jaxenstein.make(options.get("id", ENVIRONMENT_ID), **settings)  # type: ignore[arg-type]


def repeat(program: Callable[[Any], Any], carry: Any, count: int) -> Chunk:
    """Repeated calls of a program that maps a carry to the next; each makes `count` steps."""

    def chunk() -> int:
        nonlocal carry
        carry = jax.block_until_ready(program(carry))
        return count

    return chunk


def scan(batch: int, options: Options) -> Chunk:
    """A random policy in a batch of environments, in one compiled scan."""
    env, params = own_environment(options)
    # Fewer steps for larger images, so that calls take about equally long.
    frames = STEPS_A_CALL * SIZE**2 // max(SIZE**2, env.height * env.width)
    steps = max(1, frames // batch)
    rollout, start = make_random_rollout(env, params, batch, steps)
    return repeat(rollout, start(jax.random.key(0)), batch * steps)


def spread(batch: int, options: Options) -> Chunk:
    """The same on several simulated devices, each a thread."""
    from benchmarks.spread import make_mesh, make_spread_rollout

    devices = int(options["devices"])
    jax.config.update("jax_num_cpu_devices", devices)
    steps = max(1, devices * STEPS_A_CALL // batch)
    mesh = make_mesh(jax.devices())
    rollout, start = make_spread_rollout(*own_environment(options), batch, steps, mesh)
    return repeat(rollout, start(np.uint32(0)), batch * steps)


def loop(batch: int, options: Options) -> Chunk:
    """A Python loop over one environment, with one jitted call per step."""
    assert batch == 1
    # Dispatch to another thread only costs time, since the loop waits for each frame.
    jax.config.update("jax_cpu_enable_async_dispatch", False)
    env, params = own_environment(options)

    @jax.jit
    def step(key: jax.Array, state: Any, action: Any) -> Any:
        key, step_key = jax.random.split(key)
        return key, *env.step(step_key, state, action, params)

    key, reset_key = jax.random.split(jax.random.key(0))
    _, state = jax.jit(lambda key: env.reset(key, params))(reset_key)

    def advance(action: int) -> int:
        nonlocal key, state
        key, obs, state, *_ = step(key, state, np.int32(action))
        return middle(np.asarray(obs))

    return random_loop(advance, env.num_actions, 64, 1)


def compiling(batch: int, options: Options) -> Chunk:
    """Tracing and compiling a function of one environment, as if for the first time."""
    assert batch == 1
    env, params = own_environment(options)
    key = jax.random.key(0)
    _, state = jax.eval_shape(env.reset, key, params)
    functions: dict[str, tuple[Any, ...]] = {
        "reset": (env.reset, key, params),
        "step": (env.step, key, state, np.int32(0), params),
        "observe": (env.observe, state, params),
    }
    function, *args = functions[options["of"]]

    def chunk() -> int:
        jax.clear_caches()
        jax.jit(function).lower(*args).compile()
        return 1

    return chunk


SUBJECTS: Subjects = {
    "scan": scan,
    "compile": compiling,
    "loop": loop,
    "spread": spread,
}
