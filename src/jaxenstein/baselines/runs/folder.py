"""Run directories: everything about an experiment in one folder, and going on with it.

RUN/config.json     what is trained, resolved: every option with its value, and the versions
RUN/metrics.csv     a row for each update and run; the same in metrics.jsonl
RUN/timing.csv      seconds and steps per second, which no two runs share
RUN/checkpoints/    the last two whole states
"""

from __future__ import annotations

import contextlib
import functools
import json
import os
import platform
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import jax

from ...errors import JAXensteinError, SettingError
from ...files import OutputError, atomic, check_writable, make_folder
from ...version import __version__
from ..learning.config import HParams
from ..learning.placement import place
from ..learning.state import TrainState
from .checkpoints import Checkpoints, Restored, check_space
from .experiment import Experiment, check_seeds
from .metrics import MetricsFiles, Row, Sink, rows_of
from .options import check_grid

CONFIG, CHECKPOINTS, TIMING, LOCK = "config.json", "checkpoints", "timing.csv", ".lock"
# Seconds of training between two checkpoints.
SAVE_EVERY = 60.0

Notify = Callable[[int, Sequence[Row]], object]


class RunFolder:
    """A run directory; see the module.

    Attributes:
        path: of the folder.
        experiment: what is trained in it.
        checkpoints: its checkpoints.
    """

    def __init__(self, path: Path, experiment: Experiment) -> None:
        """Take a folder that has been made; see `create` and `open`."""
        self.path = path
        self.experiment = experiment
        self.checkpoints = Checkpoints(path / CHECKPOINTS)

    @classmethod
    def create(cls, path: str | Path, experiment: Experiment) -> RunFolder:
        """Make a run directory, with its configuration.

        Raises:
            SettingError: there is a run in that folder.
            OutputError: it cannot be written.
        """
        path = Path(path)
        if os.path.exists(path / CONFIG):  # False for names that are too long, too.
            raise SettingError(
                f"there is a run in {path} already: --resume goes on with it, or choose another "
                "folder"
            )
        make_folder(path)
        check_writable(path / CONFIG)
        _probe(path)
        with atomic(path / CONFIG) as temporary:
            text = json.dumps({**experiment.to_json(), "made_with": versions()}, indent=2)
            temporary.write_text(text + "\n", encoding="utf-8")
        return cls(path, experiment)

    @classmethod
    def open(cls, path: str | Path) -> RunFolder:
        """A run directory that exists.

        Raises:
            SettingError: there is no run, or its configuration cannot be read.
        """
        path = Path(path)
        file = path / CONFIG
        try:
            plain = json.loads(file.read_text(encoding="utf-8"))
        except FileNotFoundError:
            raise SettingError(f"there is no run in {path}: it has no {CONFIG}") from None
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            raise SettingError(f"cannot read {file}: {reason}") from error
        except (ValueError, RecursionError) as error:
            raise SettingError(f"{file} is not JSON: {error}") from error
        try:
            return cls(path, _checked(Experiment.from_json(plain)))
        except JAXensteinError as error:
            raise SettingError(f"{file}: {error}") from error

    def check_same(self, experiment: Experiment) -> None:
        """Make sure that `experiment` is the one of this folder.

        Raises:
            SettingError: it is another one; the fields that differ are named.
        """
        differing = experiment.differences(self.experiment)
        if differing:
            raise SettingError(
                f"the run in {self.path} has another configuration: {'; '.join(differing)}"
            )

    def restore(self) -> Restored | None:
        """The newest whole checkpoint, a state with a leading axis of runs; None without one.

        Raises:
            CheckpointError: there are some, but none can be read.
        """
        return self.checkpoints.restore(self.template)

    @functools.cached_property
    def template(self) -> TrainState:
        """Shapes and dtypes of the state of all runs."""
        return jax.eval_shape(self.experiment.learner.many.init, self.experiment.keys())

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other processes from training in this folder.

        Raises:
            SettingError: one does so already, or a link leads out of the folder, where nothing
                may be written.
            OutputError: the lock cannot be written.
        """
        _check_links(self.path)
        try:
            file = (self.path / LOCK).open("w")
        except OSError as error:
            raise OutputError(self.path, (error.strerror or str(error)).lower()) from error
        with file:
            # Elsewhere there is no such lock; the system ends it with the process.
            with contextlib.suppress(ImportError):
                import fcntl

                try:
                    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except OSError as error:
                    raise SettingError(f"another process is training in {self.path}") from error
            yield


def _checked(experiment: Experiment) -> Experiment:
    """The experiment of a file, which anybody may have edited; its names become those of files.

    Raises:
        JAXensteinError: it has an entry that `resolve` would not make.
    """
    try:
        HParams(**experiment.hparams).check()
    except TypeError as error:
        raise SettingError(f"'hparams': {error}") from error
    whole = all(isinstance(s, int) and not isinstance(s, bool) for s in experiment.seeds)
    if not whole or not experiment.seeds:
        raise SettingError(f"'seeds' must be whole numbers, not {list(experiment.seeds)!r}")
    check_seeds(min(experiment.seeds), 1)
    check_seeds(max(experiment.seeds), 1)
    check_grid(dict(experiment.grid))
    experiment.recipe.try_out()
    return experiment


def _check_links(path: Path) -> None:
    """Raise if something below a folder leads out of it: what is written there would go astray."""
    root = path.resolve()
    for folder, names, files in os.walk(path):
        for entry in (Path(folder) / name for name in (*names, *files)):
            if entry.is_symlink() and not entry.resolve().is_relative_to(root):
                raise SettingError(
                    f"{entry} is a link out of the run directory: put what it leads to in its place"
                )


def run_names(experiment: Experiment) -> list[str]:
    """A name for each run, such as `seed-0` or `bonus_reward-0.1-seed-0`."""
    return ["-".join(f"{name}-{value:g}" for name, value in run.items()) for run in experiment.runs]


def versions() -> dict[str, str]:
    """What a run was made with; another one may give other bits."""
    return {
        "jaxenstein": __version__,
        "jax": jax.__version__,
        "python": platform.python_version(),
        "device": jax.devices()[0].device_kind,
    }


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
    writers = [MetricsFiles(folder.path, rows=update * len(runs)), *sinks]
    timing = Timing(folder.path / TIMING, experiment, update)
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


def _begin(folder: RunFolder) -> tuple[int, TrainState]:
    """Updates so far and the state; a first checkpoint shows early whether one can be written."""
    check_space(folder.path, folder.template)
    restored = folder.restore()
    if restored is not None:
        for reason in restored.damaged:
            warnings.warn(f"passed over a damaged checkpoint: {reason}", stacklevel=4)
        return restored.update, place(restored.state, folder.experiment)
    state = folder.experiment.learner.many.init(folder.experiment.keys())
    folder.checkpoints.save(0, state)
    return 0, place(state, folder.experiment)


class Timing:
    """Writes `timing.csv`: how long it took, apart from the metrics, which can be compared."""

    def __init__(self, path: Path, experiment: Experiment, update: int) -> None:
        """Start the clock at an update."""
        self._path = path
        self._steps = experiment.config.steps_per_update * len(experiment.runs)
        self._update, self._start = update, time.monotonic()
        self._before = self._start
        if not path.exists():
            self._append("update,seconds,steps_per_second\n")

    def write(self, update: int) -> None:
        """Append the seconds since this process began, and the rate since the last row."""
        now = time.monotonic()
        rate = (update - self._update) * self._steps / max(now - self._before, 1e-9)
        self._append(f"{update},{now - self._start:.3f},{rate:.1f}\n")
        self._update, self._before = update, now

    def _append(self, text: str) -> None:
        try:
            with self._path.open("a", encoding="utf-8") as file:
                file.write(text)
        except OSError as error:
            raise OutputError(self._path, (error.strerror or str(error)).lower()) from error


def _probe(path: Path) -> None:
    """Find out before anything is trained whether the disk takes what will be written."""
    probe = path / ".probe"
    try:
        probe.write_bytes(b"\0" * 65536)
    except OSError as error:
        raise OutputError(path, (error.strerror or str(error)).lower()) from error
    finally:
        with contextlib.suppress(OSError):
            probe.unlink(missing_ok=True)


def final_state(folder: RunFolder) -> tuple[int, Any]:
    """Updates and state of the newest checkpoint.

    Raises:
        SettingError: there is no checkpoint.
    """
    restored = folder.restore()
    if restored is None:
        raise SettingError(f"the run in {folder.path} has no checkpoint yet")
    return restored.update, restored.state
