"""One episode at a time, step by step on the host: what playing, recording and replaying share."""

from __future__ import annotations

import dataclasses
import operator
from typing import Any, SupportsIndex

import jax
import numpy as np

from ..environment import AnyEnvironment
from ..errors import SettingError, quoted
from ..players.chance import NO_OP


class Session:
    r"""An environment in play, without automatic resets.

    A seed and the actions since the reset decide everything: the same ones give the same episode
    again, bit for bit, with the same version of this package and of JAX on the same hardware.

    Attributes:
        env: the environment, with `autoreset=None`.
        params: its params, as arrays.
        seed: of this episode.
        observation: of the state, on the device.
        state: the state.
        actions: those taken since the reset, in order.
        rewards: float, of each of these steps.
        terminated: whether the last step ended the task.
        truncated: whether the time limit is reached.
        info: of the last step; that of the state after a reset.

    Examples:
        >>> import jaxenstein
        >>> env, params = jaxenstein.from_ascii("####\n#SG#\n####", heading=0, height=8, width=8)
        >>> session = Session(env, params, seed=3)
        >>> while not session.over:
        ...     observation = session.step(env.action_names.index("forward"))
        >>> session.terminated, session.episode_return
        (True, 1.0)
    """

    def __init__(self, env: AnyEnvironment, params: Any, seed: int = 0) -> None:
        """Reset `env` with `seed`; its `autoreset` and `final_observation` do not matter.

        Raises:
            SettingError: the params are not those of one environment.
        """
        self.env = dataclasses.replace(env, autoreset=None, final_observation=False)
        # As arrays: Python's numbers would be transferred, and compiled for, by themselves.
        self.params = env.single_params(params)
        self.reset(seed)

    @property
    def over(self) -> bool:
        """Whether the episode has ended."""
        return self.terminated or self.truncated

    @property
    def episode_return(self) -> float:
        """Undiscounted sum of the rewards since the reset."""
        return sum(self.rewards)

    def reset(self, seed: int) -> Any:
        """Begin the episode of `seed`; returns its first observation.

        Raises:
            SettingError: the seed is no whole number from 0 to 2**32 - 1.
        """
        self.seed = check_seed(seed)
        # Named, lest a setting of JAX change what a seed means.
        key = jax.random.key(self.seed, impl="threefry2x32")
        self._key, reset_key = jax.random.split(key)
        self.observation, self.state = self.env.reset(reset_key, self.params)
        self.actions: list[int] = []
        self.rewards: list[float] = []
        self.terminated = self.truncated = False
        self.info: dict[str, Any] = jax.device_get(self.env.describe(self.state, self.params))
        return self.observation

    def step(self, action: SupportsIndex) -> Any:
        """Take a step, also after the end, where the episode goes on; returns the observation.

        Args:
            action: a whole number; outside the action space it does nothing and is kept as -1.

        Raises:
            SettingError: the action is no whole number.
        """
        chosen = whole_action(action)
        if not 0 <= chosen < self.env.num_actions:
            chosen = NO_OP
        # The third key is that of policies, lest a choice change what the environment draws.
        self._key, step_key, _ = jax.random.split(self._key, 3)
        self.observation, self.state, reward, terminated, truncated, info = self.env.step(
            step_key, self.state, np.int32(chosen), self.params
        )
        reward, terminated, truncated, self.info = jax.device_get(
            (reward, terminated, truncated, info)
        )
        self.actions.append(chosen)
        self.rewards.append(float(reward))
        self.terminated, self.truncated = bool(terminated), bool(truncated)
        return self.observation

    def policy_key(self) -> jax.Array:
        """A key for choosing the next action, independent of what the environment draws."""
        return jax.random.split(self._key, 3)[2]


def check_seed(seed: Any) -> int:
    """The seed as an int.

    Raises:
        SettingError: it is no whole number from 0 to 2**32 - 1.
    """
    try:
        number = operator.index(seed)
    except TypeError:
        number = -1
    if isinstance(seed, bool) or not 0 <= number < 2**32:
        raise SettingError(f"a seed must be a whole number from 0 to 2**32 - 1, not {quoted(seed)}")
    return number


def whole_action(action: Any) -> int:
    """An action as an int, from Python, numpy or JAX.

    Raises:
        SettingError: it is no whole number.
    """
    try:
        return operator.index(action)
    except TypeError as error:
        raise SettingError(f"an action must be one whole number, not {quoted(action)}") from error
