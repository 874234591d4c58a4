"""Workarounds for the compiler; the results would be the same without them.

- `batching`: without it, `jax.vmap` computes both branches of every conditional for the whole
  batch, so that each step would pay for a reset.
- `staging`: without it, XLA's CPU compiler repeats the work of a column for each of its pixels,
  and is tens of times slower.
- `packing`: without it, a call from Python takes time for each small array that it passes, more
  than for the step itself.
- `inline`: without it, a step of one environment on a CPU waits for other threads.

You can read a task without knowing any of this: `where_few(f)(needed, x)` is `f(x)` where it is
needed, `staged(f)(x)` is `f(x)`, and `varying(x, y)` is `x`.
"""
