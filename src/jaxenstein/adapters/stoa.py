"""Stoa environments, for Stoix.

    env = jaxenstein.adapters.stoa.make("my-way-home", height=64, width=64)
    env = stoa.RecordEpisodeMetrics(stoa.AutoResetWrapper(env, next_obs_in_extras=True))

returns a subclass of Stoa's `Environment` with Stoa's time steps and spaces. It does not reset by
itself, because Stoa has wrappers for that. These render two frames at every step: that of the step
and that of a reset. `make(..., autoreset="same-step")` returns an environment that resets by
itself, like an `AutoResetWrapper`, and renders one frame per step. With `final_observation=True`,
which renders a second frame, `extras["next_obs"]` has the last observation.

Needs the extra `stoa`.
"""

# Stoa is an optional extra and may be missing when types are checked.
# pyright: reportMissingImports=false

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from .. import ranged, registry
from .. import spaces as own
from ..environment import AnyEnvironment
from ..params import split_ranges
from .functional import check_fit, first_info

try:
    import stoa
except ImportError as error:
    raise ImportError(
        f"jaxenstein.adapters.stoa needs stoa-env ({error}): pip install 'jaxenstein[stoa]'"
    ) from error

# The entry of `extras` for the last observation, as in Stoa's wrappers.
_LAST = "next_obs"


class StoaEnvironment(stoa.Environment):
    """An environment of this package with the Stoa API.

    States are Stoa's `StateWithKey`: the environment's state and the key of its random stream.
    Keys may be typed or raw. The `extras` of a time step are the `info` of the environment, also
    after a reset.

    Attributes:
        env: the wrapped environment.
        params: the params used for `env_params=None`.
    """

    env: AnyEnvironment
    params: Any

    def __init__(self, env: AnyEnvironment, params: Any = None) -> None:
        """Wrap `env`.

        Args:
            env: the environment, with `autoreset` None or "same-step".
            params: its params; None for the default params. From a range each episode draws a
                number, and states are then `jaxenstein.ranged.Drawn`.

        Raises:
            SettingError: `env` is not an environment, its `autoreset` is "next-step", or the
                params belong to another kind of environment or have a batch axis.
        """
        check_fit(env, (None, "same-step"), "Stoa")
        super().__init__()
        self.env = env
        self.params = ranged.single_params(env, params)

    def __repr__(self) -> str:
        """The id and `autoreset`."""
        return f"StoaEnvironment({self.env.name!r}, autoreset={self.env.autoreset!r})"

    # Stoa's base class is a dataclass without fields, so all its instances would be equal.
    def __eq__(self, other: object) -> bool:
        """Whether both are the same object."""
        return self is other

    def __hash__(self) -> int:
        """The hash of the object."""
        return id(self)

    def reset(
        self, rng_key: jax.Array, env_params: Any = None
    ) -> tuple[stoa.StateWithKey, stoa.TimeStep]:
        """Start an episode: a state, and a time step of type FIRST with reward 0, discount 1."""
        params = self._params(env_params)
        reset_key, key = jax.random.split(rng_key)
        observation, state = ranged.reset(self.env, reset_key, params)
        extras = first_info(self.env, reset_key, *ranged.undrawn(state, params))
        if self.env.final_observation:
            extras[_LAST] = observation
        first = stoa.TimeStep(
            step_type=stoa.StepType.FIRST,
            reward=jnp.float32(0.0),
            discount=jnp.float32(1.0),
            observation=observation,
            extras=extras,
        )
        return stoa.StateWithKey(base_env_state=state, rng_key=key), first

    def step(
        self, state: stoa.StateWithKey, action: Any, env_params: Any = None
    ) -> tuple[stoa.StateWithKey, stoa.TimeStep]:
        """Take a step.

        Returns:
            The state and a time step: TERMINATED with discount 0 if the task ended the episode,
            even if time is up in the same step; TRUNCATED with discount 1 at the time limit;
            otherwise MID. Step type int8[], discount float32[].
        """
        key, step_key = jax.random.split(state.rng_key)
        observation, after, reward, terminated, truncated, info = ranged.step(
            self.env, step_key, state.base_env_state, action, self._params(env_params)
        )
        extras = dict(info)
        if self.env.final_observation:
            extras[_LAST] = extras.pop("final_observation")
        kind = jnp.where(truncated, stoa.StepType.TRUNCATED, stoa.StepType.MID)
        step = stoa.TimeStep(
            step_type=jnp.where(terminated, stoa.StepType.TERMINATED, kind),
            reward=reward,
            discount=1.0 - terminated.astype(jnp.float32),
            observation=observation,
            extras=extras,
        )
        return stoa.StateWithKey(base_env_state=after, rng_key=key), step

    def observation_space(self, env_params: Any = None) -> stoa.Space:
        """Stoa's `BoundedArraySpace`, or a `DictSpace` for `observation="dict"`."""
        params = split_ranges(self._params(env_params))[0]
        return _space(self.env.observation_space(params), "observation")

    def action_space(self, env_params: Any = None) -> stoa.DiscreteSpace:
        """Stoa's `DiscreteSpace` of int32."""
        del env_params
        return stoa.DiscreteSpace(self.env.num_actions, dtype=jnp.int32, name="action")

    def state_space(self, env_params: Any = None) -> stoa.Space:
        """States have no space.

        Raises:
            NotImplementedError: always.
        """
        raise NotImplementedError("states of jaxenstein have no space; observations have one")

    def _params(self, params: Any) -> Any:
        return self.params if params is None else ranged.check_params(self.env, params)


def make(id: str, **settings: Any) -> StoaEnvironment:
    """Build an environment with the Stoa API.

    Args:
        id: as for `jaxenstein.make`.
        **settings: those of `jaxenstein.make`; `autoreset` defaults to None.

    Raises:
        UnknownEnvironmentError: the id does not exist.
        SettingError: a setting does not exist, its value is out of range, or `autoreset` is
            "next-step".
    """
    return StoaEnvironment(*registry.make(id, **{"autoreset": None, **settings}))


def _space(space: own.Space, name: str) -> stoa.Space:
    if isinstance(space, own.Dict):
        parts = {key: _space(part, key) for key, part in space.spaces.items()}
        return stoa.DictSpace(parts, name=name)
    if isinstance(space, own.Box):
        return stoa.BoundedArraySpace(space.shape, space.dtype, space.low, space.high, name=name)
    return stoa.DiscreteSpace(space.n, dtype=jnp.int32, name=name)
