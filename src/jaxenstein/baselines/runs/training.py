"""Trains in a run directory, and warns if training stalls."""

from __future__ import annotations

import contextlib
import math
import os
import time
import warnings
from collections.abc import Callable, Sequence

import jax
import numpy as np

from ...errors import SettingError
from ..divergence import METRIC, updates_that_count
from ..state import TrainState, check_spread, place
from .checkpoints import check_space
from .folder import RunFolder, of_another_version, versions
from .metrics import METRICS, MetricsFile, Row, Sink, Timing, read_metrics, rows_of
from .processes import any_process, gathered, is_leader, shared, shared_state

# Default number of seconds between checkpoints.
SAVE_EVERY = 60.0
# Training stalls if EPISODES episodes per run had no success and the entropy of every policy fell
# below LOST times its initial value. Before that, policies still explore.
EPISODES = 1000
LOST = 0.5
# Returns have risen if the latest are this many standard errors above the first.
RISEN = 4.0
# Called with the updates so far and their last rows.
Notify = Callable[[int, Sequence[Row]], object]
ADVICE = "see 'If the agent does not learn' in docs/training.md for what to try"


def train(
    folder: RunFolder,
    *,
    chunk: int = 1,
    save_every: float = SAVE_EVERY,
    sinks: Sequence[Sink] = (),
    notify: Notify = lambda update, rows: None,
    stop: Callable[[], bool] = lambda: False,
) -> int:
    """Train from the newest checkpoint to the end; return the number of updates so far.

    Interruptions, `chunk` and `save_every` do not change the metrics and the final state, bit for
    bit on a CPU. Training also ends once all runs have diverged; `metrics.diverged_runs` returns
    which, and when.

    In several processes (`processes.joined`), each process calls this with the same experiment and
    `chunk`. Only process 0 uses the folder, the sinks and `notify`. A stop in one process stops
    all.

    Args:
        folder: the run directory.
        chunk: updates per call of the compiled program.
        save_every: seconds between checkpoints; the end of training also saves one.
        sinks: further receivers of the rows of metrics.
        notify: called with the updates so far and the rows of each chunk; first without rows.
        stop: called after each chunk; if it returns true, training stops with a checkpoint.

    Raises:
        SettingError: another process trains in the folder, or its files do not belong together.
        OutputError: a file cannot be written.
    """
    experiment, runs = folder.experiment, folder.experiment.runs
    steps, total = experiment.config.steps_per_update, experiment.config.updates
    with folder.locked() if is_leader() else contextlib.nullcontext():
        check_spread(len(runs), experiment.config)
        many, numbers = experiment.learner.many, experiment.numbers()
        update, state = _begin(folder) if is_leader() else (0, None)
        update, state = shared(update), shared_state(state, folder.template)
        state = place(state, experiment.config)
        record = (
            _recorder(folder, update, sinks, notify) if is_leader() else lambda update, rows: None
        )
        saved = time.monotonic()
        # All processes must gather `diverged`, so a stop in one of them comes second.
        (stopped,) = any_process(_all_diverged(state) or stop())
        while update < total and not stopped:
            state, metrics = many.train_chunk(state, numbers, min(chunk, total - update))
            metrics = jax.device_get(gathered(metrics))
            count = updates_that_count(metrics)
            metrics = {name: values[:, :count] for name, values in metrics.items()}
            rows = rows_of(metrics, runs, update, steps)
            update += count
            record(update, rows)
            stopped, due = any_process(
                _all_diverged(state) or stop(), time.monotonic() - saved >= save_every
            )
            if update == total or stopped or due:
                whole = gathered(state)
                if is_leader():
                    folder.checkpoints.save(update, whole)
                saved = time.monotonic()
    return update


def _recorder(folder: RunFolder, update: int, sinks: Sequence[Sink], notify: Notify) -> Notify:
    """Open the files of metrics after so many updates; the result takes the rows of each chunk."""
    experiment, runs = folder.experiment, len(folder.experiment.runs)
    writers = [MetricsFile(folder.path, rows=update * runs), *sinks]
    timing = Timing(folder.path, experiment.config.steps_per_update * runs, update)
    notify(update, [])

    def record(update: int, rows: Sequence[Row]) -> None:
        for writer in writers:
            writer.write(rows)
        timing.write(update)
        notify(update, rows)

    return record


def _all_diverged(state: TrainState) -> bool:
    return state.diverged is not None and bool(np.all(np.asarray(gathered(state.diverged)) > 0))


def _check_versions(folder: RunFolder) -> None:
    """Refuse to resume if the rules have changed, and warn if the bits may differ."""
    experiment = folder.experiment
    now = experiment.learner.env.version
    if now != experiment.environment.version:
        raise SettingError(
            f"the run in {folder.path} cannot be resumed: {of_another_version(experiment, now)}; "
            "start a new run in another folder"
        )
    before = folder.made_with
    others = [
        f"{name} {before[name]}, not {value}"
        for name, value in versions().items()
        if name != "python" and before.get(name, value) != value
    ]
    if others:
        warnings.warn(
            f"the run in {folder.path} was started with {'; '.join(others)}: from here on, its "
            "results may not be bit for bit the same",
            stacklevel=3,
        )


def _begin(folder: RunFolder) -> tuple[int, TrainState]:
    """The updates so far and the state; a new run saves a checkpoint, to detect failures early."""
    check_space(folder.path, folder.template, len(folder.checkpoints.updates()))
    _check_versions(folder)
    restored = folder.restore()
    if restored is not None:
        for reason in restored.damaged:
            warnings.warn(f"skipped a damaged checkpoint: {reason}", stacklevel=3)
        return restored.update, restored.state
    if os.path.exists(folder.path / METRICS) and read_metrics(folder.path):
        raise SettingError(f"the run in {folder.path} has metrics but no checkpoint to resume")
    state = folder.experiment.learner.many.init(folder.experiment.keys())
    folder.checkpoints.save(0, state)
    return 0, state


class StallWatch:
    """Warns once if all policies have become nearly deterministic without any success.

    There is no warning if a run succeeded once, if returns have risen, or if a policy is still
    close to random.
    """

    def __init__(self, runs: int) -> None:
        """Take the number of runs; `check` gets their rows in turn."""
        self._runs, self._warned = runs, False
        self._episodes = self._successes = 0.0
        self._entropies: list[float] = []
        # Episodes, returns and squares of returns, summed over the first and the latest episodes.
        self._early = self._late = np.zeros(3)

    def check(self, rows: Sequence[Row]) -> str | None:
        """Take the next rows, of whole updates; return the warning if there is reason for one."""
        for start in range(0, len(rows), self._runs):
            update = rows[start : start + self._runs]
            self._episodes += _sum(update, "episodes")
            self._successes += _sum(update, "successes")
            self._add_returns(update)
            # The entropy is None if it is not finite.
            now = [row.get("entropy") for row in update]
            self._entropies = self._entropies or [entropy or 0.0 for entropy in now]
            pairs = zip(now, self._entropies, update, strict=True)
            going = [
                (new, old) for new, old, row in pairs if new is not None and not row.get(METRIC)
            ]
            settled = bool(going) and all(new < LOST * old for new, old in going)
            enough = self._episodes >= EPISODES * self._runs
            fine = self._successes or self._warned or _returns_rose(self._early, self._late)
            if settled and enough and not fine:
                self._warned = True
                last, first = np.mean(going, axis=0)
                return (
                    f"no success in {self._episodes:,.0f} episodes, and the entropy of the policy "
                    f"fell from {first:.2g} to {last:.2g}: the policy stops exploring before it "
                    f"has found the goal; {ADVICE}"
                )
        return None

    def _add_returns(self, rows: Sequence[Row]) -> None:
        """Add to the sums over the first or the latest episodes, EPISODES / 10 per run each."""
        wanted = EPISODES * self._runs / 10
        names = ("episodes", "return_sum", "return_square_sum")
        sums = np.array([_sum(rows, name) for name in names])
        if self._early[0] < wanted:
            self._early = self._early + sums
        else:
            self._late = sums if self._late[0] >= wanted else self._late + sums


def _sum(rows: Sequence[Row], name: str) -> float:
    return sum(row.get(name) or 0 for row in rows)


def _returns_rose(early: np.ndarray, late: np.ndarray) -> bool:
    """Whether the mean return of the latest episodes is significantly higher."""
    if not early[0] or not late[0]:
        return False
    (first, first_error), (mean, error) = map(_estimate, (early, late))
    return mean - first > RISEN * math.hypot(error, first_error) + 1e-6 * abs(first)


def _estimate(sums: np.ndarray) -> tuple[float, float]:
    """A mean return and its standard error."""
    number, total, squares = sums
    mean = total / number
    return mean, math.sqrt(max(squares / number - mean**2, 0) / number)
