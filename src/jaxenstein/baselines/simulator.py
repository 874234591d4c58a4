"""Steps a batch of environments with resets, for the training loop.

All simulators have the same methods. Environments of this package are stepped without an
observation, reset if the episode ended, and rendered once. For truncated episodes, the last state
is kept instead of a frame. Other environments use gymnax' interface: `step` returns six values.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .. import ranged
from ..environment import Environment, outcome_of
from ..errors import SettingError
from ..params import ranges_of, split_ranges
from ..pytree import PyTreeNode
from ..ranged import Drawn


class Outcome(PyTreeNode):
    """The result of one step of `N` environments.

    Attributes:
        obs: next observations; the first ones of new episodes where an episode ended.
        state: states that belong to `obs`.
        reward: float32[N].
        terminated: bool[N], whether the task ended the episode.
        truncated: bool[N], whether only the time limit did.
        reached: bool[N], whether this step reached the task's aim, `info["success"]`.
        final: `final_observation` turns it into the last observations of ended episodes.
    """

    obs: Any
    state: Any
    reward: jax.Array
    terminated: jax.Array
    truncated: jax.Array
    reached: jax.Array
    final: Any


def most_truncations(params: Any, steps: int, frame_skip: int = 1) -> int:
    """The most truncations that one environment can have in `steps` steps.

    Args:
        params: if they have no `max_steps_in_episode`, the result is `steps`.
        steps: at least 1.
        frame_skip: frame skip of the environment.
    """
    limit = getattr(params, "max_steps_in_episode", None)
    if limit is None:
        return steps
    shortest = max(1, -(-int(np.min(np.asarray(limit))) // frame_skip))
    return 1 + (steps - 1) // shortest


class OwnSimulator:
    """A batch of environments of this package, with any `autoreset`.

    Attributes:
        num_actions: number of actions.
        frame_skip: world steps per step; time limits count world steps.
    """

    def __init__(self, env: Environment[Any, Any], params: Any) -> None:
        """Take an environment and its params.

        Raises:
            SettingError: the params have a batch axis.
        """
        env.single_params(params)
        self.num_actions, self.frame_skip = env.num_actions, env.frame_skip
        # Equal to the environment of sessions, so that both share one trace of the rendering.
        self._env = dataclasses.replace(env, autoreset=None, final_observation=False)
        self._resetting = dataclasses.replace(self._env, autoreset="same-step")
        self._params = params

    def reset(self, keys: jax.Array) -> tuple[Any, Any]:
        """The first observations and states, for keys[N]."""
        return jax.vmap(lambda key: ranged.reset(self._env, key, self._params))(keys)

    def step(self, keys: jax.Array, state: Any, action: jax.Array) -> Outcome:
        """Like `Environment.step` with `"same-step"` and the same keys; `final` holds states."""
        return jax.vmap(self._step)(keys, state, action)

    def _step(self, key: jax.Array, state: Any, action: jax.Array) -> Outcome:
        env, params = self._env, self._env.check_params(self._params)
        step_key, reset_key = jax.random.split(key)
        out = outcome_of(self._resetting, step_key, reset_key, state, action, params)
        return _outcome(out, env.observe(out.state, params), out.state, out.final)

    def final_of(self, obs: Any, state: Any) -> Any:
        """What `Outcome.final` would be for these observations and states: here the states."""
        del obs
        return state

    def final_observation(self, final: Any) -> Any:
        """Render the observations of `Outcome.final`, with one leading axis."""
        params = self._env.check_params(self._params)
        return jax.vmap(lambda state: self._env.observe(state, params))(final)


class RangedSimulator(OwnSimulator):
    """Each episode draws some params from ranges; states are `Drawn`.

    The key of a reset draws the numbers of the episode that it begins.
    """

    def __init__(self, env: Environment[Any, Any], params: Any) -> None:
        """As `OwnSimulator`, for params with ranges."""
        super().__init__(env, split_ranges(params)[0])
        self._params = ranged.single_params(env, params)

    def _step(self, key: jax.Array, state: Drawn, action: jax.Array) -> Outcome:
        step_key, reset_key = jax.random.split(key)
        out = ranged.outcome(self._resetting, step_key, reset_key, state, action, self._params)
        obs = ranged.observe(self._env, out.state, self._params)
        return _outcome(out, obs, out.state, out.final)

    def final_observation(self, final: Any) -> Any:
        """As `OwnSimulator.final_observation`."""
        return jax.vmap(lambda drawn: ranged.observe(self._env, drawn, self._params))(final)


def _outcome(out: Any, obs: Any, state: Any, final: Any) -> Outcome:
    """The outcome of a step in one environment."""
    return Outcome(
        obs=obs,
        state=state,
        reward=out.reward.astype(jnp.float32),
        terminated=out.terminated,
        truncated=out.truncated & ~out.terminated,
        reached=out.info["success"],
        final=final,
    )


def at_times(state: Any, times: jax.Array) -> Any:
    """Set the clocks of states to int32[N]."""
    if isinstance(state, Drawn):
        return state.replace(state=at_times(state.state, times))
    return state.replace(time=times)


class GymnaxSimulator:
    """Environments with gymnax' interface: `step` returns six values and resets in the same step.

    `info["final_observation"]` is the observation before a reset. No episode is truncated before
    `max_steps_in_episode` steps; without this param, any step may truncate. If one step takes
    several world steps and `max_steps_in_episode` counts world steps, the environment has
    `frame_skip`.
    """

    def __init__(self, env: Any, params: Any) -> None:
        """Take an environment and its params.

        Raises:
            SettingError: its actions are not discrete, or `step` does not return six values.
        """
        actions = getattr(env.action_space(params), "n", None)
        if actions is None:
            raise SettingError(f"actions must be discrete, not {env.action_space(params)}")
        self.num_actions = int(actions)
        self.frame_skip = int(getattr(env, "frame_skip", 1))
        self._env = env
        self._params = params
        key = jax.random.key(0)
        state = jax.eval_shape(env.reset, key, params)[1]
        values = jax.eval_shape(env.step, key, state, jnp.int32(0), params)
        if len(values) != 6:
            raise SettingError(
                "step must return observation, state, reward, terminated, truncated and info, as "
                f"in gymnax 1.0; {type(env).__name__} returns {len(values)} values"
            )
        self.has_final = "final_observation" in values[-1]

    def reset(self, keys: jax.Array) -> tuple[Any, Any]:
        """As `OwnSimulator.reset`."""
        return jax.vmap(lambda key: self._env.reset(key, self._params))(keys)

    def step(self, keys: jax.Array, state: Any, action: jax.Array) -> Outcome:
        """Step; `final` holds the observations before resets, or () if `info` has none."""
        step = jax.vmap(lambda *args: self._env.step(*args, self._params))
        obs, state, reward, terminated, truncated, info = step(keys, state, action)
        terminated = terminated.astype(bool)
        return Outcome(
            obs=obs,
            state=state,
            reward=reward.astype(jnp.float32),
            terminated=terminated,
            truncated=truncated.astype(bool) & ~terminated,
            reached=_reached(info, terminated, reward),
            final=info.get("final_observation", ()),
        )

    def final_of(self, obs: Any, state: Any) -> Any:
        """The observations."""
        del state
        return obs if self.has_final else ()

    def final_observation(self, final: Any) -> Any:
        """The observations themselves."""
        return final


def _reached(info: Any, terminated: jax.Array, reward: jax.Array) -> jax.Array:
    """Success in other packages' environments: `info["success"]`, or termination with a reward."""
    if "success" in info:
        return info["success"].astype(bool)
    return terminated & (reward > 0)


Simulator = OwnSimulator | GymnaxSimulator


def make_simulator(env: Any, params: Any) -> Simulator:
    """Wrap an environment of this package, or one with gymnax' interface.

    Raises:
        SettingError: actions are not discrete, or a method is missing.
    """
    if isinstance(env, Environment):
        return (RangedSimulator if ranges_of(params) else OwnSimulator)(env, params)
    for name in ("reset", "step", "action_space", "observation_space"):
        if not callable(getattr(env, name, None)):
            raise SettingError(
                f"an environment needs {name}(...), like those of jaxenstein.make or gymnax; "
                f"{type(env).__name__} has none"
            )
    return GymnaxSimulator(env, params)
