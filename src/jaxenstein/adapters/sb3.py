"""Stable-Baselines3: a `VecEnv` that steps many environments in one compiled call.

Stable-Baselines3 expects the reset in the step that ends an episode, the last observation in the
info of that step, and writable NumPy arrays. Its `CnnPolicy` transposes uint8[H, W, C] images
itself, and needs at least 36x36 pixels.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from typing import Any

import jax
import numpy as np

from ..environment import AnyEnvironment
from ..errors import SettingError, nearest, quoted
from ..fields import names_of
from ..params import ranges_of
from .batch import Batch, Ended

try:
    import torch  # pyright: ignore[reportMissingImports]
    from gymnasium import spaces  # pyright: ignore[reportMissingImports]
    from stable_baselines3.common.monitor import Monitor  # pyright: ignore[reportMissingImports]
    from stable_baselines3.common.vec_env import VecEnv  # pyright: ignore[reportMissingImports]
except ImportError as error:
    raise ImportError(
        f"Stable-Baselines3 is not installed ({error}): pip install 'jaxenstein[sb3]'"
    ) from error

from .gymnasium import Interface, check_render_mode, frames, resolve
from .registration import vizdoom_ids

Indices = None | int | Iterable[int]


class SB3VecEnv(VecEnv):
    """N environments of one kind for the algorithms of Stable-Baselines3.

    Observations have a leading axis N. Images of one channel become uint8[N, H, W, 1], because
    Stable-Baselines3 needs a channel axis.

    The info of the step that ends an episode has the entries of the environment for the last
    state, `terminal_observation`, and `is_success`: whether the episode reached the aim of the task
    in any of its steps, which SB3's evaluation logs. Like a `Monitor`, it also has `episode` with
    the return `r`, the length `l` in calls of `step`, and the seconds `t` since the batch was
    created; `env_is_wrapped(Monitor)` is therefore true. Every info has `TimeLimit.truncated`:
    whether only the time limit ended the episode. It is always False with ViZDoom's ids, whose
    time limit terminates, as in ViZDoom itself.

    `get_attr` reads the attributes of the environment, the same for all N, and its params, which
    may differ.
    """

    def __init__(
        self,
        env: AnyEnvironment | str,
        params: Any = None,
        num_envs: int = 1,
        *,
        render_mode: str | None = None,
        **settings: Any,
    ) -> None:
        """Create `num_envs` environments; compiles and renders nothing before `reset`.

        Args:
            env: an environment, whose own `autoreset` and `final_observation` do not matter, an
                id for `jaxenstein.make`, or one of ViZDoom's such as
                `"jaxenstein/VizdoomBasic-v1"`.
            params: the params, each one number for all environments, an array with a leading axis
                N, or a range from which each episode draws; None for the default params.
            num_envs: N, at least 1.
            render_mode: `"rgb_array"` for `render` and `get_images`, or None.
            **settings: settings of `make` and params by name, such as `max_steps_in_episode`;
                only with an id.

        Raises:
            SettingError: a setting or param does not exist, or its value is invalid.
            UnknownEnvironmentError: the id does not exist.
        """
        self._interface: Interface | None = None
        ids = vizdoom_ids()
        if isinstance(env, str) and env in ids:
            from .vizdoom_ids import made

            env, params, self._interface = made(params, **(ids[env] | settings))
        else:
            env, params = resolve(env, params, settings)
        assert not isinstance(env, str)
        seen = self._interface or Interface(env, params)
        check_render_mode(env, render_mode, ["rgb_array"])
        self.batch = Batch(env, params, num_envs)
        self.render_mode = render_mode
        self._began = time.time()
        self._actions: Any = None
        self._succeeded = np.zeros(num_envs, bool)
        super().__init__(num_envs, _with_channels(seen.observation_space), seen.action_space)

    def reset(self) -> Any:
        """Start new episodes in all environments; seeds from `seed` apply only to this reset."""
        if any(self._options):
            raise SettingError("reset takes no options: use params instead")
        observation, info = self.batch.reset(self._seeds)
        self._succeeded[:] = False
        self._reset_seeds()
        self.reset_infos = _rows(info, self.num_envs)
        return self._told(_writable(observation))

    def step_async(self, actions: np.ndarray) -> None:
        """Store the actions for `step_wait`: integers [N].

        Actions outside the action space do nothing. In ViZDoom's ids they are an error.
        """
        self._actions = actions

    def step_wait(self) -> tuple[Any, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Step all environments; where an episode ends, return the next one's first observation.

        Returns:
            observations; float32[N] rewards; bool[N], whether the episode ended; infos.

        Raises:
            SettingError: the actions have another shape or dtype, or `reset` was not called.
        """
        if self._actions is None:
            raise SettingError("call step_async before step_wait")
        actions, self._actions = self._actions, None
        if self._interface is not None:
            actions = self._interface.actions(actions, self.num_envs)
        stepped = self.batch.step(actions)
        reward, terminated, truncated = stepped[1:4]
        if self._interface is not None:
            terminated, truncated = self._interface.ends(terminated, truncated)
        infos: list[dict[str, Any]] = [{"TimeLimit.truncated": False} for _ in reward]
        if stepped.ended is not None:
            cut = truncated & ~terminated
            for i, info in self._endings(stepped.ended):
                infos[i] = info | {"TimeLimit.truncated": bool(cut[i])}
        # Where an episode ended, this is the success of the new one.
        self._succeeded[terminated | truncated] = False
        self._succeeded |= stepped.info["success"]
        return self._told(_writable(stepped.observation)), reward, terminated | truncated, infos

    def close(self) -> None:
        """Drop the episodes; call `reset` to use the environments again."""
        self.batch = Batch(self.batch.env, self.batch.params, self.num_envs)

    def get_attr(self, attr_name: str, indices: Indices = None) -> list[Any]:
        """An attribute of the environment or one of its params, once for each index.

        Of a param with a range it is what the current episodes drew; before a reset, the range.

        Raises:
            AttributeError: there is no such attribute or param.
            SettingError: an index is out of range.
        """
        chosen = self._chosen(indices)
        if attr_name == "render_mode":
            return [self.render_mode] * len(chosen)
        if attr_name in names_of(self.batch.params):
            if not self.batch.begun and attr_name in ranges_of(self.batch.params):
                return [getattr(self.batch.params, attr_name)] * len(chosen)
            return self._param(attr_name)[chosen].tolist()
        if hasattr(self.batch.env, attr_name):
            return [getattr(self.batch.env, attr_name)] * len(chosen)
        raise AttributeError(f"{self.batch.env.name} has no attribute or param {quoted(attr_name)}")

    def set_attr(self, attr_name: str, value: Any, indices: Indices = None) -> None:
        """Set a param of all or some environments, starting with the next step.

        A range (low, high) is for all environments. A new one of a param that has had one counts
        from the next episodes on.

        Raises:
            SettingError: the param does not exist, the value is invalid, or an index is out of
                range; or a param would get or lose a range after the first reset.
        """
        params = self.batch.params
        names = names_of(params)
        if attr_name not in names:
            raise SettingError(
                f"there is no param {quoted(attr_name)}{nearest(attr_name, names)}; "
                f"those that can be set: {', '.join(names)}"
            )
        # Check the value before it is cast to the dtype of the others.
        changed = params.replace(**{attr_name: value})
        chosen = self._chosen(indices)
        if len(set(chosen)) < self.num_envs:
            if attr_name in ranges_of(params) | ranges_of(changed):
                raise SettingError(f"{attr_name} can have a range in all environments, not in some")
            numbers = self._param(attr_name)
            numbers[chosen] = value
            changed = params.replace(**{attr_name: numbers})
        self.batch.params = changed

    def env_method(
        self, method_name: str, *method_args: Any, indices: Indices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call a method of the environment, once for each index.

        Methods are pure functions of their arguments; `"render"` returns the agents' images.
        """
        chosen = self._chosen(indices)
        if method_name == "render" and not method_args and not method_kwargs:
            images = self.get_images()
            return [images[i] for i in chosen]
        method = getattr(self.batch.env, method_name)
        return [method(*method_args, **method_kwargs) for _ in chosen]

    def env_is_wrapped(self, wrapper_class: type, indices: Indices = None) -> list[bool]:
        """Whether a wrapper is built in: true for `Monitor`, whose `episode` entry infos have."""
        return [wrapper_class is Monitor] * len(self._chosen(indices))

    def get_images(self) -> Sequence[np.ndarray | None]:
        """The agents' images: uint8[H, W, 3] each; None without `render_mode`.

        Raises:
            SettingError: `reset` was not called.
        """
        if self.render_mode is None:
            return [None] * self.num_envs
        if not self.batch.begun:
            raise SettingError("call reset before render")
        return list(frames(self.batch))

    def _endings(self, ended: Ended[np.ndarray]) -> Iterable[tuple[int, dict[str, Any]]]:
        """The index of each environment whose episode ended, with its info."""
        seconds = round(time.time() - self._began, 6)
        count = ended.indices.size
        last = _rows(self._told(_with_channel(ended.observation), over=True), count)
        for i, info, observation in zip(
            ended.indices.tolist(), _rows(ended.info, count), last, strict=True
        ):
            total, length = float(info["episode_return"]), int(info["episode_length"])
            steps = -(-length // self.batch.env.frame_skip)
            episode = {"r": round(total, 6), "l": steps, "t": seconds}
            success = {"is_success": bool(self._succeeded[i] | info["success"])}
            last_of = {"terminal_observation": observation, "episode": episode}
            yield i, info | success | last_of

    def _told(self, observation: Any, over: bool = False) -> Any:
        """Observations in the form of the id; `over` if they are the last ones of episodes."""
        if self._interface is None:
            return observation
        return self._interface.observation(observation, np.bool_(over))

    def _param(self, name: str) -> np.ndarray:
        """[N, ...]: a param for each environment."""
        value = np.asarray(getattr(self.batch.drawn_params, name))
        usual = np.shape(getattr(self.batch.env.default_params, name))
        return np.array(np.broadcast_to(value, (self.num_envs, *usual)))

    def _chosen(self, indices: Indices) -> list[int]:
        chosen = list(self._get_indices(indices))
        for i in chosen:
            if not -self.num_envs <= i < self.num_envs:
                raise SettingError(f"there is no environment {i} among {self.num_envs}")
        return [i % self.num_envs for i in chosen]


def _with_channels(space: spaces.Space) -> spaces.Space:
    """An observation space, with a channel axis for images of one channel."""
    if isinstance(space, spaces.Dict):
        return spaces.Dict({name: _with_channels(part) for name, part in space.spaces.items()})
    if space.shape is not None and _lacks_channel(space.shape, space.dtype):
        return spaces.Box(0, 255, (*space.shape, 1), np.uint8)
    return space


def _lacks_channel(shape: tuple[int, ...], dtype: Any) -> bool:
    return len(shape) == 2 and dtype == np.uint8


def _with_channel(observation: Any) -> Any:
    """Turn uint8 arrays [N, H, W] into [N, H, W, 1]."""

    def add(leaf: np.ndarray) -> np.ndarray:
        return leaf[..., None] if _lacks_channel(leaf.shape[1:], leaf.dtype) else leaf

    return jax.tree.map(add, observation)


def _writable(observation: Any) -> Any:
    """Observations on the host that torch may wrap: on a CPU, without a copy.

    NumPy's view of a JAX array is read-only, so torch would warn. Arrays spread over several
    cores are copied.
    """

    def on_host(leaf: jax.Array) -> np.ndarray:
        if len(leaf.devices()) > 1:
            return np.array(leaf)
        return torch.from_dlpack(leaf).cpu().numpy()

    return _with_channel(jax.tree.map(on_host, observation))


def _rows(tree: Any, count: int) -> list[Any]:
    """Split a dict of arrays [K, ...] into K dicts, an array into its rows."""
    if isinstance(tree, dict):
        return [{name: values[i] for name, values in tree.items()} for i in range(count)]
    return list(tree)
