"""The peers as subjects: ViZDoom, EnvPool and MiniWorld, each with a random policy.

As in this project's own subjects, a pixel of each frame shifts the next action. This module imports
neither JAX nor this project. Options of the ViZDoom subjects: `scenario`, one of `SCENARIOS` or
`SHOOTING`; `size`, one of ViZDoom's resolutions; `resize`, which resizes frames to 64x64 by `area`
or `linear`, or not at all (`none`); `frame_skip`.
"""

# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.subjects.common import (
    SCENARIOS,
    SIZE,
    Chunk,
    Options,
    Subjects,
    frame_skip,
    image_size,
    middle,
    notes,
    random_loop,
)

STEPS = 64
# Scenarios with a different name in ViZDoom's Gymnasium ids.
_IDS = {"DefendTheCenter": "DefendCenter", "DefendTheLine": "DefendLine"}


def scenario(options: Options, separator: str = "") -> str:
    """ViZDoom's name of the scenario: `MyWayHome`, or `my_way_home` with a separator."""
    words = options.get("scenario", SCENARIOS[0]).split("-")
    told = "".join(map(str.capitalize, words))
    return separator.join(words) if separator else _IDS.get(told, told)


def vizdoom_gymnasium(batch: int, options: Options) -> Chunk:
    """ViZDoom's Gymnasium environment with its defaults; `size` changes the default 320x240."""
    import gymnasium
    import vizdoom
    import vizdoom.gymnasium_wrapper

    assert batch == 1
    chosen: dict[str, Any] = {"frame_skip": frame_skip(options)}
    if "size" in options:
        chosen["screen_resolution"] = _resolution(vizdoom, options, "")
    env = gymnasium.make(f"Vizdoom{scenario(options)}-v1", **chosen)
    if isinstance(space := env.action_space, gymnasium.spaces.Dict):
        # The action space includes a mouse, which does not move here.
        still = np.zeros_like(space["continuous"].sample())
        env = gymnasium.wrappers.TransformAction(
            env, lambda action: {"binary": action, "continuous": still}, space["binary"]
        )
    return gymnasium_loop(env, lambda obs: obs["screen"], resizer(options.get("resize", "area")))


def vizdoom_raw(batch: int, options: Options) -> Chunk:
    """The same scenarios without Gymnasium, in RGB at 160x120, ViZDoom's lowest resolution."""
    import vizdoom

    assert batch == 1
    game = vizdoom.DoomGame()
    game.load_config(os.path.join(vizdoom.scenarios_path, f"{scenario(options, '_')}.cfg"))
    game.set_screen_resolution(_resolution(vizdoom, options, "160x120"))
    game.set_screen_format(vizdoom.ScreenFormat.RGB24)
    game.set_window_visible(False)
    game.set_sound_enabled(False)
    game.set_seed(0)
    game.init()
    # As in the Gymnasium environment: one button at a time, or none, and no mouse.
    every = game.get_available_buttons()
    keys = [i for i, button in enumerate(every) if not vizdoom.is_delta_button(button)]
    buttons = [[float(i == key) for i in range(len(every))] for key in (-1, *keys)]
    resize, skip = resizer(options.get("resize", "none")), frame_skip(options)

    def step(action: int) -> int:
        game.make_action(buttons[action], skip)
        if game.is_episode_finished():
            game.new_episode()
        return middle(resize(game.get_state().screen_buffer))

    return random_loop(step, len(buttons), STEPS, 1)


def envpool(batch: int, options: Options) -> Chunk:
    """EnvPool's ViZDoom, which draws at 320x240, resizes inside, and has its own threads.

    Options: `size` of frames; `resize`, `area` or `linear`; `send`, the number of environments to
    wait for at a time (default: all).
    """
    import envpool as package

    width, height = image_size(options)
    together = int(options.get("send", batch))
    env = package.make_gymnasium(
        f"{scenario(options)}-v1",
        num_envs=batch,
        batch_size=together,
        num_threads=min(batch, len(os.sched_getaffinity(0))),
        img_width=width,
        img_height=height,
        stack_num=1,
        frame_skip=1,
        # The episode length of ViZDoom.
        max_episode_steps=2100,
        # One numbered action, as in ViZDoom's Gymnasium wrapper.
        use_combined_action=True,
        use_inter_area_resize=options.get("resize", "area") == "area",
        seed=0,
    )
    env.async_reset()
    *_, info = env.recv()

    def step(actions: np.ndarray) -> np.ndarray:
        nonlocal info
        env.send(actions, info["env_id"])
        obs, *_, info = env.recv()
        # Frames have channels first; EnvPool resets automatically.
        return obs[:, 0, height // 2, width // 2].astype(np.int32)

    calls = max(1, STEPS // together)
    return random_loop(step, int(env.action_space.n), calls, together, together)


def miniworld(batch: int, options: Options) -> Chunk:
    """MiniWorld's Hallway, drawn with OpenGL on the display if there is one, otherwise with EGL.

    Options: `size` of frames (default 80x60, its own default); `resize`.
    """
    import pyglet

    assert batch == 1
    if not os.environ.get("DISPLAY"):
        # Must be set before MiniWorld is imported, which opens a window.
        pyglet.options["headless"] = True
    import gymnasium
    import miniworld  # noqa: F401
    from pyglet import gl

    width, height = image_size(options, "80x60")
    env = gymnasium.make("MiniWorld-Hallway-v0", obs_width=width, obs_height=height)
    chunk = gymnasium_loop(env, lambda obs: obs, resizer(options.get("resize", "area")))
    notes["renderer"] = gl.gl_info.get_renderer()
    notes["display"] = "X" if os.environ.get("DISPLAY") else "EGL"
    return chunk


def gymnasium_loop(
    env: Any, image: Callable[[Any], Any], resize: Callable[[np.ndarray], np.ndarray]
) -> Chunk:
    """A plain loop over a Gymnasium environment."""
    env.reset(seed=0)

    def step(action: int) -> int:
        obs, _, terminated, truncated, _ = env.step(action)
        if terminated or truncated:
            obs, _ = env.reset()
        return middle(resize(image(obs)))

    return random_loop(step, int(env.action_space.n), STEPS, 1)


def resizer(kind: str) -> Callable[[np.ndarray], np.ndarray]:
    """A function that resizes frames to 64x64 on one thread: `area`, `linear` or `none`."""
    if kind == "none":
        return lambda frame: frame
    import cv2

    cv2.setNumThreads(1)
    how = {"area": cv2.INTER_AREA, "linear": cv2.INTER_LINEAR}[kind]
    return lambda frame: cv2.resize(frame, (SIZE, SIZE), interpolation=how)


def _resolution(vizdoom: Any, options: Options, usual: str) -> Any:
    return getattr(vizdoom.ScreenResolution, "RES_{}X{}".format(*image_size(options, usual)))


SUBJECTS: Subjects = {
    "vizdoom-gymnasium": vizdoom_gymnasium,
    "vizdoom-raw": vizdoom_raw,
    "envpool": envpool,
    "miniworld": miniworld,
}
