"""Run directories: everything about an experiment in one folder.

RUN/config.json     every option with its value, and the versions of packages
RUN/metrics.jsonl   a row for each update and run
RUN/timing.jsonl    seconds and steps per second, which no two runs share
RUN/checkpoints/    the last two states
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import json
import os
import platform
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import jax
import numpy as np

from ...errors import JAXensteinError, SettingError, quoted
from ...fields import is_whole
from ...files import atomic, check_links, make_folder, read_text, reason_of, writing
from ...pytree import PyTreeNode
from ...version import __version__
from ..divergence import Divergence, of_state
from ..state import TrainState
from .checkpoints import Checkpoints, Restored
from .experiment import Experiment, check_seeds, exact
from .options import check_grid

CONFIG, CHECKPOINTS, LOCK = "config.json", "checkpoints", ".lock"


class _Networks(PyTreeNode):
    """The part of a `TrainState` that playing needs, under the same names."""

    update: Any
    params: Any
    diverged: Any


class RunFolder:
    """A run directory; see the module.

    Attributes:
        path: of the folder.
        experiment: what is trained in it.
        checkpoints: its checkpoints.
        made_with: the `versions` in a folder that was opened.
    """

    def __init__(self, path: Path, experiment: Experiment) -> None:
        """Take a folder that has been made; see `create` and `open`."""
        self.path = path
        self.experiment = experiment
        self.checkpoints = Checkpoints(path / CHECKPOINTS)
        self.made_with: dict[str, Any] = {}
        self._held = False
        # Paths that this object has created; removed if the training never starts.
        self._made: list[Path] = []

    @classmethod
    def create(cls, path: str | Path, experiment: Experiment) -> RunFolder:
        """Create a run directory, with its configuration.

        If several processes do so at the same moment, one succeeds.

        Raises:
            SettingError: there is a run in that folder, or a link leads out of it.
            OutputError: it cannot be written.
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
            folder._made = [folder.path / CONFIG, *missing]
            folder._write_down(experiment)
        return folder

    def _write_down(self, experiment: Experiment) -> None:
        plain = {**experiment.to_json(), "made_with": self.made_with or versions()}
        with atomic(self.path / CONFIG) as temporary:
            temporary.write_text(json.dumps(plain, indent=2) + "\n", encoding="utf-8")

    def _refuse_a_run(self) -> None:
        if os.path.lexists(self.path / CONFIG):
            raise SettingError(
                f"there is a run in {self.path} already: --resume goes on with it, or choose "
                "another folder"
            )

    @classmethod
    def open(cls, path: str | Path) -> RunFolder:
        """Open a run directory that exists.

        Raises:
            SettingError: there is no run, or its configuration cannot be read.
        """
        path = Path(path)
        file = path / CONFIG
        try:
            plain = json.loads(read_text(file))
        except (FileNotFoundError, NotADirectoryError):
            raise SettingError(_no_run(path)) from None
        except OSError as error:
            raise SettingError(f"cannot read {file}: {reason_of(error)}") from error
        except (ValueError, RecursionError) as error:
            raise SettingError(f"{file} is not JSON: {error}") from error
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
            SettingError: there is a run of another experiment.
            OutputError: it cannot be written.
        """
        if not os.path.lexists(Path(path) / CONFIG):
            return cls.create(path, experiment)
        folder = cls.open(path)
        folder.check_same(experiment)
        return folder

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

    def go_on_as(self, experiment: Experiment) -> None:
        """Make sure that `experiment` is the one of this folder, or the same with more steps.

        More steps are written into the configuration. They do not change what has been trained,
        since nothing depends on their total without `anneal`.

        Raises:
            SettingError: it is another one; the fields that differ are named.
            OutputError: the configuration cannot be written.
        """
        steps = experiment.config.total_steps
        before = self.experiment.config
        longer = dataclasses.replace(self.experiment, config=before.replace(total_steps=steps))
        if steps == before.total_steps or longer.differences(experiment):
            self.check_same(experiment)
            return
        if before.anneal or steps < before.total_steps:
            why = (
                "its learning rate falls to zero over them"
                if before.anneal
                else f"it has {before.total_steps:,} already"
            )
            raise SettingError(
                f"the run in {self.path} cannot go on to {steps:,} steps: {why}; train anew in "
                "another folder"
            )
        with self.locked():
            self._write_down(experiment)
        self.experiment = experiment
        vars(self).pop("template", None)

    def restore(self) -> Restored | None:
        """The newest complete checkpoint, a state with a leading axis of runs, or None.

        Raises:
            CheckpointError: there are some, but none can be read.
        """
        return self.checkpoints.restore(self.template)

    def networks(self) -> tuple[int, Any, dict[int, Divergence]]:
        """The networks of the newest checkpoint.

        Returns:
            Its update, the parameters, [runs, ...], and the diverged runs by number.

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
        """Shapes and dtypes of the state of all runs."""
        return jax.eval_shape(self.experiment.learner.many.init, self.experiment.keys())

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other processes from writing in this folder.

        A new run directory is removed again if the block fails before its first checkpoint.

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
            except Exception:
                if self._made and not self.checkpoints.updates():
                    self._discard()
                raise
            finally:
                self._held = False

    def _discard(self) -> None:
        """Remove the files of a training that never started, and no others."""
        ours = [self.path / name for name in (CHECKPOINTS, LOCK)]
        for path in (*ours, *self._made):
            with contextlib.suppress(OSError):
                path.rmdir() if os.path.isdir(path) else path.unlink()


def _no_run(path: Path) -> str:
    """Why there is no run in a path, and where there is one."""
    if os.path.isfile(path):
        return f"{path} is a file, not a run directory"
    below = sorted(place.parent.name for place in path.glob(f"*/{CONFIG}"))
    if below:
        shown = ", ".join(str(path / name) for name in below[:5])
        more = f" and {len(below) - 5} more" if len(below) > 5 else ""
        return f"there is no run in {path} itself, but in {shown}{more}"
    return f"there is no run in {path}: it has no {CONFIG}"


def _take(file: IO[str]) -> bool:
    """Lock a file for this process, until it ends or the file is closed."""
    try:
        import fcntl
    except ImportError:
        # Elsewhere there is no such lock.
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    # A lock file that another process has removed in the meantime locks nothing.
    return os.fstat(file.fileno()).st_nlink > 0


def checked(experiment: Experiment) -> Experiment:
    """Check the experiment of a file, which anybody may have edited.

    Raises:
        JAXensteinError: it has an entry that `resolve` would not make.
    """
    check_grid(dict(experiment.grid), experiment.config.algo)
    experiment.numbers()
    if not experiment.seeds or not all(map(is_whole, experiment.seeds)):
        raise SettingError(f"'seeds' must be whole numbers, not {quoted(list(experiment.seeds))}")
    if check_seeds(experiment.seeds[0], len(experiment.seeds)) != experiment.seeds:
        raise SettingError(f"'seeds' must follow each other, not {quoted(list(experiment.seeds))}")
    env, _ = experiment.environment.try_out()
    if env.version != experiment.environment.version:
        warnings.warn(of_another_version(experiment, env.version), stacklevel=3)
    return experiment


def of_another_version(experiment: Experiment, now: int) -> str:
    """The message that an experiment's environment is now of another version, with other rules."""
    place = experiment.environment
    return (
        f"it was trained on version {place.version} of {place.id or 'its map'}, which is version "
        f"{now} now: its rules have changed (CHANGELOG.md)"
    )


def run_names(experiment: Experiment) -> list[str]:
    """A name for each run, such as `seed-0` or `bonus_reward-0.1-seed-0`."""
    return [
        "-".join(f"{name}-{exact(value)}" for name, value in run.items()) for run in experiment.runs
    ]


def versions() -> dict[str, str]:
    """The versions that a run depends on; with others its bits may differ."""
    return {
        "jaxenstein": __version__,
        "jax": jax.__version__,
        "python": platform.python_version(),
        "device": jax.devices()[0].device_kind,
    }
