"""One environment as a `gymnasium.Env`."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Mapping
from typing import Any

import jax
import numpy as np

from .. import ranged, spaces
from ..environment import AnyEnvironment, Environment
from ..errors import SettingError, nearest, quoted
from ..fields import check_seed, names_of
from ..params import split_ranges
from ..registry import find, import_module_of, make
from ..tasks.first_person import FirstPerson
from .batch import Batch, check_process

try:
    import gymnasium
except ImportError as error:
    raise ImportError(
        f"Gymnasium is not installed ({error}): pip install 'jaxenstein[gymnasium]'"
    ) from error

RENDER_FPS = 15
# The longer side of the window has at least this many pixels.
WINDOW = 512


class GymnasiumEnv(gymnasium.Env[Any, Any]):
    """A Gymnasium environment for loops that step one environment at a time.

    `gymnasium.make("jaxenstein/my-way-home-v0", height=84, width=84)` makes one; for an
    environment of your own, use this class. Observations are numpy arrays that you may change;
    images with one channel have no channel axis. The infos of a reset have the entries of a step
    except events, such as `reached_goal`.

    The time limit is the param `max_steps_in_episode`. Gymnasium's `max_episode_steps` can only
    shorten it.

    Attributes:
        env: the environment, with `autoreset=None`.
        params: its params.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012
        "render_modes": ["human", "rgb_array"],
        "render_fps": RENDER_FPS,
    }

    def __init__(
        self,
        env: AnyEnvironment | str,
        params: Any = None,
        *,
        render_mode: str | None = None,
        interface: Interface | None = None,
        **settings: Any,
    ) -> None:
        """Wrap an environment, or make one.

        Args:
            env: an environment, or an id for `jaxenstein.make`.
            params: its params; None for the default params. From a range each episode draws a
                number.
            render_mode: `"rgb_array"`: `render` returns uint8[height, width, 3], whatever the
                kind of observation; `"human"`: a window shows every reset and step (needs the
                extra `play`).
            interface: the form of actions and observations; None for the environment's own.
            **settings: settings of `make` and params by name, such as `max_steps_in_episode`;
                only with an id.

        Raises:
            SettingError: a setting or param does not exist, or its value is invalid.
            UnknownEnvironmentError: the id does not exist.
        """
        env, params = resolve(env, params, settings)
        params = ranged.single_params(env, params)
        check_render_mode(env, render_mode, self.metadata["render_modes"])
        self._batch = Batch(env, params, autoreset=None, spread=False, inline=True)
        self.env, self.params = self._batch.env, self._batch.params
        self.render_mode = render_mode
        self._interface = interface = interface or Interface(self.env, params)
        self.observation_space = interface.observation_space
        self.action_space = interface.action_space
        self.metadata = self.metadata | {"render_fps": interface.render_fps}
        self._observation: Any = None
        self._over = True
        self._screen: _Screen | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start an episode; returns the observation and the info: numpy scalars, bools, arrays.

        Args:
            seed: restarts the random stream, 0 to 2**64 - 1; None continues it. A first reset
                without a seed takes one from `np_random`.
            options: ignored.

        Raises:
            SettingError: the seed is invalid.
        """
        seed = None if seed is None else check_seed(seed, 64)
        super().reset(seed=seed)
        if seed is None and not self._batch.begun:
            seed = int(self.np_random.integers(2**63))
        self._observation, info = self._batch.reset(seed)
        self._over = False
        if self.render_mode == "human":
            self.render()
        return self._told(), _first_info(info)

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Take a step.

        Raises:
            gymnasium.error.ResetNeeded: the episode is over or has not started.
            gymnasium.error.InvalidAction: the action is not an integer of the action space.
        """
        if self._over:
            state = "has not started" if not self._batch.begun else "is over"
            raise gymnasium.error.ResetNeeded(f"the episode {state}: call reset before step")
        stepped = self._batch.step_one(self._interface.actions(_batched(action), 1))
        self._observation, reward, terminated, truncated, info = stepped
        self._over = terminated or truncated
        if self.render_mode == "human":
            self.render()
        ends = self._interface.ends(terminated, truncated)
        return self._told(), float(reward), *ends, info

    def render(self) -> np.ndarray | None:  # type: ignore[override]
        """The frame as uint8[height, width, 3], or shown in a window; see `render_mode`.

        Raises:
            gymnasium.error.ResetNeeded: `reset` was not called.
            SettingError: no window can be opened; the message says what is missing.
        """
        if self.render_mode is None:
            return warn_of_no_render_mode(self)
        frame = frames(self._batch, self._observation)[0]
        frame = self._interface.frames(frame, np.bool_(self._over))
        if self.render_mode == "rgb_array":
            return frame
        if self._screen is None:
            height, width, _ = frame.shape
            pace = self._interface.render_fps
            self._screen = _Screen(self.env.name, height, width, pace)
        self._screen.show(frame)
        return None

    def _told(self) -> Any:
        return self._interface.observation(_first(self._observation), np.bool_(self._over))

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._screen is not None:
            self._screen.close()
            self._screen = None


class Interface:
    """How Gymnasium sees an environment: actions, observations and ends. This one changes nothing.

    Attributes:
        observation_space, action_space: the spaces of one environment.
    """

    render_fps: int = RENDER_FPS

    def __init__(self, env: AnyEnvironment, params: Any) -> None:
        """Set the spaces."""
        self.observation_space: gymnasium.Space[Any] = gymnasium_space(env, params)
        self.action_space: gymnasium.Space[Any] = gymnasium.spaces.Discrete(env.num_actions)
        self._count = env.num_actions

    def actions(self, actions: Any, count: int) -> np.ndarray:
        """int32[count]: the environment's numbers of `count` actions.

        Raises:
            gymnasium.error.InvalidAction: an action is not in the action space.
        """
        return checked_actions(actions, count, self._count)

    def observation(self, observation: Any, over: np.ndarray | np.bool_) -> Any:
        """Observations [...] in NumPy, where bool[...] `over` marks the last ones of episodes."""
        del over
        return observation

    def frames(self, frames: np.ndarray, over: np.ndarray | np.bool_) -> np.ndarray:
        """Images for `render`, uint8[..., height, width, 3]."""
        del over
        return frames

    def ends(self, terminated: Any, truncated: Any) -> tuple[Any, Any]:
        """The two ends, each a bool or bool[N]."""
        return terminated, truncated


def resolve(
    env: AnyEnvironment | str, params: Any, settings: dict[str, Any]
) -> tuple[AnyEnvironment, Any]:
    """The environment and params for the arguments of an adapter."""
    check_process()
    if not isinstance(env, str):
        if not isinstance(env, Environment):
            raise SettingError(f"env must be an id or an environment, not {quoted(env)}")
        if settings:
            raise SettingError(
                f"settings ({', '.join(settings)}) need an id: for an environment, pass settings "
                "to make, and change params with params.replace(...)"
            )
        return env, ranged.check_params(env, params)
    for name in ("autoreset", "final_observation"):
        if name in settings:
            raise SettingError(
                f"{quoted(name)} has no effect here: the adapter decides when to reset"
            )
    if "frameskip" in settings:
        if "frame_skip" in settings:
            raise SettingError("frameskip is another name of frame_skip; give only one")
        # Gymnasium's Atari environments use this name, and TorchRL passes it.
        settings["frame_skip"] = settings.pop("frameskip")
    import_module_of(env)
    static = set(find(env)[1].settings)
    made, default = make(env, **{key: settings[key] for key in settings if key in static})
    numbers = {key: value for key, value in settings.items() if key not in static}
    params_of = names_of(default)
    for name in numbers:
        if name not in params_of:
            close = nearest(name, [*static, *params_of])
            raise SettingError(f"{made.name} has no setting or param {quoted(name)}{close}")
    return made, ranged.check_params(made, params).replace(**numbers)


def gymnasium_space(env: AnyEnvironment, params: Any) -> gymnasium.Space[Any]:
    """The observation space in Gymnasium's terms, without infinite bounds.

    First-person depths are bounded by the diagonal of the map, others by the largest float32.
    """
    far = math.inf
    if isinstance(env, FirstPerson) and env.observation == "depth":
        far = math.hypot(*env.map_size)
    return _space(env.observation_space(split_ranges(params)[0]), far)


def _space(space: spaces.Space, far: float) -> gymnasium.Space[Any]:
    if isinstance(space, spaces.Dict):
        return gymnasium.spaces.Dict({name: _space(s, far) for name, s in space.spaces.items()})
    if isinstance(space, spaces.Discrete):
        return gymnasium.spaces.Discrete(space.n)
    low, high = space.low, space.high
    if np.issubdtype(space.dtype, np.floating):
        most = float(np.finfo(space.dtype).max)
        low, high = max(low, -most), min(far if high == math.inf else high, most)
    return gymnasium.spaces.Box(low, high, space.shape, space.dtype.type)


def checked_actions(actions: Any, count: int, number: int) -> np.ndarray:
    """Check actions from 0 to number - 1; returns int32[count]."""
    array = np.asarray(actions)
    if array.shape != (count,) or array.dtype.kind not in "iu":
        what = (
            "an action must be one integer" if count == 1 else f"actions must be {count} integers"
        )
        raise gymnasium.error.InvalidAction(f"{what}, not {array.dtype}{list(array.shape)}")
    # A comparison of Python's numbers takes far less time than one of arrays.
    least, most = (array.item(),) * 2 if count == 1 else (array.min(), array.max())
    if least < 0 or most >= number:
        wrong = array[(array < 0) | (array >= number)][0]
        raise gymnasium.error.InvalidAction(f"an action must be 0 to {number - 1}, not {wrong}")
    return array.astype(np.int32)


def check_render_mode(env: AnyEnvironment, mode: str | None, modes: list[str]) -> None:
    """Raise for an unknown render mode, or for an environment that cannot be rendered."""
    if mode is not None and mode not in modes:
        known = ", ".join(map(repr, (*modes, None)))
        raise SettingError(f"render_mode must be one of {known}, not {mode!r}")
    if mode is not None and not isinstance(env, FirstPerson):
        raise SettingError(f"{env.name} cannot be rendered: it is not a first-person environment")


def warn_of_no_render_mode(env: Any) -> None:
    """Warn that `render` does nothing without a render mode."""
    gymnasium.logger.warn(
        f"{env} was made without a render mode, so render does nothing; "
        'make it with render_mode="rgb_array".'
    )


def frames(batch: Batch, observation: Any = None) -> np.ndarray:
    """uint8[N, height, width, 3]: colour images of the states of a batch.

    Args:
        batch: a batch of first-person environments.
        observation: the observations of these states, which are reused if they are colour images;
            None if they may have been overwritten.
    """
    if not batch.begun:
        raise gymnasium.error.ResetNeeded("call reset before render")
    env: Any = batch.env
    if observation is not None and env.observation in ("rgb", "dict"):
        return np.array(observation["image"] if env.observation == "dict" else observation)
    coloured = dataclasses.replace(env, observation="rgb")
    return np.array(batch.observe(coloured))


def _batched(action: Any) -> Any:
    """An action with a leading axis of 1."""
    if isinstance(action, dict):
        return {name: np.asarray(part)[None] for name, part in action.items()}
    return np.asarray(action)[None]


def _first(tree: Any) -> Any:
    """The only entry of a batch, as new numpy arrays."""
    if isinstance(tree, jax.Array):
        return np.asarray(tree)[0].copy()
    return jax.tree.map(lambda leaf: np.array(np.asarray(leaf)[0]), tree)


def _first_info(info: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """The info of the one environment of a batch."""
    # Vector environments can stack arrays, numpy numbers and Python bools.
    return {
        name: value.item() if value.dtype == bool and value.ndim == 1 else value[0]
        for name, value in info.items()
    }


class _Screen:
    """A window that shows at most `pace` frames a second."""

    def __init__(self, title: str, height: int, width: int, pace: int) -> None:
        from ..interactive.window import GAP, Window

        scale = math.ceil(WINDOW / max(height, width))
        self._window = Window(title, (width * scale + 2 * GAP, height * scale + 2 * GAP))
        self._pace, self._due = pace, 0.0

    def show(self, frame: np.ndarray) -> None:
        """Show uint8[height, width, 3]."""
        time.sleep(max(0.0, self._due - time.monotonic()))
        self._due = time.monotonic() + 1 / self._pace
        self._window.events()  # otherwise the desktop reports the window as not responding
        self._window.show(frame)

    def close(self) -> None:
        self._window.close()
