"""Helpers for adapters to libraries that run inside JAX."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from ..environment import AnyEnvironment, Environment, Info
from ..errors import SettingError, quoted


def check_fit(env: Any, allowed: tuple[str | None, ...], partner: str) -> None:
    """Check that a value is an environment with the resets that the library expects.

    Raises:
        SettingError: it is not; the message says what is needed.
    """
    if not isinstance(env, Environment):
        raise SettingError(
            f"env must be an environment, as jaxenstein.make returns, not {quoted(env)}"
        )
    if env.autoreset not in allowed:
        right = " or ".join(f"autoreset={mode!r}" for mode in allowed)
        raise SettingError(
            f"{partner} needs an environment with {right}, not {quoted(env.autoreset)}"
        )


def first_info(env: AnyEnvironment, key: jax.Array, state: Any, params: Any) -> Info:
    """The `info` right after a reset, as of a step in which nothing happens.

    It has the same entries, shapes and dtypes as in a step, so that both fit one `jax.lax.scan`.
    """
    action = jnp.int32(0)
    shapes = jax.eval_shape(env.advance, key, state, action, params)[-1]
    zeros = {name: jnp.zeros(leaf.shape, leaf.dtype) for name, leaf in shapes.items()}
    return zeros | env.describe(state, params)
