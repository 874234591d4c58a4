"""Checks of the keys, states, actions and settings that callers pass, with clear errors."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Hashable
from typing import Any, ParamSpec, TypeVar, cast

import jax
import jax.numpy as jnp
import numpy as np

from ._jax.batching import varying
from .errors import SettingError
from .params import Params

Q = ParamSpec("Q")
R = TypeVar("R")


def compiled(function: Callable[Q, R]) -> Callable[Q, R]:
    """Compile a method that a training loop calls, after clear errors for wrong keys and actions.

    Outside compiled code, an action may be given by its name.
    """

    @functools.wraps(function)
    def alike(*args: Any) -> Any:
        return varying(cast(Callable[..., Any], function)(*args), args[1:])

    program = jax.jit(alike, static_argnums=0, inline=True)
    signature = inspect.signature(function)
    places = {name: place for place, name in enumerate(signature.parameters)}
    keys = [place for name, place in places.items() if name.endswith("key")]
    action, state = places.get("action", 0), places.get("state", 0)
    least = len(places) - 1  # params may be left out

    @functools.wraps(program)
    def call(*args: Any, **kwargs: Any) -> Any:
        told_apart = kwargs or len(args) < least
        given = list(signature.bind(*args, **kwargs).args if told_apart else args)
        for place in keys:
            _check_key(given[place])
        if state:
            _check_state(given[state], function.__name__)
        if action and isinstance(given[action], str):
            given[action] = given[0].index_of(given[action])
        # Only where an episode starts: reading params in every step would be slow.
        if not action and isinstance(given[-1], Params):
            given[-1].check()
        return program(*given)

    return cast(Callable[Q, R], call)


def _check_key(key: Any) -> None:
    """Raise unless the value is the random key, typed or raw, of one environment."""
    shape = getattr(key, "shape", None)
    typed = shape is not None and jnp.issubdtype(key.dtype, jax.dtypes.prng_key)
    if shape == () if typed else shape is not None and key.dtype == np.uint32 and len(shape) == 1:
        return
    what = repr(key) if shape is None else f"{key.dtype}{list(shape)}"
    batch = "; for a batch use jax.vmap" if typed else ""
    raise SettingError(f"a key must be a random key such as jax.random.key(0), not {what}{batch}")


def _check_state(state: Any, function: str) -> None:
    """Raise unless the value is the state of one environment."""
    time = getattr(state, "time", None)
    if time is not None and hasattr(state, "done") and np.shape(time) == ():
        return
    if time is not None and np.ndim(time):
        raise SettingError(
            f"a state must belong to one environment, not to a batch of {len(time)}; for a batch "
            f"use jax.vmap(env.{function})"
        )
    shape = getattr(state, "shape", None)
    what = repr(state) if shape is None else f"{state.dtype}{list(shape)}"
    raise SettingError(f"a state must be the second value of reset or step, not {what[:80]}")


def checked_action(action: Any, number: int) -> jax.Array:
    """int32[]: the action, with -1 for anything out of range."""
    if action is None:
        raise SettingError("an action must be one integer of shape (), not None")
    action = jnp.asarray(action)
    if action.shape != () or not jnp.issubdtype(action.dtype, jnp.integer):
        raise SettingError(
            f"an action must be one integer of shape (), not {action.dtype}"
            f"{list(action.shape)}; for a batch use jax.vmap(env.step)"
        )
    # Compare in the action's own dtype, because a cast could wrap it around.
    valid = (action >= 0) & (action < number)
    return jnp.where(valid, action, 0).astype(jnp.int32) - (~valid).astype(jnp.int32)


def as_static(field: str, value: Any) -> Any:
    """Make a setting hashable: tuples instead of lists and arrays."""
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return tuple(as_static(field, part) for part in value)
    if not isinstance(value, Hashable):
        raise SettingError(
            f"{field} cannot be a {type(value).__name__}: settings are static in compiled programs "
            "and must be hashable, such as numbers, strings and tuples"
        )
    return value


def as_kind(value: Any, default: Any) -> jax.Array:
    """The value as a float32, int32 or bool array, like its default."""
    kind = np.asarray(default).dtype.kind
    return jnp.asarray(value).astype({"i": jnp.int32, "b": jnp.bool_}.get(kind, jnp.float32))
