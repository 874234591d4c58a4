"""The count of operations, against sums by hand."""

import jax
import jax.numpy as jnp
import pytest

from benchmarks.training.flops import matrix_flops, matrix_rate

A = jnp.ones((3, 4))
B = jnp.ones((4, 5))
PRODUCT = 2 * 3 * 4 * 5


def test_products_and_what_holds_them() -> None:
    assert matrix_flops(jnp.matmul, A, B) == PRODUCT
    assert matrix_flops(jax.jit(lambda a, b: (a @ b) @ b.T), A, B) == 2 * PRODUCT
    assert matrix_flops(lambda a, b: jnp.tanh(a) + b[0, 0], A, B) == 0
    batched = jax.vmap(jnp.matmul, (0, None))
    assert matrix_flops(batched, jnp.ones((7, 3, 4)), B) == 7 * PRODUCT


def test_scans_count_every_turn_and_gradients_count() -> None:
    def turn(carry: jax.Array, _: None) -> tuple[jax.Array, None]:
        return (carry @ B) @ B.T, None

    def scan(a: jax.Array) -> jax.Array:
        return jax.lax.scan(turn, a, None, length=6)[0]

    assert matrix_flops(scan, A) == 6 * 2 * PRODUCT
    # Backwards each product by a constant needs one more.
    assert matrix_flops(jax.grad(lambda a: scan(a).sum()), A) >= 6 * 2 * 2 * PRODUCT - 2 * PRODUCT


def test_the_dearest_branch_counts() -> None:
    def choose(which: jax.Array) -> jax.Array:
        return jax.lax.cond(which, lambda: A @ B, lambda: (A @ B) @ B.T @ B)

    assert matrix_flops(choose, jnp.array(True)) == 3 * PRODUCT


def test_convolutions() -> None:
    def convolve(image: jax.Array, kernel: jax.Array) -> jax.Array:
        return jax.lax.conv_general_dilated(
            image, kernel, (2, 2), "VALID", dimension_numbers=("NHWC", "HWIO", "NHWC")
        )

    # 3x3 places for each of 2 images and 8 features, 4x4x3 products each.
    image, kernel = jnp.ones((2, 8, 8, 3)), jnp.ones((4, 4, 3, 8))
    assert matrix_flops(convolve, image, kernel) == 2 * (2 * 3 * 3 * 8) * (4 * 4 * 3)


def test_a_loop_of_unknown_length_is_refused() -> None:
    def loop(a: jax.Array) -> jax.Array:
        return jax.lax.while_loop(lambda x: x.sum() < 9, lambda x: (x @ B) @ B.T, a)

    with pytest.raises(ValueError, match="unknown length"):
        matrix_flops(loop, A)


def test_a_rate_is_measured() -> None:
    assert matrix_rate(size=64, seconds=0.01) > 0
