"""One subject of a comparison in a process of its own: `python subjects.py NAME --core N`.

A plain script, so that any interpreter can run it. It prepares the subject, prints one JSON line
that describes it, and then answers each line `{"seconds": S}` on standard input with
`{"steps": N, "seconds": T}`, after stepping for about `S` seconds. End of input ends it.

A name is a kind, a number of environments where the kind has one, and options, such as
`scan-64 id=key-door size=84x84`:

- `scan-B` (this project; options `id`, or `map` or `sprites`, see `own_maps.py`; `size`,
  `observation`), `loop`, `loop-async`;
- `frames-B`, `keep-B`, `fill-B`: frames alone, frames kept, and only writing as many bytes;
- `stage-B stage=NAME`: one stage of a step, see `stages.py`;
- `spread-B devices=N`: `spread.py`;
- `adapter-KIND-B`: `adapter_subjects.py`;
- `vizdoom-gymnasium`, `vizdoom-raw`, `envpool-B`, `miniworld`: `peer_subjects.py`.

Options that a subject does not know only make its name another one.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import os
import platform
import sys
import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import peer_subjects

Chunk = Callable[[], int]
"""Makes some steps and returns how many."""

ENVIRONMENT_ID = "my-way-home"
SIZE = 64
STEPS_A_CALL = 2**15


def scan(batch: int, options: Mapping[str, str]) -> Chunk:
    """The project under a random policy, a batch of environments in one compiled scan."""
    import jax

    from jaxenstein.speed.random_rollout import make_random_rollout

    env, params = own_environment(options)
    # Larger images take longer: calls of about one length.
    frames = STEPS_A_CALL * SIZE**2 // max(SIZE**2, env.height * env.width)
    steps = max(1, frames // batch)
    rollout, start = make_random_rollout(env, params, batch, steps)
    return repeat(rollout, start(jax.random.key(0)), batch * steps)


def frames(batch: int, options: Mapping[str, str]) -> Chunk:
    """Frames alone, drawn of states that a pixel of the frame before moves a little."""
    import jax
    import jax.numpy as jnp
    from frames import make_frames

    env, params = own_environment(options)
    steps = max(1, STEPS_A_CALL // batch)
    program = make_frames(env, params, steps)
    reset = jax.jit(jax.vmap(lambda key: env.reset(key, params)))
    obs, state = reset(jax.random.split(jax.random.key(0), batch))
    return repeat(program, (state, obs, jnp.copy(state.position)), batch * steps)


def keep(batch: int, options: Mapping[str, str]) -> Chunk:
    """As `scan`, and the frames are kept: 8192 of them."""
    import jax
    from frames import FRAMES_KEPT, make_keeping_rollout

    steps = max(1, FRAMES_KEPT // batch)
    rollout, start = make_keeping_rollout(*own_environment(options), batch, steps)
    return repeat(rollout, start(jax.random.key(0)), batch * steps)


def fill(batch: int, options: Mapping[str, str]) -> Chunk:
    """Nothing but writing the bytes of a batch of frames, by NumPy."""
    import numpy as np

    width, height = peer_subjects.numbers(options.get("size", f"{SIZE}x{SIZE}"))
    room, value = np.zeros((batch, height, width, 3), np.uint8), 0
    calls = max(1, STEPS_A_CALL // batch)

    def chunk() -> int:
        nonlocal value
        for _ in range(calls):
            value = (value + 1) % 256
            room.fill(value)
        return calls * batch

    return chunk


def stage(batch: int, options: Mapping[str, str]) -> Chunk:
    """One stage of a step, of the same states over and over."""
    import jax
    from stages import make_stage

    program, given = make_stage(*own_environment(options), batch, options["stage"])
    calls = max(1, STEPS_A_CALL // batch)

    def chunk() -> int:
        for _ in range(calls):
            jax.block_until_ready(program(*given))
        return calls * batch

    return chunk


def repeat(program: Callable[[Any], Any], carry: Any, count: int) -> Chunk:
    """Calls of a program that takes a carry and gives the next, `count` steps each."""
    import jax

    def chunk() -> int:
        nonlocal carry
        carry = jax.block_until_ready(program(carry))
        return count

    return chunk


def own_environment(options: Mapping[str, str]) -> tuple[Any, Any]:
    """The environment that options name: an id, or a map made to measure."""
    import own_maps

    import jaxenstein

    width, height = peer_subjects.numbers(options.get("size", f"{SIZE}x{SIZE}"))
    settings: dict[str, Any] = {"height": height, "width": width}
    settings["observation"] = options.get("observation", "rgb")
    if "map" in options:
        return jaxenstein.from_ascii(own_maps.rooms(int(options["map"])), **settings)
    if "sprites" in options:
        env, params = jaxenstein.from_ascii(own_maps.hall(int(options["sprites"])), **settings)
        # Nothing is near enough to be taken or reached: all of it stays in sight.
        return env, params.replace(pickup_radius=-1.0, goal_radius=-1.0)
    return jaxenstein.make(options.get("id", ENVIRONMENT_ID), **settings)


def spread(batch: int, options: Mapping[str, str]) -> Chunk:
    """The same over several simulated devices, a thread each."""
    import jax
    import numpy as np

    devices = int(options["devices"])
    jax.config.update("jax_num_cpu_devices", devices)

    from spread import make_mesh, make_spread_rollout

    steps = max(1, devices * STEPS_A_CALL // batch)
    mesh = make_mesh(jax.devices())
    rollout, start = make_spread_rollout(*own_environment(options), batch, steps, mesh)
    return repeat(rollout, start(np.uint32(0)), batch * steps)


def loop(asynchronous: bool) -> Chunk:
    """The project as a Python loop: one environment, one jitted call a step, a pixel read.

    With JAX's asynchronous dispatch every call is handed to another thread, which a loop that
    waits for each frame only pays for.
    """
    import jax
    import numpy as np

    jax.config.update("jax_cpu_enable_async_dispatch", asynchronous)

    import jaxenstein

    env, params = jaxenstein.make(ENVIRONMENT_ID, height=SIZE, width=SIZE)

    @jax.jit
    def step(key: jax.Array, state: Any, action: Any) -> Any:
        key, step_key = jax.random.split(key)
        obs, state, reward, terminated, truncated, info = env.step(step_key, state, action, params)
        return key, obs, state, reward, terminated, truncated, info

    key, reset_key = jax.random.split(jax.random.key(0))
    obs, state = jax.jit(lambda key: env.reset(key, params))(reset_key)
    drawn = peer_subjects.random_actions(env.num_actions)
    middle = SIZE // 2

    def chunk() -> int:
        nonlocal key, obs, state
        for _ in range(64):
            action = (next(drawn) + int(np.asarray(obs)[middle, middle, 0])) % env.num_actions
            key, obs, state, *_ = step(key, state, np.int32(action))
        return 64

    return chunk


def prepare(name: str) -> Chunk:
    """Build the subject called `name`."""
    head, *words = name.split()
    options = dict(word.split("=", 1) for word in words)
    if head.startswith("adapter-"):
        import adapter_subjects

        return adapter_subjects.prepare(head.removeprefix("adapter-"))
    plain: dict[str, Callable[[], Chunk]] = {
        "loop": partial(loop, False),
        "loop-async": partial(loop, True),
        "vizdoom-gymnasium": partial(peer_subjects.vizdoom_gymnasium, options),
        "vizdoom-raw": partial(peer_subjects.vizdoom_raw, options),
        "miniworld": partial(peer_subjects.miniworld, options),
    }
    if head in plain:
        return plain[head]()
    kind, _, batch = head.rpartition("-")
    if kind == "envpool":
        return peer_subjects.envpool(options, int(batch))
    own = {"scan": scan, "spread": spread, "frames": frames, "keep": keep, "fill": fill}
    own["stage"] = stage
    return own[kind](int(batch), options)


def versions() -> dict[str, str]:
    """Versions of the interpreter and of the packages that were loaded."""
    found = {"python": platform.python_version()}
    names = {"jax": "jax", "jaxlib": "jaxlib", "numpy": "numpy", "gymnasium": "gymnasium"}
    names |= {"vizdoom": "vizdoom", "cv2": "opencv-python-headless", "envpool": "envpool"}
    names |= {"miniworld": "miniworld", "pyglet": "pyglet"}
    names |= {"gymnax": "gymnax", "stoa": "stoa-env", "brax": "brax", "torch": "torch"}
    names |= {"stable_baselines3": "stable-baselines3"}
    for module, package in names.items():
        if module in sys.modules:
            found[package] = importlib.metadata.version(package)
    if "jaxenstein" in sys.modules:
        found["jaxenstein"] = sys.modules["jaxenstein"].__version__
    return found


def answer(chunk: Chunk, seconds: float) -> dict[str, float]:
    """Step for about `seconds` and say how many steps it was and how long it took."""
    steps, began = 0, time.perf_counter()
    while (elapsed := time.perf_counter() - began) < seconds:
        steps += chunk()
    return {"steps": steps, "seconds": elapsed}


def main() -> None:
    """Prepare one subject and serve requests until standard input ends."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name")
    parser.add_argument("--core", type=int)
    arguments = parser.parse_args()
    if arguments.core is not None:
        os.sched_setaffinity(0, {arguments.core})
    # Libraries may print; the answers need standard output for themselves.
    replies = os.fdopen(os.dup(sys.stdout.fileno()), "w", buffering=1)
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    began = time.perf_counter()
    chunk = prepare(arguments.name)
    chunk()
    description = {
        "versions": versions(),
        "notes": peer_subjects.notes,
        "ready_seconds": time.perf_counter() - began,
    }
    print(json.dumps(description), file=replies)
    for line in sys.stdin:
        print(json.dumps(answer(chunk, json.loads(line)["seconds"])), file=replies)


if __name__ == "__main__":
    main()
