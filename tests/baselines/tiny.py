"""A run that trains in seconds, for tests of everything around training."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jax
import numpy as np

from jaxenstein.baselines.runs.experiment import Experiment
from jaxenstein.baselines.runs.folder import CHECKPOINTS, RunFolder
from jaxenstein.baselines.runs.options import resolve

OPTIONS: dict[str, Any] = {
    "map": "####\n#SG#\n####",
    "height": 12,
    "width": 16,
    "horizon": 10,
    "total_steps": 6 * 4 * 8,
    "num_envs": 4,
    "rollout": 8,
    "minibatches": 2,
    "epochs": 2,
    "features": 8,
    "hidden": 8,
    "head": 8,
    "convolutions": [[4, 4, 4]],
    "seeds": 2,
}
UPDATES = 6


def tiny(**changes: Any) -> Experiment:
    """The experiment of `OPTIONS` with changes."""
    return resolve({**OPTIONS, **changes})


def untrained_run(path: Path, experiment: Experiment) -> RunFolder:
    """A run before its first update, whose agents act almost at random."""
    folder = RunFolder.create(path, experiment)
    state = experiment.learner.many.init(experiment.keys())
    # Larger logits: greedy actions that depend on the observation and are far from a tie.
    heads = jax.tree.map(lambda leaf: leaf * np.float32(30), state.params["heads"])
    folder.checkpoints.save(0, state.replace(params={**state.params, "heads": heads}))
    return folder


def same_checkpoints(folder: RunFolder, other: RunFolder, update: int) -> bool:
    """Whether two runs have the same bits in all arrays of their states at an update."""
    paths = [run.path / CHECKPOINTS / f"{update}.npz" for run in (folder, other)]
    with np.load(paths[0]) as one, np.load(paths[1]) as two:
        return one.files == two.files and all(
            one[name].tobytes() == two[name].tobytes() for name in one.files
        )
