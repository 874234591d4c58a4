"""The peers of `subjects.py`: ViZDoom, EnvPool and MiniWorld, each under a random policy.

Every one of them reads a pixel of each frame, which shifts the next action, as the project's own
subjects do. Nothing of JAX or of this project is imported here.
"""

# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

Chunk = Callable[[], int]

STEPS = 64
ACTIONS_DRAWN = 2**14
SCENARIOS = {
    "my-way-home": ("VizdoomMyWayHome-v1", "my_way_home.cfg", "MyWayHome-v1"),
    "health-gathering": ("VizdoomHealthGathering-v1", "health_gathering.cfg", "HealthGathering-v1"),
}
OUTPUT = (64, 64)

# What a reader should know and only the running peer can tell, such as who draws.
notes: dict[str, str] = {}


def vizdoom_gymnasium(options: Mapping[str, str]) -> Chunk:
    """ViZDoom's Gymnasium environment as its users meet it.

    Options: `scenario`; `size`, one of ViZDoom's resolutions (320x240, the default, is that of the
    ids); `resize`, to 64x64 by `area` or `linear`, or `none`.
    """
    import gymnasium
    import vizdoom
    import vizdoom.gymnasium_wrapper

    scenario = SCENARIOS[options.get("scenario", "my-way-home")][0]
    chosen = {}
    if "size" in options:
        chosen["screen_resolution"] = _resolution(vizdoom, options["size"])
    env = gymnasium.make(scenario, **chosen)
    return gymnasium_loop(env, lambda obs: obs["screen"], resizer(options.get("resize", "area")))


def vizdoom_raw(options: Mapping[str, str]) -> Chunk:
    """The same scenarios without Gymnasium, RGB.

    Options: `scenario`; `size` (160x120, the default, is ViZDoom's lowest resolution); `resize`.
    """
    import vizdoom

    game = vizdoom.DoomGame()
    config = SCENARIOS[options.get("scenario", "my-way-home")][1]
    game.load_config(os.path.join(vizdoom.scenarios_path, config))
    game.set_screen_resolution(_resolution(vizdoom, options.get("size", "160x120")))
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
    drawn, resize, pixel = random_actions(count), resizer(options.get("resize", "none")), 0

    def chunk() -> int:
        nonlocal pixel
        for _ in range(STEPS):
            game.make_action(buttons[(next(drawn) + pixel) % count])
            if game.is_episode_finished():
                game.new_episode()
            pixel = middle(resize(game.get_state().screen_buffer))
        return STEPS

    return chunk


def envpool(options: Mapping[str, str], batch: int) -> Chunk:
    """EnvPool's ViZDoom, which draws at 320x240 and resizes inside, with its own threads.

    Options: `scenario`; `size` of its frames; `resize`, `area` or `linear`; `send`, how many
    environments to wait for at a time (all of them by default).
    """
    import envpool as package

    width, height = numbers(options.get("size", "64x64"))
    together = int(options.get("send", batch))
    env = package.make_gymnasium(
        SCENARIOS[options.get("scenario", "my-way-home")][2],
        num_envs=batch,
        batch_size=together,
        num_threads=min(batch, len(os.sched_getaffinity(0))),
        img_width=width,
        img_height=height,
        stack_num=1,
        frame_skip=1,
        # Episodes of ViZDoom's length: 525 steps, the default, are those of four tics.
        max_episode_steps=2100,
        # One action out of those that ViZDoom's Gymnasium wrapper numbers likewise.
        use_combined_action=True,
        use_inter_area_resize=options.get("resize", "area") == "area",
        seed=0,
    )
    count = int(env.action_space.n)
    drawn = np.random.default_rng(0).integers(count, size=(ACTIONS_DRAWN, together), dtype=np.int32)
    calls, turn = max(1, STEPS // together), 0
    env.async_reset()
    obs, *_, info = env.recv()

    def chunk() -> int:
        nonlocal obs, info, turn
        for _ in range(calls):
            # Frames have their channels first; EnvPool resets by itself.
            pixels = obs[:, 0, height // 2, width // 2].astype(np.int32)
            turn = (turn + 1) % ACTIONS_DRAWN
            env.send((drawn[turn] + pixels) % count, info["env_id"])
            obs, *_, info = env.recv()
        return calls * together

    return chunk


def miniworld(options: Mapping[str, str]) -> Chunk:
    """MiniWorld's Hallway, drawn by OpenGL: on the display if there is one, else through EGL.

    Options: `size` of its frames (80x60, the default, is its own); `resize`.
    """
    import pyglet

    if not os.environ.get("DISPLAY"):
        # Must be set before MiniWorld is imported, which opens a window.
        pyglet.options["headless"] = True
    import gymnasium
    import miniworld  # noqa: F401
    from pyglet import gl

    width, height = numbers(options.get("size", "80x60"))
    env = gymnasium.make("MiniWorld-Hallway-v0", obs_width=width, obs_height=height)
    chunk = gymnasium_loop(env, lambda obs: obs, resizer(options.get("resize", "area")))
    notes["renderer"] = gl.gl_info.get_renderer()
    notes["display"] = "X" if os.environ.get("DISPLAY") else "EGL"
    return chunk


def gymnasium_loop(
    env: Any, image: Callable[[Any], Any], resize: Callable[[np.ndarray], np.ndarray]
) -> Chunk:
    """The plain loop over an environment of Gymnasium."""
    env.reset(seed=0)
    count = int(env.action_space.n)
    drawn, pixel = random_actions(count), 0

    def chunk() -> int:
        nonlocal pixel
        for _ in range(STEPS):
            obs, _, terminated, truncated, _ = env.step((next(drawn) + pixel) % count)
            if terminated or truncated:
                obs, _ = env.reset()
            pixel = middle(resize(image(obs)))
        return STEPS

    return chunk


def resizer(kind: str) -> Callable[[np.ndarray], np.ndarray]:
    """A function that brings frames to 64x64, on one thread: `area`, `linear` or `none`."""
    if kind == "none":
        return lambda frame: frame
    import cv2

    cv2.setNumThreads(1)
    how = {"area": cv2.INTER_AREA, "linear": cv2.INTER_LINEAR}[kind]
    return lambda frame: cv2.resize(frame, OUTPUT, interpolation=how)


def middle(frame: np.ndarray) -> int:
    """The red of the pixel in the middle."""
    return int(frame[frame.shape[0] // 2, frame.shape[1] // 2, 0])


def random_actions(count: int) -> Iterator[int]:
    """Uniform actions below `count`, drawn beforehand, round and round for ever."""
    drawn = np.random.default_rng(0).integers(count, size=ACTIONS_DRAWN).tolist()
    while True:
        yield from drawn


def numbers(size: str) -> tuple[int, int]:
    """(width, height) of a size such as 64x64."""
    width, _, height = size.partition("x")
    return int(width), int(height)


def _resolution(vizdoom: Any, size: str) -> Any:
    return getattr(vizdoom.ScreenResolution, "RES_{}X{}".format(*numbers(size)))
