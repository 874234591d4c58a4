"""What a user waits for besides steps: the first frame, an update of a training.

- `start`: a fresh interpreter that does the option `until` (`UNTIL`) and ends, as one "step"; with
  `cache=yes` it finds its compiled programs where the one before left them;
- `training-B`: whole updates of recurrent PPO; the option `rollout`, the steps of an update.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import jax

import jaxenstein
from benchmarks.subjects.common import (
    ENVIRONMENT_ID,
    TRAINED_STEPS,
    Chunk,
    Options,
    Subjects,
    image_size,
    notes,
)
from benchmarks.subjects.own import repeat

# What `start` does in a fresh interpreter: the imports alone, or all up to the second frame.
FIRST_FRAMES = """
import jax, jaxenstein
env, params = jaxenstein.make({id!r})
obs, state = jax.jit(env.reset)(jax.random.key(0), params)
obs, *_ = jax.jit(env.step)(jax.random.key(1), state, 0, params)
assert obs.shape == (64, 64, 3) and jax.block_until_ready(obs).any()
"""
UNTIL = {"jax": "import jax", "jaxenstein": "import jaxenstein", "frames": FIRST_FRAMES}


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
    """Recurrent PPO with the paper's network, from environment to update in one program."""
    from jaxenstein.baselines import Config, Learner

    # On an accelerator if there is one, as PyTorch does; JAX must not run before.
    jax.config.update("jax_platforms", None)
    config = Config(
        num_envs=batch,
        rollout=int(options.get("rollout", "128")),
        minibatches=min(4, batch),
        total_steps=TRAINED_STEPS,
    )
    width, height = image_size(options)
    learner = Learner(*jaxenstein.make(ENVIRONMENT_ID, height=height, width=width), config)
    state = learner.init(jax.random.key(0))
    update = jax.jit(lambda state: learner.train_chunk(state, None, 1)[0])
    notes["device"] = jax.devices()[0].device_kind
    notes["parameters"] = f"{sum(leaf.size for leaf in jax.tree.leaves(state.params)):,}"
    return repeat(update, state, config.steps_per_update)


SUBJECTS: Subjects = {"start": start, "training": training}
