"""A run that trains in seconds, for the tests of what is around the training."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jax

from jaxenstein.baselines.runs.experiment import Experiment
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
    """The experiment of `OPTIONS` with some changed."""
    return resolve({**OPTIONS, **changes})


@contextlib.contextmanager
def compiled_into(folder: Path) -> Iterator[None]:
    """Keep compiled programs in a folder, where learners and processes after this find them."""
    names = {
        "jax_compilation_cache_dir": str(folder),
        "jax_persistent_cache_min_compile_time_secs": 0.0,
    }
    before = {name: getattr(jax.config, name) for name in names}
    for name, value in names.items():
        jax.config.update(name, value)
    try:
        yield
    finally:
        for name, value in before.items():
            jax.config.update(name, value)
