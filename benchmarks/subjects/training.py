"""Whole updates of recurrent PPO: `training-B`, with the option `rollout`, steps per update."""

from __future__ import annotations

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


def training(batch: int, options: Options) -> Chunk:
    """Recurrent PPO with the paper's network, as one compiled program."""
    from jaxenstein.baselines import Config, Learner

    # Use an accelerator if there is one, as PyTorch does. This must be set before JAX runs.
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


SUBJECTS: Subjects = {"training": training}
