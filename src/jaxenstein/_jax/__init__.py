"""What exists for the compiler's sake alone: the results would be the same without it.

- `batching`: without it, `jax.vmap` computes both sides of every choice for all of a batch, so that
  each step would pay for a reset.
- `staging`: without it, XLA's CPU compiler computes a column's work again for each of its pixels,
  tens of times slower.
- `packing`: without it, a call from Python pays for each small array that it hands over, more than
  for the step itself.

A task is understood without reading any of it: `where_few(f)(needed, x)` is `f(x)` where it is
needed, `staged(f)(x)` is `f(x)`, and `varying(x, y)` is `x`.
"""
