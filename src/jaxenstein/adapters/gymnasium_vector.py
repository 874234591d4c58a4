"""A `gymnasium.vector.VectorEnv` that steps many environments in one compiled call."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import jax
import numpy as np

from ..environment import AnyEnvironment
from ..errors import SettingError
from ..fields import check_whole, is_whole
from .batch import Batch, Ended, seeds_of
from .gymnasium import (
    RENDER_FPS,
    Interface,
    check_render_mode,
    frames,
    gymnasium,
    resolve,
    warn_of_no_render_mode,
)

AutoresetMode = gymnasium.vector.AutoresetMode
_MODES = {
    AutoresetMode.NEXT_STEP: "next-step",
    AutoresetMode.SAME_STEP: "same-step",
    AutoresetMode.DISABLED: None,
}


class GymnasiumVectorEnv(gymnasium.vector.VectorEnv[Any, Any, np.ndarray]):
    """N environments with the same results as `gymnasium.vector.SyncVectorEnv`.

    `gymnasium.make_vec("jaxenstein/my-way-home-v0", num_envs=64)` makes one; for an environment of
    your own, use this class. With the seed S, environment i has the same observations, rewards,
    ends and infos as a single environment with the seed S + i.

    Observations are read-only views of JAX arrays, on a CPU without a copy; no later step changes
    them. `copy=True` returns writable copies.

    Attributes:
        env: the environment.
        params: its params, with a leading axis N where they differ between environments.
        autoreset_mode: what happens at the end of an episode.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012
        "render_modes": ["rgb_array"],
        "render_fps": RENDER_FPS,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        env: AnyEnvironment | str,
        params: Any = None,
        num_envs: int = 1,
        *,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        copy: bool = False,
        render_mode: str | None = None,
        max_episode_steps: int | None = None,
        interface: Interface | None = None,
        **settings: Any,
    ) -> None:
        """Wrap N environments of one kind, or make them.

        Args:
            env: an environment, or an id for `jaxenstein.make`.
            params: the params, each one number for all environments, an array with a leading axis
                N, or a range from which each episode draws; None for the default params.
            num_envs: N, at least 1.
            autoreset_mode: one of Gymnasium's modes, or its name. `"NextStep"`: the step after
                the end of an episode resets, ignores its action and has reward 0. `"SameStep"`:
                the step that ends an episode resets, and puts the last state into
                `infos["final_obs"]` and `infos["final_info"]`. `"Disabled"`: the caller resets,
                with `reset(options={"reset_mask": ...})`.
            copy: whether to return writable copies of observations.
            render_mode: `"rgb_array"` or None.
            max_episode_steps: shortens the time limit `max_steps_in_episode`; each step counts as
                `frame_skip` world steps.
            interface: the form of actions and observations; None for the environment's own.
            **settings: settings of `make` and params by name; only with an id.

        Raises:
            SettingError: a setting or param does not exist, or its value is invalid.
            UnknownEnvironmentError: the id does not exist.
        """
        env, params = resolve(env, params, settings)
        check_render_mode(env, render_mode, self.metadata["render_modes"])
        self.autoreset_mode = _mode(autoreset_mode)
        if max_episode_steps is not None:
            params = _shortened(params, max_episode_steps, env.frame_skip)
        self._batch = Batch(env, params, num_envs, autoreset=_MODES[self.autoreset_mode])
        self.env, self.params = self._batch.env, self._batch.params
        self.num_envs = num_envs = self._batch.num_envs
        self.render_mode = render_mode
        self._interface = interface = interface or Interface(self.env, params)
        told = {"autoreset_mode": self.autoreset_mode, "render_fps": interface.render_fps}
        self.metadata = self.metadata | told
        self.single_observation_space = interface.observation_space
        self.single_action_space = interface.action_space
        batch_space = gymnasium.vector.utils.batch_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._to_numpy = np.array if copy else np.asarray
        self._observation: Any = None
        self._described: set[str] = set()
        self._over = np.zeros(num_envs, bool)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Any, dict[str, Any]]:
        """Start new episodes.

        Args:
            seed: restarts the random streams: N numbers, or one number for seed, seed + 1, ...
                None continues the streams. A first reset without a seed takes one from
                `np_random`.
            options: `{"reset_mask": bool[N]}` resets some environments and keeps the others. The
                first reset must reset all.

        Raises:
            SettingError: the seed or mask is invalid.
        """
        mask = None if options is None else options.get("reset_mask")
        if mask is not None and not np.any(mask):
            raise SettingError("options['reset_mask'] must be True for at least one environment")
        if seed is not None:
            one = is_whole(seed)
            seed = seeds_of(seed, self.num_envs)
            if one:
                super().reset(seed=seed[0])
        elif not self._batch.begun:
            seed = int(self.np_random.integers(2**63))
        self._observation, info = self._batch.reset(seed, mask)
        chosen = np.ones(self.num_envs, bool) if mask is None else np.array(mask)
        self._described = set(info)
        self._over &= ~chosen
        return self._told(), _spread(_taken(info, chosen), chosen)

    def step(self, actions: Any) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Step all environments.

        Args:
            actions: one of the action space, such as integers [N].

        Returns:
            observations; float64[N] rewards; bool[N] terminations; bool[N] truncations; infos,
            each entry with its mask `_entry`. Where an environment was reset, infos are those of
            a reset, without events such as `reached_goal`.

        Raises:
            gymnasium.error.ResetNeeded: `reset` was not called, or automatic resets are disabled
                and an episode is over.
            gymnasium.error.InvalidAction: an action is not in the action space.
        """
        self._check_order()
        out = self._batch.step(self._interface.actions(actions, self.num_envs))
        self._observation = out.observation
        terminated, truncated = out.terminated, out.truncated
        began = (
            self._over
            if self.autoreset_mode is AutoresetMode.NEXT_STEP
            else np.zeros_like(self._over)
        )
        self._over = terminated | truncated
        infos: dict[str, Any] = {}
        if out.ended is not None:
            began, self._over = self._over, began
            infos = _final(out.ended, began, self._interface)
        every = np.ones(self.num_envs, bool)
        for name, value in out.info.items():
            shown = every if name in self._described else ~began
            infos |= _spread({name: value}, shown)
        rewards = out.reward.astype(np.float64)
        return self._told(), rewards, *self._interface.ends(terminated, truncated), infos

    def render(self) -> tuple[np.ndarray, ...] | None:  # type: ignore[override]
        """The frames, each uint8[height, width, 3]."""
        if self.render_mode is None:
            return warn_of_no_render_mode(self)
        images = frames(self._batch, self._observation)
        return tuple(self._interface.frames(images, self._over))

    def _check_order(self) -> None:
        if not self._batch.begun:
            raise gymnasium.error.ResetNeeded("call reset before step")
        if self.autoreset_mode is AutoresetMode.DISABLED and self._over.any():
            over = ", ".join(map(str, np.flatnonzero(self._over)))
            raise gymnasium.error.ResetNeeded(
                f"the episodes of these environments are over: {over}; reset them with "
                "reset(options={'reset_mask': terminations | truncations})"
            )

    def _told(self) -> Any:
        observation = jax.tree.map(self._to_numpy, self._observation)
        return self._interface.observation(observation, self._over)


def _mode(mode: Any) -> AutoresetMode:
    try:
        return AutoresetMode(mode)
    except ValueError:
        known = ", ".join(repr(one.value) for one in AutoresetMode)
        raise SettingError(f"autoreset_mode must be one of {known}, not {mode!r}") from None


def _shortened(params: Any, most: Any, frame_skip: int) -> Any:
    limit = min(check_whole("max_episode_steps", most) * frame_skip, np.iinfo(np.int32).max)
    limits = np.minimum(limit, np.asarray(params.max_steps_in_episode))
    return params.replace(max_steps_in_episode=limits)


def _taken(values: dict[str, np.ndarray], mask: np.ndarray) -> dict[str, np.ndarray]:
    """Copies with zeros where the mask is false."""
    taken = {name: np.array(value) for name, value in values.items()}
    for value in taken.values():
        value[~mask] = 0
    return taken


def _spread(values: dict[str, Any], mask: np.ndarray) -> dict[str, Any]:
    """The entries of an info with their masks; {} if no environment has them."""
    return values | {f"_{name}": mask.copy() for name in values} if mask.any() else {}


def _final(ended: Ended[np.ndarray], mask: np.ndarray, interface: Interface) -> dict[str, Any]:
    """The infos of the last states of the episodes that a step ended."""
    count = mask.size
    told = interface.observation(ended.observation, np.ones(ended.indices.shape, bool))
    last = np.full(count, None, object)
    for at, index in enumerate(ended.indices):
        last[index] = jax.tree.map(lambda leaf, at=at: np.asarray(leaf[at]), told)
    info = {}
    for name, value in ended.info.items():
        info[name] = np.zeros((count, *value.shape[1:]), value.dtype)
        info[name][ended.indices] = value
    return _spread({"final_obs": last, "final_info": _spread(info, mask)}, mask)
