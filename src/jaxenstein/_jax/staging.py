"""Stages that are finished before they are used, which XLA's CPU compiler would compute again.

XLA fuses producers into consumers. Where a consumer has one element per pixel and the producer
one per column, the CPU compiler then repeats the column's work for every pixel, tens of times
slower. `jax.lax.optimization_barrier` forbids it, but the CPU compiler of JAX 0.10 drops the
barrier. A conditional is never fused through, provided its predicate is unknown to the compiler
and is one scalar for the whole batch (a batched predicate turns into a select).
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

# Bits of a NaN that no computation makes.
_NEVER = 0x7FA5A5A5


def staged(stage: Callable[..., Any]) -> Callable[..., Any]:
    """Wrap `stage` so that its results are computed once, into memory, before they are used.

    The stage may take and return any pytrees of arrays of numbers. Works under any nesting of
    `jax.vmap`, and with arguments of which some, but not all, are constants of the program.
    """

    def call(*args: Any) -> Any:
        args = varying(args, args)
        pure, arrays = lifted(stage, *args)
        return _staged(pure)(arrays, *args)

    return call


def _staged(stage: Callable[..., Any]) -> Callable[..., Any]:
    """`staged` of a function that closes over no array."""
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
    """A loop whose number of rounds is that of the batch's longest, for all of the batch.

    `jax.vmap` would keep each member's result back after its own last round, at the cost of a
    select a round. Here further rounds are given to those that need none, and must not harm.

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
    """`repeat` of a body that closes over no array."""

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


# The functions here are used several times over: for each platform, for their shapes, and within
# each other. Python's part of it is done once, and no call is left in the program.
_traced_once = partial(jax.jit, inline=True)


def _behind_barrier(stage: Callable[..., Any]) -> Callable[..., Any]:
    def run(*args: Any) -> Any:
        return varying(lax.optimization_barrier(stage(*args)), args)

    return run


def _behind_cond(stage: Callable[..., Any]) -> Callable[..., Any]:
    def run(*args: Any) -> Any:
        leaves = jax.tree.leaves(args)
        if not all(leaf.size for leaf in leaves):
            return stage(*args)  # a batch of none
        # Of every argument something: what is a constant of the program alone would tell the
        # compiler the answer, as the pose does of a player who always starts at one place.
        # Not of bytes and flags, which may be frames: over devices it is sent around.
        whole = [leaf for leaf in leaves if leaf.dtype.itemsize == 4] or leaves
        witness = sum(jnp.ravel(leaf)[0].astype(jnp.float32) for leaf in whole)
        # True for every float32 but one signalling NaN; the compiler cannot rule that one out.
        always = lax.bitcast_convert_type(witness, jnp.uint32) != jnp.uint32(_NEVER)
        shapes = jax.eval_shape(stage, *args)

        def never(*_: Any) -> Any:
            return varying(zeros(shapes), args)

        def always_so(*args: Any) -> Any:
            return varying(stage(*args), args)

        return lax.cond(always, always_so, never, *args)

    return run
