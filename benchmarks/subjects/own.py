"""This project as a subject.

- `scan-B`: a random policy in one compiled scan; options `id`, or `map` or `sprites` (`maps.py`),
  `size`, and any of `SETTINGS`, which the other kinds take too;
- `loop`: one environment, one call a step;
- `frames-B`, `keep-B`, `fill-B`: frames alone, frames kept, and only writing as many bytes;
- `reset-B`: resets of a batch in a scan;
- `spread-B devices=N`: the scan over simulated devices (`benchmarks/spread.py`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jaxenstein
from benchmarks.subjects import maps
from benchmarks.subjects.common import (
    ENVIRONMENT_ID,
    FRAMES_KEPT,
    SIZE,
    STEPS_A_CALL,
    Chunk,
    Options,
    Subjects,
    frame_skip,
    image_size,
    middle,
    random_loop,
)
from benchmarks.subjects.frames import make_frames, make_keeping_rollout
from jaxenstein.speed.random_rollout import make_random_rollout

# Options that are settings of the environments, with their types.
SETTINGS: dict[str, Callable[[str], Any]] = {"observation": str, "frame_skip": int, "buttons": str}


def own_environment(options: Options, **settings: Any) -> tuple[Any, Any]:
    """The environment that options name: an id, or a map made to measure."""
    settings["width"], settings["height"] = image_size(options)
    for name, convert in SETTINGS.items():
        if name in options:
            settings[name] = convert(options[name])
    if "map" in options:
        return jaxenstein.from_ascii(maps.rooms(int(options["map"])), **settings)
    if "sprites" in options:
        env, params = jaxenstein.from_ascii(maps.hall(int(options["sprites"])), **settings)
        # Nothing is near enough to be taken or reached: all of it stays in sight.
        return env, params.replace(pickup_radius=-1.0, goal_radius=-1.0)
    return jaxenstein.make(options.get("id", ENVIRONMENT_ID), **settings)  # type: ignore[arg-type]


def repeat(program: Callable[[Any], Any], carry: Any, count: int) -> Chunk:
    """Calls of a program that takes a carry and gives the next, `count` steps each."""

    def chunk() -> int:
        nonlocal carry
        carry = jax.block_until_ready(program(carry))
        return count

    return chunk


def scan(batch: int, options: Options) -> Chunk:
    """The project under a random policy, a batch of environments in one compiled scan."""
    env, params = own_environment(options)
    # Larger images take longer: calls of about one length.
    frames = STEPS_A_CALL * SIZE**2 // max(SIZE**2, env.height * env.width)
    steps = max(1, frames // batch)
    rollout, start = make_random_rollout(env, params, batch, steps)
    return repeat(rollout, start(jax.random.key(0)), batch * steps * frame_skip(options))


def frames(batch: int, options: Options) -> Chunk:
    """Frames alone, drawn of states that a pixel of the frame before moves a little."""
    env, params = own_environment(options)
    steps = max(1, STEPS_A_CALL // batch)
    program = make_frames(env, params, steps)
    reset = jax.jit(jax.vmap(lambda key: env.reset(key, params)))
    obs, state = reset(jax.random.split(jax.random.key(0), batch))
    return repeat(program, (state, obs, jnp.copy(state.position)), batch * steps)


def keep(batch: int, options: Options) -> Chunk:
    """As `scan`, and the frames are kept."""
    steps = max(1, FRAMES_KEPT // batch)
    rollout, start = make_keeping_rollout(*own_environment(options), batch, steps)
    return repeat(rollout, start(jax.random.key(0)), batch * steps * frame_skip(options))


def fill(batch: int, options: Options) -> Chunk:
    """Nothing but writing the bytes of a batch of frames, by NumPy."""
    width, height = image_size(options)
    room, value = np.zeros((batch, height, width, 3), np.uint8), 0
    calls = max(1, STEPS_A_CALL // batch)

    def chunk() -> int:
        nonlocal value
        for _ in range(calls):
            value = (value + 1) % 256
            room.fill(value)
        return calls * batch

    return chunk


def reset(batch: int, options: Options) -> Chunk:
    """Resets of a batch in a compiled scan; a pixel of each frame goes into the next one's key."""
    env, params = own_environment(options)
    steps = max(1, STEPS_A_CALL // 8 // batch)
    resets = jax.vmap(lambda key: env.reset(key, params))

    def again(carry: Any, _: None) -> tuple[Any, None]:
        key, (obs, _) = carry
        seen = sum(jnp.sum(leaf[:, -1, -1].astype(jnp.uint32)) for leaf in jax.tree.leaves(obs))
        key, reset_key = jax.random.split(jax.random.fold_in(key, seen))
        return (key, resets(jax.random.split(reset_key, batch))), None

    first = jax.jit(resets)(jax.random.split(jax.random.key(0), batch))
    program = jax.jit(lambda carry: jax.lax.scan(again, carry, length=steps)[0], donate_argnums=0)
    return repeat(program, (jax.random.key(1), first), batch * steps)


def spread(batch: int, options: Options) -> Chunk:
    """The same over several simulated devices, a thread each."""
    from benchmarks.spread import make_mesh, make_spread_rollout

    devices = int(options["devices"])
    jax.config.update("jax_num_cpu_devices", devices)
    steps = max(1, devices * STEPS_A_CALL // batch)
    mesh = make_mesh(jax.devices())
    rollout, start = make_spread_rollout(*own_environment(options), batch, steps, mesh)
    return repeat(rollout, start(np.uint32(0)), batch * steps)


def loop(batch: int, options: Options) -> Chunk:
    """The project as a Python loop: one environment, one jitted call a step, a pixel read."""
    assert batch == 1
    # Else every call is handed to another thread, which a loop that waits for each frame pays for.
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

    return random_loop(advance, env.num_actions, 64, frame_skip(options))


SUBJECTS: Subjects = {
    "scan": scan,
    "loop": loop,
    "frames": frames,
    "keep": keep,
    "fill": fill,
    "reset": reset,
    "spread": spread,
}
