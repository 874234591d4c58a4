"""Floating-point operations of a program's matrix products, and what the machine can do of them."""

from __future__ import annotations

import math
import time
from typing import Any

import jax
import jax.numpy as jnp


def matrix_flops(function: Any, *args: Any) -> float:
    """Operations in the matrix products and convolutions of a call: two for each multiply-add.

    XLA's own count takes the body of a loop once; here it is taken as often as a scan runs it.
    Of the branches of a conditional the most expensive counts.

    Raises:
        ValueError: there is a product inside a loop whose length is not known.
    """
    return _of_jaxpr(jax.make_jaxpr(function)(*args).jaxpr)


def _of_jaxpr(jaxpr: Any) -> float:
    return sum(map(_of_equation, jaxpr.eqns))


def _of_equation(equation: Any) -> float:
    name, params = equation.primitive.name, equation.params
    if name == "dot_general":
        (contracted, _), _ = params["dimension_numbers"]
        left = equation.invars[0].aval.shape
        return 2.0 * equation.outvars[0].aval.size * math.prod(left[axis] for axis in contracted)
    if name == "conv_general_dilated":
        kernel = equation.invars[1].aval
        features = kernel.shape[params["dimension_numbers"].rhs_spec[0]]
        return 2.0 * equation.outvars[0].aval.size * kernel.size / features
    if name == "cond":
        return max(map(_of_inner, params["branches"]))
    inner = sum(map(_of_inner, _programs(params)))
    if name == "while" and inner:
        raise ValueError("a matrix product inside a loop of unknown length")
    return inner * params["length"] if name == "scan" else inner


def _programs(params: dict[str, Any]) -> list[Any]:
    return [value for value in params.values() if hasattr(value, "eqns") or hasattr(value, "jaxpr")]


def _of_inner(program: Any) -> float:
    return _of_jaxpr(getattr(program, "jaxpr", program))


def matrix_rate(size: int = 2048, seconds: float = 2.0, dtype: Any = jnp.float32) -> float:
    """Operations a second of a product of two large square matrices, the best of several."""
    matrix = jax.random.normal(jax.random.key(0), (size, size), dtype)
    multiply = jax.jit(jnp.matmul)
    jax.block_until_ready(multiply(matrix, matrix))
    least, end = math.inf, time.perf_counter() + seconds
    while time.perf_counter() < end:
        begin = time.perf_counter()
        jax.block_until_ready(multiply(matrix, matrix))
        least = min(least, time.perf_counter() - begin)
    return 2.0 * size**3 / least
