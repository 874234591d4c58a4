"""What callers hand in: keys, actions, settings and params, with words for what is wrong."""

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
    """Compile what a training loop calls; wrong keys and actions are told in words before.

    Outside of compiled code an action may be given by its name.
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
        # In a step they would be read over and over.
        if not action and isinstance(given[-1], Params):
            given[-1].check()
        return program(*given)

    return cast(Callable[Q, R], call)


def _check_key(key: Any) -> None:
    """Complain of what is no random key, typed or old, of one environment."""
    shape = getattr(key, "shape", None)
    typed = shape is not None and jnp.issubdtype(key.dtype, jax.dtypes.prng_key)
    if shape == () if typed else shape is not None and key.dtype == np.uint32 and len(shape) == 1:
        return
    what = repr(key) if shape is None else f"{key.dtype}{list(shape)}"
    batch = "; for a batch use jax.vmap" if typed else ""
    raise SettingError(f"a key must be a random key such as jax.random.key(0), not {what}{batch}")


def _check_state(state: Any, function: str) -> None:
    """Complain of what is no state of one environment."""
    time = getattr(state, "time", None)
    if time is not None and hasattr(state, "done") and np.shape(time) == ():
        return
    if time is not None and np.ndim(time):
        raise SettingError(
            f"a state must be that of one environment, not a batch of {len(time)}; for a batch use "
            f"jax.vmap(env.{function})"
        )
    shape = getattr(state, "shape", None)
    what = repr(state) if shape is None else f"{state.dtype}{list(shape)}"
    raise SettingError(f"a state must be what reset or step returned second, not {what[:80]}")


def checked_action(action: Any, number: int) -> jax.Array:
    """int32[]: the action, with anything out of range as -1."""
    if action is None:
        raise SettingError("an action must be one integer of shape (), not None")
    action = jnp.asarray(action)
    if action.shape != () or not jnp.issubdtype(action.dtype, jnp.integer):
        raise SettingError(
            f"an action must be one integer of shape (), not {action.dtype}"
            f"{list(action.shape)}; for a batch use jax.vmap(env.step)"
        )
    # Compared in the action's own type, before a cast could wrap it around.
    valid = (action >= 0) & (action < number)
    return jnp.where(valid, action, 0).astype(jnp.int32) - (~valid).astype(jnp.int32)


def as_static(field: str, value: Any) -> Any:
    """A setting that can be hashed: tuples in the place of lists and arrays."""
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return tuple(as_static(field, part) for part in value)
    if not isinstance(value, Hashable):
        raise SettingError(
            f"{field} cannot be a {type(value).__name__}: settings are part of compiled programs, "
            "so they must be hashable, as numbers, words and tuples of them are"
        )
    return value


def as_kind(value: Any, default: Any) -> jax.Array:
    """The value as an array of float32, int32 or bool, as its default is."""
    kind = np.asarray(default).dtype.kind
    return jnp.asarray(value).astype({"i": jnp.int32, "b": jnp.bool_}.get(kind, jnp.float32))
