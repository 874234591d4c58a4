"""What a step would be on a GPU, read off the program that is lowered for one; needs none.

    python -m benchmarks.lowered my-way-home health-gathering

Counts what is slow there: gathers for every pixel, sorts, scatters, loops and conditionals, for
which the host may have to wait, and calls out of the program. Barriers cut the step into pieces,
each of which is a kernel or some. Nothing is measured.
"""

from __future__ import annotations

import argparse
import math
import re
from collections import Counter
from collections.abc import Sequence

import jax
import jax.numpy as jnp
from jax import export

import jaxenstein
from benchmarks.report.tables import column, markdown

BATCH, SIZE = 1024, 64
_LINE = re.compile(r'(%\w+)(?::\d+)? = "?stablehlo\.(\w+)"?(?:\((%\w+))?')
_RESULT = re.compile(r"-> \(?tensor<((?:\d+x)*)")
COUNTED = ("gather", "scatter", "sort", "while", "custom_call", "optimization_barrier")


def lowered(name: str) -> str:
    """A step of a batch with automatic resets, as StableHLO for CUDA."""
    env, params = jaxenstein.make(name, height=SIZE, width=SIZE)
    key = jax.random.key(0, impl="threefry2x32")
    keys = jax.random.split(key, BATCH)
    _, state = jax.eval_shape(jax.vmap(lambda k: env.reset(k, params)), keys)
    actions = jax.ShapeDtypeStruct((BATCH,), jnp.int32)
    step = jax.jit(jax.vmap(lambda k, s, a: env.step(k, s, a, params)))
    return export.export(step, platforms=["cuda"])(keys, state, actions).mlir_module()


def count(program: str) -> Counter[str]:
    """How often it does each thing of `COUNTED`, `pixels` (gathers of them) and `case`."""
    found: Counter[str] = Counter()
    # Choices between platforms are made already: their index is a constant, or such a choice.
    chosen: set[str] = set()
    for line in program.splitlines():
        if not (parts := _LINE.search(line)):
            continue
        result, kind, argument = parts.groups()
        if kind == "constant" or (kind == "case" and argument in chosen):
            chosen.add(result)
        elif kind in (*COUNTED, "case"):
            found[kind] += 1
        shape = _RESULT.search(line)
        if kind == "gather" and shape:
            sizes = [int(each) for each in shape[1].split("x") if each]
            found["pixels"] += math.prod(sizes) >= BATCH * SIZE * SIZE
    return found


def main(argv: Sequence[str] | None = None) -> None:
    """Print a row for each environment."""
    parser = argparse.ArgumentParser(description="Read programs that are lowered for a GPU.")
    parser.add_argument("ids", nargs="+", metavar="ID", choices=jaxenstein.environment_ids())
    titles = {
        "gather": "gathers", "pixels": "of them of pixels", "scatter": "scatters", "sort": "sorts",
        "while": "loops", "case": "conditionals", "custom_call": "calls out",
        "optimization_barrier": "barriers",
    }  # fmt: skip
    rows = [{"id": name, **dict.fromkeys(titles, 0), **count(lowered(name))}
            for name in parser.parse_args(argv).ids]  # fmt: skip
    columns = [column("id", left=True), *(column(title, key) for key, title in titles.items())]
    print(markdown(columns, rows))


if __name__ == "__main__":
    main()
