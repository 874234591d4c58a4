"""Conditionals for each member of a batch.

With a plain conditional, `jax.vmap` computes both branches for all members.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.custom_batching import custom_vmap

# `where_few` computes this fraction of the batch at a time, but at least this many members.
CHUNK_SHARE, CHUNK = 4, 16


def select(condition: jax.Array, true: Any, false: Any) -> Any:
    """One of two pytrees of the same structure, chosen by one bool[]."""
    return jax.tree.map(lambda a, b: jnp.where(condition, a, b), true, false)


def varying(tree: Any, *like: Any) -> Any:
    """`tree`, marked as varying over the mesh axes over which any of `like` varies.

    Inside `jax.shard_map`, the branches of a conditional must agree about varying axes, and so
    must the carries of a loop; values made from constants do not vary. Elsewhere this is `tree`.
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
    """The mesh axes over which an array varies."""
    kind = jax.typeof(leaf)
    # The attribute was renamed; older JAX versions only have the old name.
    found = kind.vma if hasattr(kind, "vma") else kind.manual_axis_type.varying
    return frozenset(found)


def lifted(function: Callable[..., Any], *args: Any) -> tuple[Callable[..., Any], list[jax.Array]]:
    """Make `function` pure: arrays that it closes over become its first argument.

    `custom_vmap` cannot batch arrays that its function closes over. A `lax.cond` or `lax.switch`
    with a batched predicate batches every array in its branches.

    Returns:
        A function of (arrays, *args) that closes over no arrays, and the arrays. Inside
        `jax.shard_map` it is valid for arguments that vary over the same mesh axes as `args`.
    """
    from jax.extend.core import ClosedJaxpr, jaxpr_as_fun  # imports Pallas

    closed, shapes = jax.make_jaxpr(function, return_shape=True)(*args)
    structure = jax.tree.structure(shapes)

    def pure(arrays: list[jax.Array], *args: Any) -> Any:
        run = jaxpr_as_fun(ClosedJaxpr(closed.jaxpr, arrays))
        return jax.tree.unflatten(structure, run(*jax.tree.leaves(args)))

    return pure, closed.consts


def zeros(shapes: Any) -> Any:
    """Zeros in the shapes and dtypes of a pytree."""
    return jax.tree.map(lambda s: jnp.zeros(s.shape, s.dtype), shapes)


def mapped(function: Callable[..., Any], axis_size: int, in_batched: list[Any]) -> Any:
    """`function` mapped over a batch in which some arguments may lack the batch axis."""
    axes = jax.tree.map(lambda batched: 0 if batched else None, tuple(in_batched))
    return jax.vmap(function, in_axes=axes, axis_size=axis_size)


def spread(axis_size: int, in_batched: Any, args: Any) -> Any:
    """The arguments of a batching rule, all with the batch axis."""

    def one(leaf: jax.Array, batched: bool) -> jax.Array:
        return leaf if batched else jnp.broadcast_to(leaf, (axis_size, *leaf.shape))

    return jax.tree.map(one, args, in_batched)


def of_batch(out: Any) -> tuple[Any, Any]:
    """The return value of a batching rule whose results all have the batch axis."""
    return out, jax.tree.map(lambda _: True, out)


def where_any(function: Callable[..., Any]) -> Callable[..., Any]:
    """Wrap `function` to run for a whole batch only if a member needs the result.

    `jax.vmap` would turn a conditional into computing always. On backends other than the CPU this
    does happen: a branch costs more there, because the host must wait for its predicate.

    Returns:
        A function of (needed bool[], *args). Its result is `function(*args)` where `needed` is
        true, and arbitrary elsewhere.
    """
    return _own_arrays(lambda own: _where_any(own[0]), [function])


def _where_any(function: Callable[..., Any]) -> Callable[..., Any]:
    # Traced once for each platform and set of shapes.
    function = jax.jit(function, inline=True)

    @custom_vmap
    def call(needed: jax.Array, *args: Any) -> Any:
        shapes = jax.eval_shape(function, *args)

        def nothing(*_: Any) -> Any:
            return zeros(shapes)

        def alike(branch: Callable[..., Any]) -> Callable[..., Any]:
            return lambda *values: varying(branch(*values), needed, args)

        def maybe(*args: Any) -> Any:
            return lax.cond(needed, alike(function), alike(nothing), *args)

        return lax.platform_dependent(*args, cpu=maybe, default=alike(function))

    @call.def_vmap
    def _(axis_size: int, in_batched: list[Any], needed: jax.Array, *args: Any) -> tuple[Any, Any]:
        if in_batched[0]:
            needed = jnp.any(needed)
        whole = mapped(function, axis_size, in_batched[1:])
        return of_batch(_where_any(whole)(needed, *args))

    return call


def by_most(branches: Sequence[Callable[..., Any]]) -> Callable[..., Any]:
    """Wrap functions, each of which extends the one before, to run a single one for a batch.

    Otherwise all layers of billboards are always drawn, and a step takes up to a third longer
    (doom-defend-the-center and minigrid-obstructed-maze-full, 256 environments, 64x64 pixels). On
    backends other than the CPU the last function runs, because the host would have to wait for a
    choice.

    Returns:
        A function of (needed int32[...], *args) whose result is `branches[i](*args)`, where i is
        the largest number in `needed` over the whole batch.
    """
    return _own_arrays(_by_most, branches)


def _own_arrays(wrap: Callable[..., Any], branches: Sequence[Callable[..., Any]]) -> Any:
    """Apply `wrap` to functions that may close over arrays; all arrays become an argument."""

    def run(needed: jax.Array, *args: Any) -> Any:
        args = varying(args, needed, args)
        pairs = [lifted(branch, *args) for branch in branches]
        pure, arrays = zip(*pairs, strict=True)

        def own(i: int) -> Callable[..., Any]:
            return lambda arrays, *args: pure[i](arrays[i], *args)

        return wrap([own(i) for i in range(len(pure))])(needed, list(arrays), *args)

    return run


def _switch(branches: Sequence[Callable[..., Any]], needed: jax.Array, *args: Any) -> Any:
    """Run the needed branch; the last one where the host would have to wait for the choice."""

    def alike(branch: Callable[..., Any]) -> Callable[..., Any]:
        return lambda *values: varying(branch(*values), needed, args)

    def chosen(*args: Any) -> Any:
        return lax.switch(jnp.max(needed), [alike(branch) for branch in branches], *args)

    return lax.platform_dependent(*args, cpu=chosen, default=alike(branches[-1]))


def _by_most(branches: Sequence[Callable[..., Any]]) -> Callable[..., Any]:
    branches = [jax.jit(branch, inline=True) for branch in branches]

    @custom_vmap
    def call(needed: jax.Array, *args: Any) -> Any:
        return _switch(branches, needed, *args)

    @call.def_vmap
    def _(axis_size: int, in_batched: list[Any], needed: jax.Array, *args: Any) -> tuple[Any, Any]:
        if in_batched[0] and axis_size:
            needed = jnp.max(needed, axis=0)
        whole = [mapped(branch, axis_size, in_batched[1:]) for branch in branches]
        return of_batch(_by_most(whole)(needed, *args))

    return call


def by_own(branches: Sequence[Callable[..., Any]]) -> Callable[..., Any]:
    """Wrap functions, each of which extends the one before, to run each member's own.

    Members run one after another. Otherwise all members draw as many layers as the member that
    needs most, and a step takes 6 to 16 % longer (JAX 0.12, the environments of `by_most` and
    doom-take-cover). On backends other than the CPU, all members run the last function.

    Returns:
        A function of (needed int32[], *args) whose result is `branches[needed](*args)`.
    """

    def wrap(functions: Sequence[Callable[..., Any]]) -> Callable[..., Any]:
        return _of_batch(functions, lambda own: partial(_switch, own), _one_by_one)

    return _own_arrays(wrap, branches)


def where_few(function: Callable[..., Any], share: int = CHUNK_SHARE) -> Callable[..., Any]:
    """Wrap `function` to run only for the members of a batch that need the result.

    These members are gathered, and computed in chunks of the batch, so that every round computes
    members that need it. Otherwise one member in need makes the whole batch compute. On backends
    other than the CPU it runs for all members, because rounds cost more there than they save.

    Args:
        function: the function to wrap.
        share: a chunk is 1 / share of the batch.

    Returns:
        A function of (needed bool[], *args). Its result is `function(*args)` where `needed` is
        true, and arbitrary elsewhere.
    """
    return _own_arrays(partial(_where_few, share=share), [function])


def _where_few(functions: Sequence[Callable[..., Any]], *, share: int) -> Callable[..., Any]:
    """`where_few` for one `function(shared, *args)`; `shared` must not be batched."""
    return _of_batch(functions, lambda own: _where_any(own[0]), partial(_in_chunks, share))


def _of_batch(
    functions: Sequence[Callable[..., Any]], alone: Callable[..., Any], some: Callable[..., Any]
) -> Callable[..., Any]:
    """For functions of (shared, *args): `alone(functions)`, and `_of_rows` for a batch."""
    functions = [jax.jit(function, inline=True) for function in functions]

    @custom_vmap
    def call(needed: jax.Array, shared: list[jax.Array], *args: Any) -> Any:
        return alone(functions)(needed, shared, *args)

    @call.def_vmap
    def _(axis_size: int, in_batched: list[Any], *args: Any) -> tuple[Any, Any]:
        own, in_batched, args = _unshared(functions, in_batched, args)
        batched = in_batched[0], *in_batched[2:]
        needed, *rest = spread(axis_size, batched, (args[0], *args[2:]))
        return of_batch(_of_rows(own, some)(needed, args[1], *rest))

    return call


def _of_rows(functions: Sequence[Callable[..., Any]], some: Callable[..., Any]) -> Any:
    """Run functions of (shared, *row) for the rows of a batch, each by its need.

    On CPUs this calls `some(functions, needed, *rows)`; elsewhere it runs the last function for
    all rows.
    """

    @custom_vmap
    def call(needed: jax.Array, shared: list[jax.Array], *args: Any) -> Any:
        def of_rows(function: Callable[..., Any], *rows: Any) -> Any:
            return varying(jax.vmap(partial(function, shared))(*rows), needed, shared, args)

        every = [partial(of_rows, function) for function in functions]
        return lax.platform_dependent(
            needed, *args, cpu=partial(some, every), default=lambda _, *rows: every[-1](*rows)
        )

    @call.def_vmap
    def _(axis_size: int, in_batched: list[Any], *args: Any) -> tuple[Any, Any]:
        inner = args[0].shape[-1]

        def repeated(leaf: jax.Array, batched: bool) -> jax.Array:
            row = leaf[:, None] if batched else leaf[None]
            return jnp.broadcast_to(row, (*row.shape[:batched], inner, *row.shape[1 + batched :]))

        if any(jax.tree.leaves(in_batched[1])):
            args = (args[0], jax.tree.map(repeated, args[1], in_batched[1]), *args[2:])
        own, in_batched, args = _unshared(functions, in_batched, args)
        batched = in_batched[0], *in_batched[2:]
        rows = spread(axis_size, batched, (args[0], *args[2:]))
        needed, *rest = jax.tree.map(lambda v: v.reshape(-1, *v.shape[2:]), rows)
        out = _of_rows(own, some)(needed, args[1], *rest)
        return of_batch(jax.tree.map(lambda v: v.reshape(axis_size, inner, *v.shape[1:]), out))

    return call


def _unshared(
    functions: Sequence[Callable[..., Any]], in_batched: list[Any], args: tuple[Any, ...]
) -> tuple[Sequence[Callable[..., Any]], list[Any], tuple[Any, ...]]:
    """If the batch does not share `shared`, make it one more argument of each member."""
    if not any(jax.tree.leaves(in_batched[1])):
        return functions, in_batched, args

    def own(function: Callable[..., Any], _: Any, shared: Any, *rest: Any) -> Any:
        return function(shared, *rest)

    functions = [partial(own, function) for function in functions]
    return functions, [in_batched[0], [], *in_batched[1:]], (args[0], [], *args[1:])


def _in_chunks(
    share: int, functions: Sequence[Callable[..., Any]], needed: jax.Array, *args: Any
) -> Any:
    """Run the only function for the needed rows; other rows are zero."""
    every, count = functions[0], needed.shape[0]
    if not count:
        return every(*args)
    size = min(max(CHUNK, -(-count // share)), count)
    rank = jnp.cumsum(needed, dtype=jnp.int32) - 1
    # Indices past the last needed row are out of range, so setting them has no effect.
    rows = jnp.full(count + size, count, jnp.int32)
    place = jnp.where(needed, rank, count + size)
    rows = rows.at[place].set(np.arange(count, dtype=np.int32), mode="drop")
    shapes = jax.eval_shape(every, *args)
    out = varying(zeros(shapes), needed, args)

    def visit(i: jax.Array, out: Any) -> Any:
        chosen = lax.dynamic_slice_in_dim(rows, i * size, size)
        found = every(*jax.tree.map(lambda v: v.at[chosen].get(mode="clip"), args))
        return jax.tree.map(lambda o, f: o.at[chosen].set(f, mode="drop"), out, found)

    return lax.fori_loop(0, -(-(rank[-1] + 1) // size), visit, out)


def _one_by_one(functions: Sequence[Callable[..., Any]], needed: jax.Array, *args: Any) -> Any:
    """Run each row's own function, one row after another."""
    shapes = jax.eval_shape(functions[-1], *args)
    if not needed.size:
        return functions[-1](*args)

    def none(shape: jax.ShapeDtypeStruct) -> jax.Array:
        # Flat, because filling along a short last axis is slow.
        return lax.optimization_barrier(jnp.zeros(shape.size, shape.dtype)).reshape(shape.shape)

    def visit(i: jax.Array, out: Any) -> Any:
        # Each branch writes to its own place, because its return value would be copied.
        def put(function: Callable[..., Any], out: Any, *args: Any) -> Any:
            found = function(*jax.tree.map(lambda v: lax.dynamic_slice_in_dim(v, i, 1), args))
            return jax.tree.map(
                partial(lax.dynamic_update_slice_in_dim, start_index=i, axis=0), out, found
            )

        return lax.switch(needed[i], [partial(put, function) for function in functions], out, *args)

    return lax.fori_loop(0, needed.size, visit, varying(jax.tree.map(none, shapes), needed, args))
