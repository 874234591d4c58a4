"""One subject of a comparison in a process of its own: `python subjects.py NAME --core N`.

A plain script, so that any interpreter can run it. It prepares the subject, prints one JSON line
that describes it, and then answers each line `{"seconds": S}` on standard input with
`{"steps": N, "seconds": T}`, after stepping for about `S` seconds. End of input ends it.

Names: `scan-B`, `loop` and `loop-async` (this project), `vizdoom-gymnasium`, `vizdoom-raw`, and
`adapter-KIND-B`, the subjects of `adapter_subjects.py`.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import os
import platform
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

Chunk = Callable[[], int]
"""Makes some steps and returns how many."""

ENVIRONMENT_ID = "my-way-home"
SIZE = 64
STEPS_A_CALL = 2**15
ACTIONS_DRAWN = 2**14


def scan(batch: int) -> Chunk:
    """The project under a random policy, a batch of environments in one compiled scan."""
    import jax

    import jaxenstein
    from jaxenstein.random_rollout import make_random_rollout

    env, params = jaxenstein.make(ENVIRONMENT_ID, height=SIZE, width=SIZE)
    steps = max(1, STEPS_A_CALL // batch)
    rollout, start = make_random_rollout(env, params, batch, steps)
    carry = start(jax.random.key(0))

    def chunk() -> int:
        nonlocal carry
        carry = jax.block_until_ready(rollout(carry))
        return batch * steps

    return chunk


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
    drawn = random_actions(env.num_actions)
    middle = SIZE // 2

    def chunk() -> int:
        nonlocal key, obs, state
        for _ in range(64):
            action = (next(drawn) + int(np.asarray(obs)[middle, middle, 0])) % env.num_actions
            key, obs, state, *_ = step(key, state, np.int32(action))
        return 64

    return chunk


def vizdoom_gymnasium() -> Chunk:
    """`VizdoomMyWayHome-v1`, 320x240, each frame resized to 64x64 by area."""
    import cv2  # pyright: ignore[reportMissingImports]
    import gymnasium  # pyright: ignore[reportMissingImports]
    import vizdoom.gymnasium_wrapper  # noqa: F401  # pyright: ignore[reportMissingImports]

    cv2.setNumThreads(1)
    env = gymnasium.make("VizdoomMyWayHome-v1")
    env.reset(seed=0)
    count = int(env.action_space.n)  # pyright: ignore[reportAttributeAccessIssue]
    drawn = random_actions(count)
    pixel = 0

    def chunk() -> int:
        nonlocal pixel
        for _ in range(64):
            obs, _, terminated, truncated, _ = env.step((next(drawn) + pixel) % count)
            if terminated or truncated:
                obs, _ = env.reset()
            frame = cv2.resize(obs["screen"], (SIZE, SIZE), interpolation=cv2.INTER_AREA)
            pixel = int(frame[SIZE // 2, SIZE // 2, 0])
        return 64

    return chunk


def vizdoom_raw() -> Chunk:
    """The same scenario without Gymnasium, 160x120 RGB, frames not resized."""
    import vizdoom  # pyright: ignore[reportMissingImports]

    game = vizdoom.DoomGame()
    game.load_config(os.path.join(vizdoom.scenarios_path, "my_way_home.cfg"))
    game.set_screen_resolution(vizdoom.ScreenResolution.RES_160X120)
    game.set_screen_format(vizdoom.ScreenFormat.RGB24)
    game.set_window_visible(False)
    game.set_sound_enabled(False)
    game.set_seed(0)
    game.init()
    count = game.get_available_buttons_size() + 1
    # As in the Gymnasium environment: one button at a time, or none.
    buttons = [
        [float(button == action - 1) for button in range(count - 1)] for action in range(count)
    ]
    drawn = random_actions(count)
    pixel = 0

    def chunk() -> int:
        nonlocal pixel
        for _ in range(64):
            game.make_action(buttons[(next(drawn) + pixel) % count])
            if game.is_episode_finished():
                game.new_episode()
            pixel = int(game.get_state().screen_buffer[60, 80, 0])
        return 64

    return chunk


def random_actions(count: int) -> Iterator[int]:
    """Uniform actions below `count`, drawn beforehand, round and round for ever."""
    import numpy as np

    drawn = np.random.default_rng(0).integers(count, size=ACTIONS_DRAWN).tolist()
    while True:
        yield from drawn


def prepare(name: str) -> Chunk:
    """Build the subject called `name`."""
    if name.startswith("scan-"):
        return scan(int(name.removeprefix("scan-")))
    if name.startswith("adapter-"):
        import adapter_subjects

        return adapter_subjects.prepare(name.removeprefix("adapter-"))
    named = {"loop": partial(loop, False), "loop-async": partial(loop, True)}
    named |= {"vizdoom-gymnasium": vizdoom_gymnasium, "vizdoom-raw": vizdoom_raw}
    return named[name]()


def versions() -> dict[str, str]:
    """Versions of the interpreter and of the packages that were loaded."""
    found = {"python": platform.python_version()}
    names = {"jax": "jax", "jaxlib": "jaxlib", "numpy": "numpy", "gymnasium": "gymnasium"}
    names |= {"vizdoom": "vizdoom", "cv2": "opencv-python-headless"}
    names |= {"gymnax": "gymnax", "stoa": "stoa-env", "brax": "brax", "torch": "torch"}
    names |= {"stable_baselines3": "stable-baselines3"}
    for module, package in names.items():
        if module in sys.modules:
            found[package] = importlib.metadata.version(package)
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
    description = {"versions": versions(), "ready_seconds": time.perf_counter() - began}
    print(json.dumps(description), file=replies)
    for line in sys.stdin:
        print(json.dumps(answer(chunk, json.loads(line)["seconds"])), file=replies)


if __name__ == "__main__":
    main()
