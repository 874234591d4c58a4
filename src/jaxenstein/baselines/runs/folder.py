"""Run directories: everything about an experiment in one folder.

RUN/config.json     the value of every option, and package versions
RUN/metrics.jsonl   a row for each update and run
RUN/timing.jsonl    seconds and steps per second, apart since they never repeat
RUN/checkpoints/    the last two states
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import json
import os
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import jax
import numpy as np

from ...errors import JAXensteinError, SettingError, quoted
from ...fields import is_whole
from ...files import atomic, check_links, make_folder, read_json, writing
from ...machine import made_by
from ...pytree import PyTreeNode
from ..divergence import Divergence, of_state
from ..state import TrainState
from .checkpoints import Checkpoints, Restored
from .experiment import Experiment, check_seeds, exact
from .options import check_grid

CONFIG, CHECKPOINTS, LOCK = "config.json", "checkpoints", ".lock"


class _Networks(PyTreeNode):
    """The fields of a `TrainState` that an agent needs to act."""

    update: Any
    params: Any
    diverged: Any


class RunFolder:
    """A run directory; the docstring of this module lists its files.

    Attributes:
        path: path of the folder.
        experiment: the experiment.
        checkpoints: its checkpoints.
        made_with: the `versions` that an existing run was started with.
    """

    def __init__(self, path: Path, experiment: Experiment) -> None:
        """Use an existing folder; call `create` or `open` instead."""
        self.path = path
        self.experiment = experiment
        self.checkpoints = Checkpoints(path / CHECKPOINTS)
        self.made_with: dict[str, Any] = {}
        self._held = False
        # Paths created here, removed again if training never starts.
        self._made: list[Path] = []

    @classmethod
    def create(cls, path: str | Path, experiment: Experiment) -> RunFolder:
        """Create a run directory, and write its config.

        If several processes try at the same time, one succeeds.

        Raises:
            SettingError: the folder already has a run, or a link leads out of it.
            OutputError: the folder cannot be written to.
        """
        folder = cls(Path(path), experiment)
        folder._refuse_a_run()
        missing = [
            place for place in (folder.path, *folder.path.parents) if not os.path.lexists(place)
        ]
        make_folder(folder.path)
        folder._made = missing
        with folder.locked():
            folder._refuse_a_run()
            if folder.checkpoints.updates():
                raise SettingError(
                    f"{path} has checkpoints of a run without its {CONFIG}: choose another folder"
                )
            folder._made = [folder.path / CONFIG, *missing]
            folder._write_config(experiment)
        return folder

    def _write_config(self, experiment: Experiment) -> None:
        plain = {**experiment.to_json(), "made_with": self.made_with or versions()}
        with atomic(self.path / CONFIG) as temporary:
            temporary.write_text(json.dumps(plain, indent=2) + "\n", encoding="utf-8")

    def _refuse_a_run(self) -> None:
        if os.path.lexists(self.path / CONFIG):
            raise SettingError(
                f"{self.path} already has a run: --resume continues it, or choose another folder"
            )

    @classmethod
    def open(cls, path: str | Path) -> RunFolder:
        """Open an existing run directory.

        Raises:
            SettingError: there is no run, or its config cannot be read.
        """
        path = Path(path)
        file = path / CONFIG
        try:
            plain = read_json(file, "the config of a run")
        except SettingError as error:
            if isinstance(error.__cause__, FileNotFoundError | NotADirectoryError):
                raise SettingError(_no_run(path)) from None
            raise SettingError(f"{file}: {error}") from error
        try:
            folder = cls(path, checked(Experiment.from_json(plain)))
        except JAXensteinError as error:
            raise SettingError(f"{file}: {error}") from error
        made_with = plain.get("made_with")
        folder.made_with = made_with if isinstance(made_with, dict) else {}
        return folder

    @classmethod
    def open_or_create(cls, path: str | Path, experiment: Experiment) -> RunFolder:
        """Open the run directory of an experiment, or create it.

        Raises:
            SettingError: the folder has a run of another experiment.
            OutputError: the folder cannot be written to.
        """
        if not os.path.lexists(Path(path) / CONFIG):
            return cls.create(path, experiment)
        folder = cls.open(path)
        folder.check_same(experiment)
        return folder

    def check_same(self, experiment: Experiment) -> None:
        """Check that `experiment` is the experiment of this folder.

        Raises:
            SettingError: it is not; the message names the fields that differ.
        """
        differing = experiment.differences(self.experiment)
        if differing:
            raise SettingError(f"the run in {self.path} has another config: {'; '.join(differing)}")

    def continue_as(self, experiment: Experiment) -> None:
        """Check that `experiment` is the experiment of this folder, perhaps with more steps.

        A larger number of steps is written into the config. It needs `anneal=False`: the updates so
        far then do not depend on the total.

        Raises:
            SettingError: other fields differ, which the message names, or the steps cannot change.
            OutputError: the config cannot be written.
        """
        steps = experiment.config.total_steps
        before = self.experiment.config
        longer = dataclasses.replace(self.experiment, config=before.replace(total_steps=steps))
        if steps == before.total_steps or longer.differences(experiment):
            self.check_same(experiment)
            return
        if before.anneal or steps < before.total_steps:
            why = (
                "its learning rate is annealed over total_steps"
                if before.anneal
                else f"its total_steps is already {before.total_steps:,}"
            )
            raise SettingError(
                f"the run in {self.path} cannot continue to {steps:,} steps: {why}; start a new "
                "run in another folder"
            )
        with self.locked():
            self._write_config(experiment)
        self.experiment = experiment
        vars(self).pop("template", None)

    def restore(self) -> Restored | None:
        """The newest complete checkpoint, a state with a leading axis of runs; None without one.

        Raises:
            CheckpointError: there are checkpoints, but none can be read.
        """
        return self.checkpoints.restore(self.template)

    def networks(self) -> tuple[int, Any, dict[int, Divergence]]:
        """The networks of the newest checkpoint.

        Returns:
            The update, the parameters [runs, ...], and the diverged runs by number.

        Raises:
            SettingError: there is no checkpoint, or none can be read.

        Warns:
            UserWarning: newer checkpoints are damaged.
        """
        runs, config = len(self.experiment.runs), self.experiment.config
        one = jax.eval_shape(self.experiment.learner.network.init, jax.random.key(0))
        params = jax.tree.map(
            lambda leaf: jax.ShapeDtypeStruct((runs, *leaf.shape), leaf.dtype), one
        )
        number = jax.ShapeDtypeStruct((runs,), np.int32)
        like = _Networks(number, params, number if config.on_divergence == "stop" else None)
        restored = self.checkpoints.restore(like, whole=False)
        if restored is None:
            raise SettingError(f"the run in {self.path} has no checkpoint yet")
        for reason in restored.damaged:
            warnings.warn(f"skipped a damaged checkpoint: {reason}", stacklevel=2)
        state = restored.state
        return restored.update, state.params, of_state(state.update, state.diverged)

    @functools.cached_property
    def template(self) -> TrainState:
        """The shapes and dtypes of the state of all runs."""
        return jax.eval_shape(self.experiment.learner.many.init, self.experiment.keys())

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other processes from writing to this folder.

        If the block fails before its first checkpoint, a new run directory is removed again.

        Raises:
            SettingError: another process has the lock, or a link leads out of the folder.
            OutputError: the lock cannot be written.
        """
        if self._held:
            yield
            return
        check_links(self.path)
        with writing(self.path):
            file = (self.path / LOCK).open("w")
        with file:
            if not _take(file):
                raise SettingError(f"another process is training in {self.path}")
            self._held = True
            try:
                yield
            except BaseException:
                if self._made and not self.checkpoints.updates():
                    self._discard()
                raise
            finally:
                self._held = False

    def _discard(self) -> None:
        """Remove the files of a training that never started, and nothing else."""
        ours = [self.path / name for name in (CHECKPOINTS, LOCK)]
        for path in (*ours, *self._made):
            with contextlib.suppress(OSError):
                path.rmdir() if os.path.isdir(path) else path.unlink()


def has_run(path: Path) -> bool:
    """Whether a folder has a run, perhaps a damaged one, not just the config of another program."""
    if not os.path.lexists(path / CONFIG):
        return False
    try:
        plain = read_json(path / CONFIG, "the config of a run")
    except SettingError:
        return True
    return isinstance(plain, dict) and "format" in plain


def _no_run(path: Path) -> str:
    """The message that a path has no run; it names runs below the path."""
    if os.path.isfile(path):
        return f"{path} is a file, not a run directory"
    below = sorted(place.parent.name for place in path.glob(f"*/{CONFIG}"))
    if below:
        shown = ", ".join(str(path / name) for name in below[:5])
        more = f" and {len(below) - 5} more" if len(below) > 5 else ""
        return f"there is no run in {path} itself; there are runs in {shown}{more}"
    return f"there is no run in {path}: it has no {CONFIG}"


def _take(file: IO[str]) -> bool:
    """Lock a file for this process, until it ends or the file is closed."""
    try:
        import fcntl
    except ImportError:
        # Windows has no such lock.
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        # Some network file systems have no such lock either.
        return True
    # If another process has removed the file in the meantime, it locks nothing.
    return os.fstat(file.fileno()).st_nlink > 0


def checked(experiment: Experiment) -> Experiment:
    """Check an experiment from a file, which a user may have edited.

    Raises:
        JAXensteinError: it has a value that `resolve` would not produce.
    """
    check_grid(dict(experiment.grid), experiment.config.algo)
    experiment.numbers()
    if not experiment.seeds or not all(map(is_whole, experiment.seeds)):
        raise SettingError(f"'seeds' must be whole numbers, not {quoted(list(experiment.seeds))}")
    if check_seeds(experiment.seeds[0], len(experiment.seeds)) != experiment.seeds:
        raise SettingError(f"'seeds' must be consecutive, not {quoted(list(experiment.seeds))}")
    env, _ = experiment.environment.try_out()
    if env.version != experiment.environment.version:
        warnings.warn(of_another_version(experiment, env.version), stacklevel=3)
    return experiment


def of_another_version(experiment: Experiment, now: int) -> str:
    """The message that the environment of an experiment has changed its version."""
    place = experiment.environment
    return (
        f"it was trained on version {place.version} of {place.id or 'its map'}, which is now "
        f"version {now} with other rules (see CHANGELOG.md)"
    )


def run_names(experiment: Experiment) -> list[str]:
    """A name for each run, such as `seed-0` or `bonus_reward-0.1-seed-0`."""
    return [
        "-".join(f"{name}-{exact(value)}" for name, value in run.items()) for run in experiment.runs
    ]


def versions() -> dict[str, str]:
    """The versions that a run depends on; other versions may change its bits."""
    facts = made_by() | {"devices": str(jax.device_count())}
    return {name: facts[name] for name in ("jaxenstein", "jax", "python", "device", "devices")}
