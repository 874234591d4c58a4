"""One episode at a time, step by step on the host, for playing, recording and replaying."""

from __future__ import annotations

import dataclasses
import operator
from typing import Any, SupportsIndex

import jax
import numpy as np

from ..environment import AnyEnvironment
from ..errors import SettingError, quoted
from ..fields import check_seed
from ..players.chance import NO_OP
from ..seeds import key_of


class Session:
    r"""An episode in progress, without automatic resets.

    The seed and the actions since the reset determine the episode. With the same versions of this
    package and of JAX on the same hardware, it is bit-identical.

    Attributes:
        env: the environment, with `autoreset=None`.
        params: its params, as arrays.
        seed: the seed of this episode.
        observation: the observation of the state, on the device.
        state: the state.
        actions: the actions since the reset, in order.
        rewards: float, the reward of each of these steps.
        terminated: whether the task ended the episode.
        truncated: whether the time limit has been reached.
        info: the info of the last step, or of the first state after a reset.

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
            SettingError: the params have a batch axis.
        """
        self.env = dataclasses.replace(env, autoreset=None, final_observation=False)
        # Arrays, because Python numbers would be transferred and compiled separately.
        self.params = env.single_params(params)
        self.reset(seed)

    @property
    def over(self) -> bool:
        """Whether the episode has ended."""
        return self.terminated or self.truncated

    @property
    def episode_return(self) -> float:
        """The undiscounted sum of rewards since the reset."""
        return sum(self.rewards)

    def reset(self, seed: int) -> Any:
        """Start the episode of a seed; returns its first observation.

        Raises:
            SettingError: the seed is not a whole number from 0 to 2**32 - 1.
        """
        self.seed = check_seed(seed)
        key = key_of(self.seed)
        self._key, reset_key = jax.random.split(key)
        self.observation, self.state = self.env.reset(reset_key, self.params)
        self.actions: list[int] = []
        self.rewards: list[float] = []
        self.terminated = self.truncated = False
        self.info: dict[str, Any] = jax.device_get(self.env.describe(self.state, self.params))
        return self.observation

    def step(self, action: SupportsIndex) -> Any:
        """Take a step and return the observation; after its end, the episode continues.

        Args:
            action: a whole number; outside the action space it does nothing and is stored as -1.

        Raises:
            SettingError: the action is not a whole number.
        """
        chosen = whole_action(action)
        if not 0 <= chosen < self.env.num_actions:
            chosen = NO_OP
        # The third key is for policies, so that their choices do not affect the environment.
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
        """A random key for choosing the next action, independent of the environment's keys."""
        return jax.random.split(self._key, 3)[2]


def whole_action(action: Any) -> int:
    """Convert an action from Python, numpy or JAX to an int.

    Raises:
        SettingError: the action is not a whole number.
    """
    try:
        return operator.index(action)
    except TypeError as error:
        raise SettingError(f"an action must be one whole number, not {quoted(action)}") from error
