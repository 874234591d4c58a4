"""Environments as gymnax has them, for purejaxrl, rejax and other loops written for gymnax.

    env, params = jaxenstein.adapters.gymnax.make("my-way-home", height=64, width=64)

gives a subclass of gymnax's own `Environment` with gymnax's own spaces. It keeps the contract of
the gymnax that is installed, told by the methods of its base class:

- 1.x: `step` returns observation, state, reward, terminated, truncated, info.
- 0.0.x: observation, state, reward, done, info. `done` is true at both kinds of ends, so a loop
  that only looks at it takes the time limit for an end of the task and learns values that are too
  low near it; `info["terminated"]`, `info["truncated"]` and `info["discount"]` tell them apart.

Other than gymnax 1.x itself, `info` has no `final_observation` unless the environment is made with
`final_observation=True`: loops in the manner of purejaxrl store the whole `info` of every step, and
the last frame costs a second render. gymnax' `FlattenObservationWrapper` and
`GymnaxToDmEnvWrapper` of 1.x need it.

Needs the extra `gymnax`.
"""

# The partner is an extra, which need not be there to check the types.
# pyright: reportMissingImports=false, reportIncompatibleMethodOverride=false

from __future__ import annotations

import functools
from typing import Any

import jax
import jax.numpy as jnp

from .. import drawing, registry
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
"""How many values `step` returns: those of the gymnax that is installed."""

_jit = functools.partial(jax.jit, static_argnames=("self",), inline=True)


class GymnaxEnvironment(base.Environment):
    """An environment of this package behind gymnax' contract.

    States are those of the environment inside, which have gymnax' `time`, or `Drawn` of
    `jaxenstein.drawing` where params have ranges. Params are its params, a dataclass with
    `max_steps_in_episode`. Keys may be typed or old. Adapters of equal environments are equal, and
    share their compilations.

    Attributes:
        env: the environment inside.
    """

    def __init__(self, env: AnyEnvironment) -> None:
        """Wrap `env`.

        Raises:
            SettingError: it is no environment, or one without resets in the same step.
        """
        check_fit(env, ("same-step",), "gymnax")
        super().__init__()
        self.env = env

    def __eq__(self, other: object) -> bool:
        """Whether the other one wraps an equal environment."""
        return type(other) is type(self) and other.env == self.env

    def __hash__(self) -> int:
        """Of the environment inside."""
        return hash((type(self), self.env))

    def __repr__(self) -> str:
        """The id, and the contract."""
        return f"GymnaxEnvironment({self.name!r}, step of {STEP_VALUES} values)"

    @property
    def name(self) -> str:
        """The id, or the name of a custom map."""
        return self.env.name

    @property
    def num_actions(self) -> int:
        """Number of actions."""
        return self.env.num_actions

    @property
    def frame_skip(self) -> int:
        """Steps of the world in a step; `max_steps_in_episode` counts those of the world."""
        return self.env.frame_skip

    @property
    def default_params(self) -> Any:
        """The params that `params=None` stands for."""
        return self.env.default_params

    @_jit
    def reset(self, key: jax.Array, params: Any = None) -> tuple[Any, Any]:
        """Begin an episode: observation and state."""
        return drawing.reset(self.env, key, params)

    @_jit
    def step(self, key: jax.Array, state: Any, action: Any, params: Any = None) -> tuple[Any, ...]:
        """Take a step; one that ends the episode returns the next one's first observation.

        Returns:
            With gymnax 1.x observation, state, float32[] reward, bool[] terminated, bool[]
            truncated, info; with gymnax 0.0.x bool[] done, which is either end, in the place of
            the two. `info` is that of the environment with bool[] `terminated` and `truncated`,
            and float32[] `discount`, 0 where terminated, else 1.
        """
        told = drawing.step(self.env, key, state, action, params)
        *front, terminated, truncated, info = told
        info = _with_ends(info, terminated, truncated)
        if STEP_VALUES == 6:
            return (*front, terminated, truncated, info)
        return (*front, terminated | truncated, info)

    @_jit
    def reset_env(self, key: jax.Array, params: Any = None) -> tuple[Any, Any]:
        """The same as `reset`."""
        return drawing.reset(self.env, key, params)

    @_jit
    def step_env(
        self, key: jax.Array, state: Any, action: Any, params: Any = None
    ) -> tuple[Any, ...]:
        """Take a step without an automatic reset: observation, state, reward, end, info.

        The end is bool[] terminated with gymnax 1.x, bool[] done with 0.0.x; `info` is that of
        `step`.
        """
        state, reward, terminated, info = drawing.advance(self.env, key, state, action, params)
        info = _with_ends(info, terminated, self.is_truncated(state, params))
        end = terminated if STEP_VALUES == 6 else state.done
        return self.get_obs(state, params), state, reward, end, info

    def observe(self, key: jax.Array, state: Any, action: Any, params: Any) -> Any:
        """The observation of a state; key and action do not matter."""
        del key, action
        return self.get_obs(state, params)

    def get_obs(self, state: Any, params: Any = None, key: jax.Array | None = None) -> Any:
        """The observation of a state; the key does not matter."""
        del key
        state, params = drawing.undrawn(state, self._params(params))
        return self.env.observe(state, params)

    def is_truncated(self, state: Any, params: Any = None) -> jax.Array:
        """bool[]: whether the state has reached the time limit."""
        return self.env.time_is_up(*drawing.undrawn(state, self._params(params)))

    def is_terminated(self, state: Any, params: Any = None) -> jax.Array:
        """bool[]: whether the task ended in this state, before the time limit.

        A state does not tell both ends at once apart from the time limit; `step` does.
        """
        return state.done & ~self.is_truncated(state, params)

    def is_terminal(self, state: Any, params: Any = None) -> jax.Array:
        """bool[]: as gymnax has it, `is_terminated` in 1.x and either end in 0.0.x."""
        return self.is_terminated(state, params) if STEP_VALUES == 6 else state.done

    def discount(self, state: Any, params: Any = None) -> jax.Array:
        """float32[]: 0 where `is_terminated`, else 1."""
        return 1.0 - self.is_terminated(state, params).astype(jnp.float32)

    def action_space(self, params: Any = None) -> spaces.Discrete:
        """A `Discrete` of gymnax, of int32."""
        return _discrete(self.env.action_space(params).n)

    def observation_space(self, params: Any = None) -> spaces.Space:
        """A `Box` of gymnax, or a `Dict` for `observation="dict"`."""
        return _space(self.env.observation_space(split_ranges(self._params(params))[0]))

    def _params(self, params: Any) -> Any:
        return drawing.check_params(self.env, params)


def make(id: str, **settings: Any) -> tuple[GymnaxEnvironment, Any]:
    """Build an environment behind gymnax' contract; arguments as of `jaxenstein.make`.

    Returns:
        The environment and its default params.

    Raises:
        UnknownEnvironmentError: there is no such id.
        SettingError: there is no such setting, its value is out of range, or `autoreset` is not
            "same-step".
    """
    return from_env(*registry.make(id, **settings))


def from_env(env: AnyEnvironment, params: Any = None) -> tuple[GymnaxEnvironment, Any]:
    """Put an environment, such as `jaxenstein.from_ascii` returns it, behind gymnax' contract.

    Args:
        env: the environment, with `autoreset="same-step"`.
        params: its params; None for the default ones. Each episode draws a number from a range
            among them.

    Returns:
        The environment and the params. A loop that passes no params to `step` gets the default
        ones, as `default_params` of the environment.

    Raises:
        SettingError: the environment resets otherwise, or the params are of another kind.
    """
    adapter = GymnaxEnvironment(env)
    return adapter, drawing.check_params(env, params)


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
    # gymnax 0.0.x says int64, of which JAX warns at every sample where 64 bits are switched off.
    space.dtype = jnp.dtype(jnp.int32)
    return space
