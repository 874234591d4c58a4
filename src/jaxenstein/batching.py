"""Choices for each member of a batch: what `jax.vmap` makes of a conditional, and at what price."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.custom_batching import custom_vmap

# Members that `where_few` computes at a time: a share of the batch, and the fewest.
CHUNK_SHARE, CHUNK = 4, 16


def select(condition: jax.Array, true: Any, false: Any) -> Any:
    """One of two equal pytrees, by one bool[]."""
    return jax.tree.map(lambda a, b: jnp.where(condition, a, b), true, false)


def varying(tree: Any, *like: Any) -> Any:
    """`tree`, marked as one that differs between devices wherever one of `like` does.

    Inside `jax.shard_map` the branches of a conditional and a loop's first and next carry must
    agree about that, and what is made of constants alone differs nowhere. Elsewhere it is `tree`.
    """
    axes = frozenset().union(*map(_axes, jax.tree.leaves(like)))

    def mark(leaf: Any) -> Any:
        if not (missing := tuple(sorted(axes - _axes(leaf)))):
            return leaf
        if hasattr(lax, "pcast"):
            return lax.pcast(leaf, missing, to="varying")
        return getattr(lax, "pvary")(leaf, missing)  # noqa: B009, JAX before 0.8

    return jax.tree.map(mark, tree) if axes else tree


def _axes(leaf: Any) -> frozenset[str]:
    """The axes of the devices' mesh along which an array differs."""
    kind = jax.typeof(leaf)
    # Its name of old, or that of now, which older versions lack.
    found = kind.vma if hasattr(kind, "vma") else kind.manual_axis_type.varying
    return frozenset(found)


def lifted(function: Callable[..., Any], *args: Any) -> tuple[Callable[..., Any], list[jax.Array]]:
    """`function` for arguments like these, and what it closes over as a first argument of its own.

    `custom_vmap` cannot be batched where the arrays that its function closes over are, and a
    `lax.cond` or `lax.switch` whose choice is batched makes a batch of every array in its branches.

    Returns:
        A function of (arrays, *args) that closes over none, and the arrays. Inside `jax.shard_map`
        it holds for arguments that differ along the same axes of the mesh as these.
    """
    from jax.extend.core import ClosedJaxpr, jaxpr_as_fun  # Pallas comes with it

    closed, shapes = jax.make_jaxpr(function, return_shape=True)(*args)
    structure = jax.tree.structure(shapes)

    def pure(arrays: list[jax.Array], *args: Any) -> Any:
        run = jaxpr_as_fun(ClosedJaxpr(closed.jaxpr, arrays))
        return jax.tree.unflatten(structure, run(*jax.tree.leaves(args)))

    return pure, closed.consts


def where_any(function: Callable[..., Any]) -> Callable[..., Any]:
    """Wrap `function` to run for a whole batch only if one of its members needs the result.

    `jax.vmap` would turn a conditional into computing always. On other backends than the CPU
    that is what happens: there a branch costs more, since the host must wait for its predicate.

    Returns:
        A function of (needed bool[], *args), whose result is that of `function(*args)` where
        `needed` is true, and anything elsewhere.
    """
    return _closed(_where_any, function)


def _closed(wrap: Callable[..., Any], function: Callable[..., Any]) -> Callable[..., Any]:
    """`wrap` of a function that may close over arrays."""

    def run(needed: jax.Array, *args: Any) -> Any:
        args = varying(args, needed, args)
        pure, arrays = lifted(function, *args)
        return wrap(pure)(needed, arrays, *args)

    return run


def _where_any(function: Callable[..., Any]) -> Callable[..., Any]:
    # For each platform and for its shapes: Python's part of it is done once.
    function = jax.jit(function, inline=True)

    @custom_vmap
    def call(needed: jax.Array, *args: Any) -> Any:
        shapes = jax.eval_shape(function, *args)

        def nothing(*_: Any) -> Any:
            return jax.tree.map(lambda s: jnp.zeros(s.shape, s.dtype), shapes)

        def alike(branch: Callable[..., Any]) -> Callable[..., Any]:
            return lambda *values: varying(branch(*values), needed, args)

        def maybe(*args: Any) -> Any:
            return lax.cond(needed, alike(function), alike(nothing), *args)

        return lax.platform_dependent(*args, cpu=maybe, default=alike(function))

    @call.def_vmap
    def _(axis_size: int, in_batched: list[Any], needed: jax.Array, *args: Any) -> tuple[Any, Any]:
        if in_batched[0]:
            needed = jnp.any(needed)
        axes = jax.tree.map(lambda batched: 0 if batched else None, tuple(in_batched[1:]))
        mapped = jax.vmap(function, in_axes=axes, axis_size=axis_size)
        out = _where_any(mapped)(needed, *args)
        return out, jax.tree.map(lambda _: True, out)

    return call


def by_most(branches: Sequence[Callable[..., Any]]) -> Callable[..., Any]:
    """Wrap functions, each of which does what those before it do and more, to run one for a batch.

    On other backends than the CPU that is the last one: there, the host must wait for a choice.

    Returns:
        A function of (needed int32[...], *args) whose result is that of `branches[i](*args)`,
        where i is the greatest number that any member of the batch has anywhere in `needed`.
    """

    def run(needed: jax.Array, *args: Any) -> Any:
        args = varying(args, needed, args)
        pairs = [lifted(branch, *args) for branch in branches]
        pure, arrays = zip(*pairs, strict=True)

        def own(i: int) -> Callable[..., Any]:
            return lambda arrays, *args: pure[i](arrays[i], *args)

        return _by_most([own(i) for i in range(len(pure))])(needed, list(arrays), *args)

    return run


def _by_most(branches: Sequence[Callable[..., Any]]) -> Callable[..., Any]:
    branches = [jax.jit(branch, inline=True) for branch in branches]

    @custom_vmap
    def call(needed: jax.Array, *args: Any) -> Any:
        def alike(branch: Callable[..., Any]) -> Callable[..., Any]:
            return lambda *values: varying(branch(*values), needed, args)

        def chosen(*args: Any) -> Any:
            return lax.switch(jnp.max(needed), [alike(branch) for branch in branches], *args)

        return lax.platform_dependent(*args, cpu=chosen, default=alike(branches[-1]))

    @call.def_vmap
    def _(axis_size: int, in_batched: list[Any], needed: jax.Array, *args: Any) -> tuple[Any, Any]:
        if in_batched[0] and axis_size:
            needed = jnp.max(needed, axis=0)
        axes = jax.tree.map(lambda batched: 0 if batched else None, tuple(in_batched[1:]))
        mapped = [jax.vmap(b, in_axes=axes, axis_size=axis_size) for b in branches]
        out = _by_most(mapped)(needed, *args)
        return out, jax.tree.map(lambda _: True, out)

    return call


def where_few(function: Callable[..., Any], share: int = CHUNK_SHARE) -> Callable[..., Any]:
    """Wrap `function` to run for those members of a batch alone that need the result.

    They are brought together, a part of the batch at a time, so that a round computes for
    members that all need it. On other backends than the CPU it runs for all: there, rounds cost
    more than they save.

    Args:
        function: what is computed.
        share: a part is one in so many of the batch.

    Returns:
        A function of (needed bool[], *args), whose result is that of `function(*args)` where
        `needed` is true, and anything elsewhere.
    """
    return _closed(partial(_where_few, share=share), function)


def _where_few(function: Callable[..., Any], *, share: int) -> Callable[..., Any]:
    """`where_few` of `function(shared, *args)`; what is shared is the same for all of a batch."""
    function = jax.jit(function, inline=True)

    @custom_vmap
    def call(needed: jax.Array, shared: list[jax.Array], *args: Any) -> Any:
        return _where_any(function)(needed, shared, *args)

    @call.def_vmap
    def _(axis_size: int, in_batched: list[Any], *args: Any) -> tuple[Any, Any]:
        own, in_batched, args = _unshared(function, in_batched, args)
        needed, *rest = _spread(axis_size, [in_batched[0], *in_batched[2:]], (args[0], *args[2:]))
        out = _of_rows(own, share)(needed, args[1], *rest)
        return out, jax.tree.map(lambda _: True, out)

    return call


def _of_rows(function: Callable[..., Any], share: int) -> Callable[..., Any]:
    """`function(shared, *row)` of those rows of a batch that need it."""

    @custom_vmap
    def call(needed: jax.Array, shared: list[jax.Array], *args: Any) -> Any:
        def every(*values: Any) -> Any:
            return varying(jax.vmap(partial(function, shared))(*values), needed, shared, args)

        some = partial(_in_chunks, every, share)
        return lax.platform_dependent(needed, *args, cpu=some, default=lambda _, *a: every(*a))

    @call.def_vmap
    def _(axis_size: int, in_batched: list[Any], *args: Any) -> tuple[Any, Any]:
        inner = args[0].shape[-1]

        def repeated(leaf: jax.Array, batched: bool) -> jax.Array:
            row = leaf[:, None] if batched else leaf[None]
            return jnp.broadcast_to(row, (*row.shape[:batched], inner, *row.shape[1 + batched :]))

        if any(jax.tree.leaves(in_batched[1])):
            args = (args[0], jax.tree.map(repeated, args[1], in_batched[1]), *args[2:])
        own, in_batched, args = _unshared(function, in_batched, args)
        rows = _spread(axis_size, [in_batched[0], *in_batched[2:]], (args[0], *args[2:]))
        needed, *rest = jax.tree.map(lambda v: v.reshape(-1, *v.shape[2:]), rows)
        out = _of_rows(own, share)(needed, args[1], *rest)
        out = jax.tree.map(lambda v: v.reshape(axis_size, inner, *v.shape[1:]), out)
        return out, jax.tree.map(lambda _: True, out)

    return call


def _unshared(
    function: Callable[..., Any], in_batched: list[Any], args: tuple[Any, ...]
) -> tuple[Callable[..., Any], list[Any], tuple[Any, ...]]:
    """Where the batch does not share what it should, that as one more of each member's own."""
    if not any(jax.tree.leaves(in_batched[1])):
        return function, in_batched, args

    def own(_: Any, shared: Any, *rest: Any) -> Any:
        return function(shared, *rest)

    return own, [in_batched[0], [], *in_batched[1:]], (args[0], [], *args[1:])


def _spread(axis_size: int, in_batched: list[Any], args: tuple[Any, ...]) -> tuple[Any, ...]:
    """The arguments of a batching rule, all with the batch's axis."""

    def spread(leaf: jax.Array, batched: bool) -> jax.Array:
        return leaf if batched else jnp.broadcast_to(leaf, (axis_size, *leaf.shape))

    return jax.tree.map(spread, args, tuple(in_batched))


def _in_chunks(every: Callable[..., Any], share: int, needed: jax.Array, *args: Any) -> Any:
    """`every(*args)` for the needed rows, zero in the others."""
    count = needed.shape[0]
    if not count:
        return every(*args)
    size = min(max(CHUNK, -(-count // share)), count)
    rank = jnp.cumsum(needed, dtype=jnp.int32) - 1
    # Rows past the last that is needed are no rows at all: what is set there is dropped.
    rows = jnp.full(count + size, count, jnp.int32)
    place = jnp.where(needed, rank, count + size)
    rows = rows.at[place].set(np.arange(count, dtype=np.int32), mode="drop")
    shapes = jax.eval_shape(every, *args)
    none = jax.tree.map(lambda s: jnp.zeros(s.shape, s.dtype), shapes)
    out = varying(none, needed, args)

    def visit(i: jax.Array, out: Any) -> Any:
        chosen = lax.dynamic_slice_in_dim(rows, i * size, size)
        found = every(*jax.tree.map(lambda v: v.at[chosen].get(mode="clip"), args))
        return jax.tree.map(lambda o, f: o.at[chosen].set(f, mode="drop"), out, found)

    return lax.fori_loop(0, -(-(rank[-1] + 1) // size), visit, out)
