"""Whole updates of recurrent PPO: `training-B`."""

from __future__ import annotations

import jax

import jaxenstein
from benchmarks.subjects.common import (
    ENVIRONMENT_ID,
    ROLLOUT,
    SIZE,
    TRAINED_STEPS,
    Chunk,
    Options,
    Subjects,
    notes,
)
from benchmarks.subjects.own import repeat


def training(batch: int, options: Options) -> Chunk:
    """Recurrent PPO with the paper's network, as one compiled program."""
    from jaxenstein.baselines import Config, Learner

    del options
    # Use an accelerator if there is one, as PyTorch does. This must be set before JAX runs.
    jax.config.update("jax_platforms", None)
    config = Config(
        num_envs=batch,
        rollout=ROLLOUT,
        minibatches=min(4, batch),
        total_steps=TRAINED_STEPS,
    )
    learner = Learner(*jaxenstein.make(ENVIRONMENT_ID, height=SIZE, width=SIZE), config)
    state = learner.init(jax.random.key(0))
    update = jax.jit(lambda state: learner.train_chunk(state, None, 1)[0])
    notes["device"] = jax.devices()[0].device_kind
    notes["parameters"] = f"{sum(leaf.size for leaf in jax.tree.leaves(state.params)):,}"
    return repeat(update, state, config.steps_per_update)


SUBJECTS: Subjects = {"training": training}
