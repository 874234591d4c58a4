"""Training in a run directory: from its newest checkpoint on, until the experiment is done."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable, Sequence

import jax

from ...errors import SettingError
from ..state import TrainState, place
from .checkpoints import check_space
from .folder import RunFolder, of_another_version, versions
from .metrics import METRICS, MetricsFile, Row, Sink, Timing, read_metrics, rows_of

# Seconds of training between two checkpoints.
SAVE_EVERY = 60.0
# A run stalls if it had so many episodes without a success, and its policy lost this share of its
# first entropy: before that it still explores.
EPISODES = 1000
LOST = 0.5
# Standard errors by which the latest returns must lie above the first ones to have risen.
RISEN = 4.0
ADVICE = "docs/training.md, 'Where it does not learn', says what to try"

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
    steps = experiment.config.steps_per_update
    timing = Timing(folder.path, steps * len(runs), update)
    saved, total = time.monotonic(), experiment.config.updates
    notify(update, [])
    stopped = stop()
    while update < total and not stopped:
        state, metrics = many.train_chunk(state, numbers, min(chunk, total - update))
        rows = rows_of(jax.device_get(metrics), runs, update, steps)
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
    if now != experiment.environment.version:
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


class StallWatch:
    """Looks at the rows of a training, and warns once where no run has succeeded.

    Runs that succeeded once, whose returns have risen, or whose policy is still close to random
    are not told of.
    """

    def __init__(self, runs: int) -> None:
        """Take the number of runs, whose rows alternate."""
        self._runs = runs
        self._episodes = self._successes = 0.0
        self._first: list[float] = []
        self._early, self._late = _Returns(), _Returns()
        self._told = False

    def look(self, rows: Sequence[Row]) -> str | None:
        """The warning if these rows, which follow those of before, are reason for one.

        Args:
            rows: whole updates.
        """
        for start in range(0, len(rows), self._runs):
            update = rows[start : start + self._runs]
            self._episodes += sum(row.get("episodes") or 0 for row in update)
            self._successes += sum(row.get("successes") or 0 for row in update)
            self._returns(update)
            now = [row.get("entropy") or 0.0 for row in update]
            self._first = self._first or now
            settled = all(new < LOST * old for new, old in zip(now, self._first, strict=True))
            enough = self._episodes >= EPISODES * self._runs
            rising = self._late.above(self._early)
            if settled and enough and not rising and not self._successes and not self._told:
                self._told = True
                first, last = (sum(values) / len(values) for values in (self._first, now))
                return (
                    f"no success in {self._episodes:,.0f} episodes, and the entropy of the policy "
                    f"fell from {first:.2g} to {last:.2g}: it settles without having found the "
                    f"goal; {ADVICE}"
                )
        return None

    def _returns(self, rows: Sequence[Row]) -> None:
        """Of the first episodes, a tenth of those that make a warning, and of as many of late."""
        wanted = EPISODES * self._runs / 10
        returns = self._early if self._early.episodes < wanted else self._late
        if self._late.episodes >= wanted:
            returns = self._late = _Returns()
        returns.add(rows)


class _Returns:
    """Mean and spread of the returns of some episodes."""

    def __init__(self) -> None:
        self.episodes = self._sum = self._squares = 0.0

    def add(self, rows: Sequence[Row]) -> None:
        """Take the episodes of some rows as well."""
        self.episodes += sum(row.get("episodes") or 0 for row in rows)
        self._sum += sum(row.get("return_sum") or 0 for row in rows)
        self._squares += sum(row.get("return_square_sum") or 0 for row in rows)

    def above(self, other: _Returns) -> bool:
        """Whether the mean is higher than chance explains."""
        if not self.episodes or not other.episodes:
            return False
        (mean, error), (first, first_error) = self._estimate(), other._estimate()
        return mean - first > RISEN * math.hypot(error, first_error) + 1e-6 * abs(first)

    def _estimate(self) -> tuple[float, float]:
        """The mean, and its standard error."""
        mean = self._sum / self.episodes
        return mean, math.sqrt(max(self._squares / self.episodes - mean**2, 0) / self.episodes)
