"""What a user waits for besides steps: resets, the first frame, an update of a training.

- `reset-B`: a batch of resets in a scan; options as of `scan-B`;
- `start`: a fresh interpreter that does the option `until` (`UNTIL`) and ends, as one "step"; with
  `cache=yes` it finds its compiled programs where the one before left them;
- `training-B`: whole updates of recurrent PPO on both cores or one; options `id`, `size`, `recipe`,
  `network` and `rollout`, the steps of an update;
- `products-B`: with the options of `training-B`, as many steps as the machine could train if it
  made the matrix products of an update and nothing else (`of=update`), or if it made large ones of
  as many operations (`of=large`).
"""

from __future__ import annotations

import functools
import math
import os
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp

import jaxenstein
from benchmarks.subjects.common import (
    ENVIRONMENT_ID,
    SIZE,
    STEPS_A_CALL,
    TRAINED_STEPS,
    Chunk,
    Options,
    Subjects,
)
from benchmarks.subjects.own import own_environment, repeat

notes: dict[str, str] = {}
MIB = 2**20
# What `start` does in a fresh interpreter: the imports alone, or all up to the second frame.
FIRST_FRAMES = """
import jax, jaxenstein
env, params = jaxenstein.make({id!r})
obs, state = jax.jit(env.reset)(jax.random.key(0), params)
obs, *_ = jax.jit(env.step)(jax.random.key(1), state, 0, params)
assert obs.shape == (64, 64, 3) and jax.block_until_ready(obs).any()
"""
UNTIL = {"jax": "import jax", "jaxenstein": "import jaxenstein", "frames": FIRST_FRAMES}
# Side of the square matrices whose product is the machine's measure.
MATRIX = 2048


def reset(batch: int, options: Options) -> Chunk:
    """Resets of a batch in a compiled scan; a pixel of each frame goes into the next one's key."""
    env, params = own_environment(options)
    steps = max(1, STEPS_A_CALL // 8 // batch)

    def again(carry: Any, _: None) -> tuple[Any, None]:
        key, (obs, _) = carry
        seen = sum(jnp.sum(leaf[:, -1, -1].astype(jnp.uint32)) for leaf in jax.tree.leaves(obs))
        key, reset_key = jax.random.split(jax.random.fold_in(key, seen))
        return (key, resets(jax.random.split(reset_key, batch))), None

    resets = jax.vmap(lambda key: env.reset(key, params))
    first = jax.jit(resets)(jax.random.split(jax.random.key(0), batch))
    program = jax.jit(lambda carry: jax.lax.scan(again, carry, length=steps)[0], donate_argnums=0)
    return repeat(program, (jax.random.key(1), first), batch * steps)


def start(batch: int, options: Options) -> Chunk:
    """A fresh interpreter, from its start to its end."""
    assert batch == 1
    program = UNTIL[options["until"]].format(id=options.get("id", ENVIRONMENT_ID))
    folder = Path(tempfile.mkdtemp(dir=Path.cwd()))
    environment = dict(os.environ)
    environment.pop("JAX_COMPILATION_CACHE_DIR", None)
    if options.get("cache") == "yes":
        environment["JAX_COMPILATION_CACHE_DIR"] = str(folder)
        environment["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = "0"

    def chunk() -> int:
        subprocess.run([sys.executable, "-c", program], check=True, env=environment)
        return 1

    return chunk


def training(batch: int, options: Options) -> Chunk:
    """Recurrent PPO, from environment to update in one compiled program."""
    learner = make_learner(batch, options)
    state = learner.init(jax.random.key(0))
    update = jax.jit(lambda state: learner.train_chunk(state, None, 1)[0])
    held: Any = update.lower(state).compile().memory_analysis()
    notes["device"] = jax.devices()[0].device_kind
    notes["parameters"] = f"{sum(leaf.size for leaf in jax.tree.leaves(state.params)):,}"
    notes["operations of a step in matrix products"] = f"{operations(learner):,.0f}"
    frames = batch * learner.config.rollout * math.prod(learner.spec.images[0])
    notes["MiB"] = (
        f"{frames / MIB:,.0f} of frames in a rollout, {held.argument_size_in_bytes / MIB:,.0f} of "
        f"the training's state, {held.temp_size_in_bytes / MIB:,.0f} at most during an update"
    )
    return repeat(update, state, learner.config.steps_per_update)


def products(batch: int, options: Options) -> Chunk:
    """The matrix products of an update, or large ones of as many operations, and nothing else."""
    learner = make_learner(batch, options)
    steps = learner.config.steps_per_update
    if options["of"] == "large":
        share = 2 * MATRIX**3 / operations(learner)
        square = jax.random.normal(jax.random.key(0), (MATRIX, MATRIX), jnp.float32)
        program = jax.jit(lambda a: (a @ square) / MATRIX)
        return repeat(program, square, round(share))
    programs = []
    for (shapes, axes), times in _products(_update(learner)).items():
        keys = jax.random.split(jax.random.key(0), 2)
        given = [jax.random.normal(k, s, jnp.float32) for k, s in zip(keys, shapes, strict=True)]
        program = jax.jit(functools.partial(jax.lax.dot_general, dimension_numbers=axes))
        programs.append((program, given, times))

    def chunk() -> int:
        for program, given, times in programs:
            for _ in range(times):
                jax.block_until_ready(program(*given))
        return steps

    return chunk


def make_learner(batch: int, options: Options) -> Any:
    """The training that options name."""
    from jaxenstein.baselines import Config, Learner
    from jaxenstein.baselines.runs.options import defaults_of

    # On an accelerator if there is one, as PyTorch does; JAX must not run before.
    jax.config.update("jax_platforms", None)
    named = {name: options[name] for name in ("recipe", "network") if name in options}
    known = Config.__dataclass_fields__
    defaults = defaults_of(named).items()
    values: dict[str, Any] = {name: value for name, value in defaults if name in known}
    values |= {"num_envs": batch, "rollout": int(options.get("rollout", "128"))}
    values |= {"minibatches": min(4, batch), "total_steps": TRAINED_STEPS}
    config = Config(**values)
    size = int(options.get("size", SIZE))
    env, params = jaxenstein.make(options.get("id", ENVIRONMENT_ID), height=size, width=size)
    return Learner(env, params, config)


def operations(learner: Any) -> float:
    """Floating-point operations in the matrix products of an update, a step of it."""
    total = sum(times * _size(*of) for of, times in _products(_update(learner)).items())
    return total / learner.config.steps_per_update


def _update(learner: Any) -> Any:
    """The program of an update."""
    state = jax.eval_shape(learner.init, jax.random.key(0))
    return jax.make_jaxpr(lambda state: learner.train_chunk(state, None, 1)[0])(state).jaxpr


def _size(shapes: Any, axes: Any) -> float:
    """Floating-point operations of a product."""
    (summed, _), (shared, _) = axes
    twice = math.prod(shapes[0][axis] for axis in (*summed, *shared))
    return 2.0 * math.prod(shapes[0]) * math.prod(shapes[1]) / twice


def _products(program: Any) -> Counter[Any]:
    """How often a program makes each matrix product: by shapes and axes, loops run to their end."""
    found: Counter[Any] = Counter()
    for line in program.eqns:
        if line.primitive.name == "dot_general":
            shapes = tuple(value.aval.shape for value in line.invars)
            found[shapes, line.params["dimension_numbers"]] += 1
        times = line.params.get("length", 1) if line.primitive.name == "scan" else 1
        for value in line.params.values():
            for inside in value if isinstance(value, tuple | list) else (value,):
                inside = getattr(inside, "jaxpr", inside)
                if hasattr(inside, "eqns"):
                    for key, count in _products(inside).items():
                        found[key] += times * count
    return found


SUBJECTS: Subjects = {"reset": reset, "start": start, "training": training, "products": products}
