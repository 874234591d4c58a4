"""Training in a run directory: from its newest checkpoint on, until the experiment is done."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Sequence

import jax

from ...errors import SettingError
from ..learning.placement import place
from ..learning.state import TrainState
from .checkpoints import check_space
from .folder import RunFolder, of_another_version, versions
from .metrics import METRICS, MetricsFile, Row, Sink, read_metrics, rows_of
from .timing import Timing

# Seconds of training between two checkpoints.
SAVE_EVERY = 60.0

Notify = Callable[[int, Sequence[Row]], object]


def train(
    folder: RunFolder,
    *,
    chunk: int = 1,
    save_every: float = SAVE_EVERY,
    sinks: Sequence[Sink] = (),
    notify: Notify | None = None,
    stop: Callable[[], bool] = lambda: False,
) -> int:
    """Train, from the newest checkpoint on, until the experiment is done.

    However often it is interrupted, and whatever `chunk` and `save_every` are, the metrics and
    the final state are the same, bit for bit on a CPU.

    Args:
        folder: the run directory.
        chunk: updates in one call of the compiled program.
        save_every: seconds between checkpoints; there is one at the end as well.
        sinks: where the rows of metrics go besides the folder.
        notify: called with the updates so far, first with no rows, then with those of each chunk.
        stop: asked after each chunk whether to end early, with a checkpoint.

    Returns:
        The updates that are done.

    Raises:
        SettingError: another process trains there, or its files are not those of the run.
        OutputError: something cannot be written.
    """
    with folder.locked():
        return _train(folder, chunk, save_every, sinks, notify or (lambda *_: None), stop)


def _train(
    folder: RunFolder,
    chunk: int,
    save_every: float,
    sinks: Sequence[Sink],
    notify: Notify,
    stop: Callable[[], bool],
) -> int:
    experiment, checkpoints = folder.experiment, folder.checkpoints
    many, runs, numbers = experiment.learner.many, experiment.runs, experiment.numbers()
    update, state = _begin(folder)
    writers = [MetricsFile(folder.path, rows=update * len(runs)), *sinks]
    timing = Timing(folder.path, experiment, update)
    saved, total = time.monotonic(), experiment.config.updates
    notify(update, [])
    stopped = stop()
    while update < total and not stopped:
        state, metrics = many.train_chunk(state, numbers, min(chunk, total - update))
        rows = rows_of(jax.device_get(metrics), runs, update, experiment.config.steps_per_update)
        update += len(rows) // len(runs)
        for writer in writers:
            writer.write(rows)
        timing.write(update)
        notify(update, rows)
        stopped = stop()
        if update == total or stopped or time.monotonic() - saved >= save_every:
            checkpoints.save(update, state)
            saved = time.monotonic()
    return update


def _check_versions(folder: RunFolder) -> None:
    """Refuse to go on by other rules, and warn where the bits may be others."""
    experiment = folder.experiment
    now = experiment.learner.env.version
    if now != experiment.spec.version:
        raise SettingError(
            f"the run in {folder.path} cannot go on: {of_another_version(experiment, now)}; "
            "train anew in another folder"
        )
    before = folder.made_with
    others = [
        f"{name} {before[name]}, not {value}"
        for name, value in versions().items()
        if name in ("jaxenstein", "jax", "device") and before.get(name, value) != value
    ]
    if others:
        warnings.warn(
            f"the run in {folder.path} began with {'; '.join(others)}: from here on it is not bit "
            "for bit what it would have been",
            stacklevel=4,
        )


def _begin(folder: RunFolder) -> tuple[int, TrainState]:
    """Updates so far and the state; a first checkpoint shows early whether one can be written."""
    check_space(folder.path, folder.template, len(folder.checkpoints.updates()))
    restored = folder.restore()
    if restored is not None:
        _check_versions(folder)
        for reason in restored.damaged:
            warnings.warn(f"passed over a damaged checkpoint: {reason}", stacklevel=4)
        return restored.update, place(restored.state, folder.experiment.config)
    if (folder.path / METRICS).exists() and read_metrics(folder.path):
        raise SettingError(f"the run in {folder.path} has metrics, but no checkpoint to go on from")
    state = folder.experiment.learner.many.init(folder.experiment.keys())
    folder.checkpoints.save(0, state)
    return 0, place(state, folder.experiment.config)
