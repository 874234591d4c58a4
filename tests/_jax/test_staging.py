"""A staged function computes what the plain one does, under every transformation."""

import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxenstein._jax.staging import repeat, staged


def stage(position, table, flags):
    """Several inputs and outputs of several types."""
    total = position["x"].sum() + table.sum()
    return {
        "scaled": table * position["x"][0],
        "any": flags.any(),
        "rest": (
            None,
            jnp.where(flags, total, jnp.float32(-1)),
            position["x_count"] + jnp.int32(1),
        ),
    }


def inputs(*batch: int):
    rng = np.random.default_rng(3)
    position = {
        "x": jnp.asarray(rng.normal(size=(*batch, 2)), jnp.float32),
        "x_count": jnp.asarray(rng.integers(0, 9, batch), jnp.int32),
        "nothing": None,
    }
    table = jnp.asarray(rng.normal(size=(*batch, 5)), jnp.float32)
    flags = jnp.asarray(rng.random((*batch, 3)) < 0.5)
    return position, table, flags


def same(one, other) -> None:
    """Equal trees, types and values."""
    assert jax.tree.structure(one) == jax.tree.structure(other)
    for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        assert a.dtype == b.dtype
        assert a.shape == b.shape
        np.testing.assert_allclose(a, b, rtol=1e-6)


@pytest.mark.parametrize("jitted", [False, True])
def test_alone(jitted: bool) -> None:
    run = jax.jit(staged(stage)) if jitted else staged(stage)
    same(run(*inputs()), stage(*inputs()))


def test_without_compilation() -> None:
    with jax.disable_jit():
        same(staged(stage)(*inputs()), stage(*inputs()))


@pytest.mark.parametrize("jitted", [False, True])
def test_under_vmap(jitted: bool) -> None:
    mapped = jax.vmap(staged(stage))
    run = jax.jit(mapped) if jitted else mapped
    same(run(*inputs(4)), jax.vmap(stage)(*inputs(4)))


@pytest.mark.parametrize("axes", [(0, None, None), (None, 0, None), (None, None, 0), (0, None, 0)])
def test_under_vmap_of_some_arguments(axes) -> None:
    batched, single = inputs(4), inputs()
    args = [b if axis == 0 else s for axis, b, s in zip(axes, batched, single, strict=True)]
    same(jax.vmap(staged(stage), axes)(*args), jax.vmap(stage, axes)(*args))


def test_empty_batch() -> None:
    same(jax.jit(jax.vmap(staged(stage)))(*inputs(0)), jax.vmap(stage)(*inputs(0)))
    looped_none = jax.vmap(looped)(jnp.zeros(0, jnp.int32), jnp.zeros(0, jnp.int32))
    assert [leaf.shape for leaf in looped_none] == [(0,), (0,)]


def test_under_nested_vmaps_of_different_arguments() -> None:
    position, _, flags = inputs(3)
    _, table, _ = inputs(4)

    def nested(run):
        inner = jax.vmap(run, (None, 0, None))
        return jax.jit(jax.vmap(inner, (0, None, 0)))(position, table, flags)

    same(nested(staged(stage)), nested(stage))


def test_under_vmap_of_other_axes_and_of_a_leaf() -> None:
    position, table, flags = inputs(4)
    axes = ({"x": 0, "x_count": None, "nothing": None}, 1, None)
    args = ({**position, "x_count": jnp.int32(2)}, table.T, flags[0])
    same(jax.vmap(staged(stage), axes)(*args), jax.vmap(stage, axes)(*args))


def test_inside_scan_and_vmap() -> None:
    position, table, flags = inputs(4)

    def loop(run):
        def body(carry, _):
            position, table, flags = carry
            out = run(position, table, flags)
            return (position, out["scaled"], ~flags), out["rest"][1]

        def one(p, t, f):
            return jax.lax.scan(body, (p, t, f), length=3)

        return jax.jit(jax.vmap(one))(position, table, flags)

    same(loop(staged(stage)), loop(stage))


def test_batch_of_one_with_special_floats() -> None:
    """The results must not depend on the value that the predicate is taken from."""
    for value in (0.0, -1e30, float("inf"), float("-inf"), float("nan")):
        x = jnp.full((1, 2), value, jnp.float32)
        out = jax.jit(jax.vmap(staged(lambda v: (v, jnp.ones(3, jnp.float32)))))(x)
        np.testing.assert_array_equal(out[0], x)
        np.testing.assert_array_equal(out[1], np.ones((1, 3)))


@pytest.mark.parametrize("still", ["varies", "constant", "unbatched", "constant scalar", "empty"])
def test_nothing_is_fused_through_a_stage(still: str) -> None:
    """Whatever its first argument is, a stage for columns is not computed again for each pixel.

    The compiler fuses through all but a conditional, and a stage is one. Without it the cosine
    of a column would stand beside the sum of its pixel in one fusion.
    """
    closed_over = jnp.zeros(0 if still == "empty" else 1, jnp.float32)
    columns = staged(lambda heading, depth: jnp.cos(depth) + heading + closed_over.sum())

    def draw(heading: jax.Array, depth: jax.Array) -> jax.Array:
        rows = jnp.arange(16, dtype=jnp.float32)
        return columns(heading, depth)[None] + rows[:, None]

    def program(heading: jax.Array, depth: jax.Array) -> jax.Array:
        if still == "constant":
            heading = jnp.ones((4, 1), jnp.float32)
        if still == "constant scalar":
            return jax.vmap(draw, (None, 0))(jnp.float32(2), depth)
        if still == "unbatched":
            return jax.vmap(draw, (None, 0))(heading[0], depth)
        return jax.vmap(draw)(heading, depth)

    args = jnp.ones((4, 1), jnp.float32), jnp.ones((4, 8), jnp.float32)
    text = str(jax.jit(program).lower(*args).compile().as_text())
    parts = text.split("\n\n")
    (cosine,) = [part for part in parts if " cosine(" in part]
    assert len(re.findall(r" conditional\(", text)) == 1
    assert "f32[4,16,8]" not in cosine, "the stage is computed for each pixel"


def test_stages_can_follow_each_other() -> None:
    double, add = staged(lambda x: x * 2), staged(lambda x, y: x + y)
    x = jnp.arange(6, dtype=jnp.float32).reshape(3, 2)
    run = jax.jit(jax.vmap(lambda v: add(double(v), double(v + 1))))
    np.testing.assert_allclose(run(x), 4 * x + 2)


def add_up(i, carry, constants):
    """One round of a loop: rounds beyond a member's own must not harm, hence the mask."""
    total, count = carry
    live = i < constants["own"]
    total = total + jnp.where(live, constants["weight"] * (i + 1), 0)
    return total, count + jnp.where(live, jnp.int32(1), jnp.int32(0))


def loops(own, weight):
    """The expected result of `add_up`, in NumPy."""
    own, weight = np.broadcast_arrays(own, weight)
    return own * (own + 1) // 2 * weight, own


def looped(own, weight):
    start = jnp.int32(0), jnp.int32(0)
    return repeat(add_up)(own, start, {"own": own, "weight": weight})


OWN, WEIGHT = np.array([[0, 5, 2], [1, 0, 9]], np.int32), np.array([3, 1, 2], np.int32)


@pytest.mark.parametrize("rounds", [0, 1, 7])
def test_repeat_alone(rounds: int) -> None:
    out = jax.jit(looped)(jnp.int32(rounds), jnp.int32(4))
    np.testing.assert_array_equal(out, loops(rounds, 4))


def test_repeat_under_nested_vmaps() -> None:
    """Bounds, carries and constants batched separately, two levels deep."""
    nested = jax.jit(jax.vmap(jax.vmap(looped), (0, None)))
    np.testing.assert_array_equal(nested(OWN, WEIGHT), loops(OWN, WEIGHT))
    weights = jax.jit(jax.vmap(looped, (None, 0)))
    np.testing.assert_array_equal(weights(jnp.int32(4), WEIGHT), loops(4, WEIGHT))


def test_repeat_runs_as_often_as_the_longest_member_needs() -> None:
    def count(i, carry, constants):
        return carry + 1

    out = jax.vmap(lambda n: repeat(count)(n, jnp.int32(0), None))(jnp.array([1, 6, 3]))
    np.testing.assert_array_equal(out, [6, 6, 6])
