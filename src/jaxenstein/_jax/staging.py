"""Stages that are finished before they are used, so that XLA's CPU compiler does not repeat them.

XLA fuses producers into consumers. If a consumer has one element per pixel and its producer one
per column, the CPU compiler then repeats the work of the column for every pixel, which is tens of
times slower. `jax.lax.optimization_barrier` should prevent this, but the CPU compiler of JAX 0.10
drops the barrier. XLA never fuses through a conditional if the compiler does not know its
predicate and the predicate is one scalar for the whole batch (a batched predicate becomes a
select).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from jax import lax
from jax.custom_batching import custom_vmap

from .batching import lifted, mapped, of_batch, spread, varying, zeros

# Bits of a NaN that no computation produces.
_NEVER = 0x7FA5A5A5


def staged(stage: Callable[..., Any]) -> Callable[..., Any]:
    """Wrap `stage` so that its results are computed once, into memory, before they are used.

    The stage may take and return any pytrees of numeric arrays. Works under any nesting of
    `jax.vmap`. Some arguments, but not all, may be constants of the program.
    """

    def call(*args: Any) -> Any:
        args = varying(args, args)
        pure, arrays = lifted(stage, *args)
        return _staged(pure)(arrays, *args)

    return call


def _staged(stage: Callable[..., Any]) -> Callable[..., Any]:
    """As `staged`, for a function that closes over no arrays."""
    stage = _traced_once(stage)

    @custom_vmap
    def call(*args: Any) -> Any:
        return lax.platform_dependent(
            *args, cpu=_behind_cond(stage), default=_behind_barrier(stage)
        )

    @call.def_vmap
    def _(axis_size: int, in_batched: list[Any], *args: Any) -> tuple[Any, Any]:
        return of_batch(_staged(mapped(stage, axis_size, in_batched))(*args))

    return call


def repeat(body: Callable[..., Any]) -> Callable[..., Any]:
    """Make a loop that runs the whole batch for the number of rounds of its longest member.

    `jax.vmap` would freeze each member after its own last round, at the cost of a select per
    round. Here members may run further rounds, which must do no harm.

    Args:
        body: called as `body(i, carry, constants)` for i = 0, 1, ...; returns the next carry.

    Returns:
        A function of (rounds int32[], carry, constants) that returns the last carry.
    """

    def call(rounds: jax.Array, carry: Any, constants: Any) -> Any:
        carry, constants = varying((carry, constants), rounds, carry, constants)
        pure, arrays = lifted(body, jnp.int32(0), carry, constants)

        def lifted_body(i: jax.Array, carry: Any, constants: Any) -> Any:
            return pure(constants[0], i, carry, constants[1])

        return _repeat(lifted_body)(rounds, carry, (arrays, constants))

    return call


def _repeat(body: Callable[..., Any]) -> Callable[..., Any]:
    """As `repeat`, for a body that closes over no arrays."""

    @custom_vmap
    def call(rounds: jax.Array, carry: Any, constants: Any) -> Any:
        def once(i: jax.Array, carry: Any) -> Any:
            return varying(body(i, carry, constants), carry)

        return lax.fori_loop(0, rounds, once, varying(carry, rounds, carry, constants))

    @call.def_vmap
    def _(
        axis_size: int, in_batched: list[Any], rounds: jax.Array, carry: Any, constants: Any
    ) -> tuple[Any, Any]:
        if in_batched[0]:
            rounds = jnp.max(rounds) if axis_size else jnp.int32(0)
        carry = spread(axis_size, in_batched[1], carry)
        every = jax.tree.map(lambda _: True, carry)
        whole = mapped(body, axis_size, [False, every, in_batched[2]])
        return of_batch(_repeat(whole)(rounds, carry, constants))

    return call


# These functions run several times: for each platform, to find shapes, and within each other.
# `jax.jit` traces them once, and inlining leaves no call in the program.
_traced_once = partial(jax.jit, inline=True)


def _behind_barrier(stage: Callable[..., Any]) -> Callable[..., Any]:
    def run(*args: Any) -> Any:
        return varying(lax.optimization_barrier(stage(*args)), args)

    return run


def _behind_cond(stage: Callable[..., Any]) -> Callable[..., Any]:
    def run(*args: Any) -> Any:
        leaves = [leaf for leaf in jax.tree.leaves(args) if leaf.size]
        if not leaves:
            return stage(*args)  # an empty batch
        # A value from every argument: from constants alone, the compiler could compute the
        # predicate, for example from the pose of a player who always starts at one place.
        # Bytes and bools are left out, because they may be frames, which devices would exchange.
        whole = [leaf for leaf in leaves if leaf.dtype.itemsize == 4] or leaves
        witness = sum(jnp.ravel(leaf)[0].astype(jnp.float32) for leaf in whole)
        # True for every float32 except one signalling NaN, which the compiler cannot rule out.
        always = lax.bitcast_convert_type(witness, jnp.uint32) != jnp.uint32(_NEVER)
        shapes = jax.eval_shape(stage, *args)

        def never(*_: Any) -> Any:
            return varying(zeros(shapes), args)

        def always_so(*args: Any) -> Any:
            return varying(stage(*args), args)

        return lax.cond(always, always_so, never, *args)

    return run
