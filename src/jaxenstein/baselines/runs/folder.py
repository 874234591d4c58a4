"""Run directories: everything about an experiment in one folder.

RUN/config.json     what is trained, resolved: every option with its value, and the versions
RUN/metrics.jsonl   a row for each update and run
RUN/timing.jsonl    seconds and steps per second, which no two runs share
RUN/checkpoints/    the last two whole states
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

from ...errors import JAXensteinError, SettingError
from ...files import atomic, check_links, make_folder, reason_of, writing
from ...pytree import PyTreeNode
from ...version import __version__
from ..learning.state import TrainState
from .checkpoints import Checkpoints, Restored
from .experiment import Experiment, check_seeds, exact
from .options import check_grid

CONFIG, CHECKPOINTS, LOCK = "config.json", "checkpoints", ".lock"


class _Networks(PyTreeNode):
    """What playing needs of a `TrainState`, under the same name."""

    params: Any


class RunFolder:
    """A run directory; see the module.

    Attributes:
        path: of the folder.
        experiment: what is trained in it.
        checkpoints: its checkpoints.
        made_with: as of `versions`, of a folder that was opened.
    """

    def __init__(self, path: Path, experiment: Experiment) -> None:
        """Take a folder that has been made; see `create` and `open`."""
        self.path = path
        self.experiment = experiment
        self.checkpoints = Checkpoints(path / CHECKPOINTS)
        self.made_with: dict[str, Any] = {}
        self._held = False
        # What this object has made, which goes where no training comes of it.
        self._made: list[Path] = []

    @classmethod
    def create(cls, path: str | Path, experiment: Experiment) -> RunFolder:
        """Make a run directory, with its configuration.

        Of several processes that do so at the same moment one succeeds.

        Raises:
            SettingError: there is a run in that folder, or a link leads out of it.
            OutputError: it cannot be written.
        """
        folder = cls(Path(path), experiment)
        folder._refuse_a_run()
        missing = [place for place in (folder.path, *folder.path.parents) if not _exists(place)]
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
        if _exists(self.path / CONFIG):
            raise SettingError(
                f"there is a run in {self.path} already: --resume goes on with it, or choose "
                "another folder"
            )

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
        """The run directory of an experiment, made where there is none.

        Raises:
            SettingError: there is a run of another experiment.
            OutputError: it cannot be written.
        """
        if not _exists(Path(path) / CONFIG):
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
        """Make sure that `experiment` is the one of this folder, or that with more steps.

        More steps are written down; what has been trained stays what it would have been, which is
        so where nothing depends on their total.

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
        """The newest whole checkpoint, a state with a leading axis of runs; None without one.

        Raises:
            CheckpointError: there are some, but none can be read.
        """
        return self.checkpoints.restore(self.template)

    def networks(self) -> tuple[int, Any]:
        """Updates of the newest checkpoint and the parameters of its networks, [runs, ...].

        Raises:
            SettingError: there is no checkpoint, or none can be read.
        """
        runs = len(self.experiment.runs)
        one = jax.eval_shape(self.experiment.learner.network.init, jax.random.key(0))
        like = _Networks(
            jax.tree.map(lambda leaf: jax.ShapeDtypeStruct((runs, *leaf.shape), leaf.dtype), one)
        )
        restored = self.checkpoints.restore(like, whole=False)
        if restored is None:
            raise SettingError(f"the run in {self.path} has no checkpoint yet")
        return restored.update, restored.state.params

    @functools.cached_property
    def template(self) -> TrainState:
        """Shapes and dtypes of the state of all runs."""
        return jax.eval_shape(self.experiment.learner.many.init, self.experiment.keys())

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other processes from writing in this folder.

        A new run directory is removed again where the block fails before its first checkpoint.

        Raises:
            SettingError: one does so already, or a link leads out of the folder, where nothing
                may be written.
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
        """Remove what a training that never began has made; what else is there stays."""
        ours = [self.path / name for name in (CHECKPOINTS, LOCK)]
        for path in (*ours, *self._made):
            with contextlib.suppress(OSError):
                path.rmdir() if path.is_dir() else path.unlink()


def _no_run(path: Path) -> str:
    """Why there is none, and what may have been meant."""
    if path.is_file():
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
    # One that another process has removed in the meantime locks nothing.
    return os.fstat(file.fileno()).st_nlink > 0


def checked(experiment: Experiment) -> Experiment:
    """The experiment of a file, which anybody may have edited; its names become those of files.

    Raises:
        JAXensteinError: it has an entry that `resolve` would not make.
    """
    check_grid(dict(experiment.grid), experiment.config.algorithm)
    experiment.numbers().check()
    whole = all(isinstance(s, int) and not isinstance(s, bool) for s in experiment.seeds)
    if not whole or not experiment.seeds:
        raise SettingError(f"'seeds' must be whole numbers, not {list(experiment.seeds)!r}")
    if check_seeds(experiment.seeds[0], len(experiment.seeds)) != experiment.seeds:
        raise SettingError(f"'seeds' must follow each other, not {list(experiment.seeds)!r}")
    env, _ = experiment.spec.try_out()
    if env.version != experiment.spec.version:
        warnings.warn(of_another_version(experiment, env.version), stacklevel=3)
    return experiment


def of_another_version(experiment: Experiment, now: int) -> str:
    """That an experiment is of other rules than those of its environment's version `now`."""
    spec = experiment.spec
    return (
        f"it was trained on version {spec.version} of {spec.id or 'its map'}, which is version "
        f"{now} now: its rules have changed (CHANGELOG.md)"
    )


def _exists(path: Path) -> bool:
    """Whether there is something; False for names that are too long, too."""
    return os.path.lexists(path)


def run_names(experiment: Experiment) -> list[str]:
    """A name for each run, such as `seed-0` or `bonus_reward-0.1-seed-0`."""
    return [
        "-".join(f"{name}-{exact(value)}" for name, value in run.items()) for run in experiment.runs
    ]


def versions() -> dict[str, str]:
    """What a run was made with; another one may give other bits."""
    return {
        "jaxenstein": __version__,
        "jax": jax.__version__,
        "python": platform.python_version(),
        "device": jax.devices()[0].device_kind,
    }
