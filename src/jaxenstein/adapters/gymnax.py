"""gymnax environments, for purejaxrl, rejax and other loops written for gymnax.

    env, params = jaxenstein.adapters.gymnax.make("my-way-home", height=64, width=64)

returns a subclass of gymnax's `Environment` with gymnax's spaces. It follows the API of the
installed gymnax version, which it recognises by the methods of the base class:

- 1.x: `step` returns observation, state, reward, terminated, truncated, info.
- 0.0.x: observation, state, reward, done, info. `done` is true at both kinds of ends. A loop that
  only looks at `done` treats the time limit as a terminal state, and learns values near it that
  are too low. `info["terminated"]`, `info["truncated"]` and `info["discount"]` tell them apart.

Unlike in gymnax 1.x, `info` has no `final_observation` unless you make the environment with
`final_observation=True`: loops such as purejaxrl store the whole `info` of every step, and the
last frame costs a second render. The `FlattenObservationWrapper` and `GymnaxToDmEnvWrapper` of
gymnax 1.x need it.

Needs the extra `gymnax`.
"""

# gymnax is an optional extra and may be missing when types are checked.
# pyright: reportMissingImports=false, reportIncompatibleMethodOverride=false

from __future__ import annotations

import functools
from typing import Any

import jax
import jax.numpy as jnp

from .. import ranged, registry
from .. import spaces as own
from ..environment import AnyEnvironment, Info
from ..params import split_ranges
from .functional import check_fit

try:
    from gymnax.environments import environment as base
    from gymnax.environments import spaces
except ImportError as error:
    raise ImportError(
        f"jaxenstein.adapters.gymnax needs gymnax ({error}): pip install 'jaxenstein[gymnax]'"
    ) from error

STEP_VALUES: int = 6 if hasattr(base.Environment, "is_truncated") else 5
"""The number of values that `step` returns in the installed gymnax."""

_jit = functools.partial(jax.jit, static_argnames=("self",), inline=True)


class GymnaxEnvironment(base.Environment):
    """An environment of this package with the gymnax API.

    States are those of the wrapped environment, which have the `time` that gymnax needs, or
    `jaxenstein.ranged.Drawn` if params have ranges. Params are its params, a dataclass with
    `max_steps_in_episode`. Keys may be typed or raw. Adapters of equal environments are equal, and
    share compiled programs.

    Attributes:
        env: the wrapped environment.
    """

    def __init__(self, env: AnyEnvironment) -> None:
        """Wrap `env`.

        Raises:
            SettingError: `env` is not an environment, or its `autoreset` is not "same-step".
        """
        check_fit(env, ("same-step",), "gymnax")
        super().__init__()
        self.env = env

    def __eq__(self, other: object) -> bool:
        """Whether the other adapter wraps an equal environment."""
        return type(other) is type(self) and other.env == self.env

    def __hash__(self) -> int:
        """The hash of the wrapped environment."""
        return hash((type(self), self.env))

    def __repr__(self) -> str:
        """The id and the number of values of `step`."""
        return f"GymnaxEnvironment({self.name!r}, step of {STEP_VALUES} values)"

    @property
    def name(self) -> str:
        """The id, or the name of a custom map."""
        return self.env.name

    @property
    def num_actions(self) -> int:
        """The number of actions."""
        return self.env.num_actions

    @property
    def frame_skip(self) -> int:
        """World steps per step; `max_steps_in_episode` counts world steps."""
        return self.env.frame_skip

    @property
    def default_params(self) -> Any:
        """The params used for `params=None`."""
        return self.env.default_params

    @_jit
    def reset(self, key: jax.Array, params: Any = None) -> tuple[Any, Any]:
        """Start an episode; returns its first observation and state."""
        return ranged.reset(self.env, key, params)

    @_jit
    def step(self, key: jax.Array, state: Any, action: Any, params: Any = None) -> tuple[Any, ...]:
        """Take a step; if it ends the episode, return the first observation of the next one.

        Returns:
            With gymnax 1.x: observation, state, float32[] reward, bool[] terminated, bool[]
            truncated, info. With gymnax 0.0.x, bool[] done (either end) replaces terminated and
            truncated. `info` is that of the environment, plus bool[] `terminated` and
            `truncated`, and float32[] `discount`, 0 where terminated, else 1.
        """
        told = ranged.step(self.env, key, state, action, params)
        *front, terminated, truncated, info = told
        info = _with_ends(info, terminated, truncated)
        if STEP_VALUES == 6:
            return (*front, terminated, truncated, info)
        return (*front, terminated | truncated, info)

    @_jit
    def reset_env(self, key: jax.Array, params: Any = None) -> tuple[Any, Any]:
        """As `reset`."""
        return ranged.reset(self.env, key, params)

    @_jit
    def step_env(
        self, key: jax.Array, state: Any, action: Any, params: Any = None
    ) -> tuple[Any, ...]:
        """Take a step without an automatic reset: observation, state, reward, end, info.

        The end is bool[] terminated with gymnax 1.x, bool[] done with 0.0.x; `info` is as in
        `step`.
        """
        state, reward, terminated, info = ranged.advance(self.env, key, state, action, params)
        info = _with_ends(info, terminated, self.is_truncated(state, params))
        end = terminated if STEP_VALUES == 6 else state.done
        return self.get_obs(state, params), state, reward, end, info

    def observe(self, key: jax.Array, state: Any, action: Any, params: Any) -> Any:
        """The observation of a state; key and action are ignored."""
        del key, action
        return self.get_obs(state, params)

    def get_obs(self, state: Any, params: Any = None, key: jax.Array | None = None) -> Any:
        """The observation of a state; the key is ignored."""
        del key
        state, params = ranged.undrawn(state, self._params(params))
        return self.env.observe(state, params)

    def is_truncated(self, state: Any, params: Any = None) -> jax.Array:
        """bool[]: whether the state has reached the time limit."""
        return self.env.time_is_up(*ranged.undrawn(state, self._params(params)))

    def is_terminated(self, state: Any, params: Any = None) -> jax.Array:
        """bool[]: whether the task ended in this state, before the time limit.

        If both ends coincide, the state only shows the time limit; use `step` to tell them apart.
        """
        return state.done & ~self.is_truncated(state, params)

    def is_terminal(self, state: Any, params: Any = None) -> jax.Array:
        """bool[]: `is_terminated` with gymnax 1.x, either end with 0.0.x."""
        return self.is_terminated(state, params) if STEP_VALUES == 6 else state.done

    def discount(self, state: Any, params: Any = None) -> jax.Array:
        """float32[]: 0 where `is_terminated`, else 1."""
        return 1.0 - self.is_terminated(state, params).astype(jnp.float32)

    def action_space(self, params: Any = None) -> spaces.Discrete:
        """A gymnax `Discrete` of int32."""
        return _discrete(self.env.action_space(params).n)

    def observation_space(self, params: Any = None) -> spaces.Space:
        """A gymnax `Box`, or a `Dict` for `observation="dict"`."""
        return _space(self.env.observation_space(split_ranges(self._params(params))[0]))

    def _params(self, params: Any) -> Any:
        return ranged.check_params(self.env, params)


def make(id: str, **settings: Any) -> tuple[GymnaxEnvironment, Any]:
    """Build an environment with the gymnax API; the arguments are those of `jaxenstein.make`.

    Returns:
        The environment and its default params.

    Raises:
        UnknownEnvironmentError: the id does not exist.
        SettingError: a setting does not exist, its value is out of range, or `autoreset` is not
            "same-step".
    """
    return from_env(*registry.make(id, **settings))


def from_env(env: AnyEnvironment, params: Any = None) -> tuple[GymnaxEnvironment, Any]:
    """Wrap an environment, such as one from `jaxenstein.from_ascii`, with the gymnax API.

    Args:
        env: the environment, with `autoreset="same-step"`.
        params: its params; None for the default params. From a range each episode draws a number.

    Returns:
        The environment and the params. Loops that pass no params to `step` use its
        `default_params`.

    Raises:
        SettingError: `autoreset` is not "same-step", or the params belong to another kind of
            environment.
    """
    adapter = GymnaxEnvironment(env)
    return adapter, ranged.check_params(env, params)


def _with_ends(info: Info, terminated: jax.Array, truncated: jax.Array) -> Info:
    discount = 1.0 - terminated.astype(jnp.float32)
    return info | {"terminated": terminated, "truncated": truncated, "discount": discount}


def _space(space: own.Space) -> spaces.Space:
    if isinstance(space, own.Dict):
        return spaces.Dict({name: _space(part) for name, part in space.spaces.items()})
    if isinstance(space, own.Box):
        return spaces.Box(space.low, space.high, space.shape, jnp.dtype(space.dtype))
    return _discrete(space.n)


def _discrete(n: int) -> spaces.Discrete:
    space = spaces.Discrete(n)
    # gymnax 0.0.x uses int64, and JAX then warns at every sample unless 64-bit types are enabled.
    space.dtype = jnp.dtype(jnp.int32)
    return space
