"""Counting what a program lowered for a GPU has in it."""

import jax
import jax.numpy as jnp
from jax import export, lax

from benchmarks.lowered import BATCH, SIZE, count, main


def test_choices_between_platforms_are_no_conditionals():
    def program(values, index, where):
        values = lax.platform_dependent(values, cpu=jnp.cos, default=jnp.sin)
        values = lax.cond(jnp.any(where), jnp.sort, lambda v: v, values)
        pixels = lax.optimization_barrier(values[index])
        return lax.while_loop(lambda p: p[0, 0] < 3, lambda p: p + values[where[0]], pixels)

    values = jnp.ones(8, jnp.float32)
    index = jnp.zeros((BATCH, SIZE * SIZE), jnp.int32)
    exported = export.export(jax.jit(program), platforms=["cuda"])
    found = count(exported(values, index, jnp.zeros(3, jnp.int32)).mlir_module())
    assert found["case"] == found["sort"] == found["while"] == found["optimization_barrier"] == 1
    assert found["pixels"] == 1
    assert found["gather"] >= 1
    assert found["scatter"] == found["custom_call"] == 0


def test_a_row_for_each_environment(capsys):
    main(["simple", "key-door"])
    rows = capsys.readouterr().out.splitlines()
    assert [row.split("|")[1].strip() for row in rows] == ["id", "---", "simple", "key-door"]
    # The renderer reads no pixel out of a table.
    assert [row.split("|")[3].strip() for row in rows[2:]] == ["0", "0"]
