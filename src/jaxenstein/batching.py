"""Choices for each member of a batch: what `jax.vmap` makes of a conditional, and at what price."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jax import lax
from jax.custom_batching import custom_vmap


def select(condition: jax.Array, true: Any, false: Any) -> Any:
    """One of two equal pytrees, by one bool[]."""
    return jax.tree.map(lambda a, b: jnp.where(condition, a, b), true, false)


def where_any(function: Callable[..., Any]) -> Callable[..., Any]:
    """Wrap `function` to run for a whole batch only if one of its members needs the result.

    `jax.vmap` would turn a conditional into computing always. On other backends than the CPU
    that is what happens: there a branch costs more, since the host must wait for its predicate.

    Returns:
        A function of (needed bool[], *args), whose result is that of `function(*args)` where
        `needed` is true, and anything elsewhere.
    """
    # For each platform and for its shapes: Python's part of it is done once.
    function = jax.jit(function, inline=True)

    @custom_vmap
    def call(needed: jax.Array, *args: Any) -> Any:
        shapes = jax.eval_shape(function, *args)

        def nothing(*_: Any) -> Any:
            return jax.tree.map(lambda s: jnp.zeros(s.shape, s.dtype), shapes)

        def maybe(*args: Any) -> Any:
            return lax.cond(needed, function, nothing, *args)

        return lax.platform_dependent(*args, cpu=maybe, default=function)

    @call.def_vmap
    def _(axis_size: int, in_batched: list[Any], needed: jax.Array, *args: Any) -> tuple[Any, Any]:
        if in_batched[0]:
            needed = jnp.any(needed)
        axes = jax.tree.map(lambda batched: 0 if batched else None, tuple(in_batched[1:]))
        mapped = jax.vmap(function, in_axes=axes, axis_size=axis_size)
        out = where_any(mapped)(needed, *args)
        return out, jax.tree.map(lambda _: True, out)

    return call
