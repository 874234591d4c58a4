"""Reads and writes trained networks, in run directories and in single files.

A file is an .npz with an array for every leaf of the network of one run, and a `config.json` like
that of a run directory, with the score of the agent and a description of its network. The files of
this package are in `jaxenstein/pretrained`; their names are `pretrained/NAME`.
"""

from __future__ import annotations

import dataclasses
import json
import os
import warnings
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import jax
import numpy as np

from ...errors import DivergenceWarning, JAXensteinError, SettingError, nearest, quoted
from ...fields import check_whole
from ...files import atomic, name_of
from ...intervals import mean_interval
from ...results import Results
from ..divergence import Divergence
from .checkpoints import open_entry, read_tree, reason_of_any
from .description import described
from .experiment import Experiment, exact
from .folder import CONFIG, RunFolder, checked, run_names, versions

Weights = Literal["float16", "float32"]

PRETRAINED, SUFFIX = "pretrained", ".npz"
OWN_POLICY = (
    "give your own agent as --policy MODULE:FUNCTION (see 'Agents of your own' in docs/training.md)"
)
HERE = Path(__file__).parents[2] / PRETRAINED
# The maximum size of a config in bytes.
LONGEST = 2**20


@dataclasses.dataclass(frozen=True)
class Trained:
    """Trained networks with their experiment.

    Attributes:
        name: name of the run directory or file, for display.
        experiment: the experiment with its runs.
        params: parameters of the networks; leaves [runs, ...].
        update: number of updates.
        folder: the run directory; None for a file.
        diverged: the diverged runs by number.
    """

    name: str
    experiment: Experiment
    params: Any
    update: int
    folder: RunFolder | None = None
    diverged: Mapping[int, Divergence] = dataclasses.field(default_factory=dict)

    def warn(self, run: int) -> None:
        """Issue a `DivergenceWarning` if a run diverged or its parameters are not finite."""
        name = run_names(self.experiment)[run]
        if run in self.diverged:
            told = self.diverged[run].message(name)
        elif not self.finite(run):
            told = f"the parameters of {name} are not finite, so its actions are meaningless"
        else:
            return
        warnings.warn(f"{self.name}: {told}", DivergenceWarning, stacklevel=3)

    def finite(self, run: int) -> bool:
        """Whether all parameters of a run are finite."""
        return all(np.all(np.isfinite(leaf[run])) for leaf in jax.tree.leaves(self.params))

    def one(self, run: int) -> Trained:
        """One of the runs, as if it had been trained alone."""
        update = self.diverged[run].update - 1 if run in self.diverged else self.update
        return dataclasses.replace(self._part([run]), update=update)

    def points(self) -> list[Trained]:
        """The runs of each point of the grid, as if they had been trained alone.

        Their names contain the values of the point. Without a grid it is the whole.
        """
        if not self.experiment.grid:
            return [self]
        points: dict[str, list[int]] = {}
        for number, run in enumerate(self.experiment.runs):
            varied = (f"{name} {exact(run[name])}" for name, _ in self.experiment.grid)
            points.setdefault(", ".join([self.name, *varied]), []).append(number)
        return [dataclasses.replace(self._part(runs), name=name) for name, runs in points.items()]

    def _part(self, runs: Sequence[int]) -> Trained:
        """Runs of one point of the grid."""
        seeds = tuple(int(self.experiment.runs[run]["seed"]) for run in runs)
        numbers = dict(self.experiment.runs[runs[0]])
        del numbers["seed"]
        experiment = dataclasses.replace(
            self.experiment,
            seeds=seeds,
            grid=(),
            hparams={**self.experiment.hparams, **numbers},
        )
        params = jax.tree.map(lambda leaf: leaf[np.array(runs)], self.params)
        return Trained(self.name, experiment, params, self.update)


def load_trained(path: str | Path) -> Trained:
    """Load the networks of a run directory, from its newest checkpoint, or of a file.

    Args:
        path: a run directory; a file from `export_policy`, which ends in `.npz`; or
            `pretrained/NAME`, unless that path exists.

    Raises:
        SettingError: there is no such run or file, or it cannot be read.
    """
    path = Path(path)
    if path.suffix == SUFFIX and not os.path.isdir(path):
        return read_trained(path)
    if path.parent == Path(PRETRAINED) and not os.path.exists(path):
        known = pretrained()
        if path.name not in known:
            raise SettingError(
                f"there is no pretrained agent {quoted(path.name)}{nearest(path.name, known)}; "
                f"there are: {', '.join(known) or 'none'}"
            )
        return read_trained(known[path.name])
    if not os.path.exists(path) and path.name in pretrained():
        raise SettingError(
            f"there is no run in {path}; did you mean the pretrained agent "
            f"{PRETRAINED}/{path.name}?"
        )
    if os.path.isfile(path) or (":" in path.name and not os.path.exists(path)):
        raise SettingError(
            f"{path} is neither a run directory nor a {SUFFIX} file from 'jaxenstein export'; "
            f"{OWN_POLICY}"
        )
    return trained_in(RunFolder.open(path))


def trained_in(folder: RunFolder) -> Trained:
    """Load the networks of an open run directory from its newest checkpoint.

    Raises:
        SettingError: there is no checkpoint, or none can be read.
    """
    update, params, diverged = folder.networks()
    return Trained(name_of(folder.path), folder.experiment, params, update, folder, diverged)


def pretrained() -> dict[str, Path]:
    """The files of the agents that come with this package, by name."""
    return {path.stem: path for path in sorted(HERE.glob(f"*{SUFFIX}"))}


def write_trained(file: Path, trained: Trained, weights: Weights, score: Mapping[str, Any]) -> None:
    """Write the network of one run into a file.

    Args:
        file: the file, which ends in `.npz`.
        trained: networks of a single run.
        weights: precision of the weights.
        score: plain JSON values, which `read_config` returns.

    Raises:
        OutputError: the file cannot be written.
    """
    network = described(trained.experiment.learner)
    agent = {"update": trained.update, "weights": weights, "score": score, "network": network}
    plain = {**trained.experiment.to_json(), "made_with": versions(), "agent": agent}
    leaves = jax.tree_util.tree_flatten_with_path(trained.params)[0]
    with (
        atomic(file) as temporary,
        zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive,
    ):
        archive.writestr(CONFIG, json.dumps(plain, indent=2) + "\n")
        for path, leaf in leaves:
            with archive.open(f"{jax.tree_util.keystr(path)}.npy", "w") as entry:
                array = np.asarray(leaf[0], weights, order="C")
                np.save(entry, array)


def score_of(results: Results) -> dict[str, Any]:
    """Summarise results as plain JSON values: means with intervals, and the means of each run."""
    fields = {"return": results.returns, "length": results.lengths, "success": results.successes}
    overall = {name: dataclasses.asdict(mean_interval(values)) for name, values in fields.items()}
    runs = {
        run: {name: float(np.mean(values[number])) for name, values in fields.items()}
        for number, run in enumerate(results.names)
    }
    return {"episodes": results.episodes, **overall, "runs": runs}


def read_trained(file: Path) -> Trained:
    """Read a file of `write_trained`.

    Raises:
        SettingError: there is no such file, or it is damaged or something else.
    """
    plain = read_config(file)
    try:
        experiment = checked(Experiment.from_json(plain))
        update, weights = plain["agent"]["update"], plain["agent"]["weights"]
        if len(experiment.runs) != 1:
            raise SettingError(f"it must have one run, not {len(experiment.runs)}")
        check_whole("agent.update", update, 0)
        if weights not in ("float16", "float32"):
            raise SettingError(f"weights must be float16 or float32, not {quoted(weights)}")
        network = experiment.learner.network
        shapes = jax.eval_shape(network.init, jax.random.key(0))
        like = jax.tree.map(lambda leaf: jax.ShapeDtypeStruct(leaf.shape, weights), shapes)
        with zipfile.ZipFile(file) as archive:
            params = read_tree(archive, like, besides=(CONFIG,))
    except JAXensteinError as error:
        raise SettingError(f"{file}: {error}") from error
    # On a damaged file, the readers can raise any error.
    except Exception as error:
        raise _unreadable(file, error) from error
    params = jax.tree.map(lambda leaf: leaf[None].astype(np.float32), params)
    trained = Trained(file.stem, experiment, params, update)
    if not trained.finite(0):
        raise SettingError(f"{file}: its parameters are not finite")
    return trained


def read_config(file: Path) -> dict[str, Any]:
    """Read the config of a file of `write_trained`: the config of its run, and `agent`.

    Raises:
        SettingError: as in `read_trained`.
    """
    try:
        with zipfile.ZipFile(file) as archive, open_entry(archive, CONFIG) as entry:
            plain = json.loads(entry.read(LONGEST))
        if not isinstance(plain, dict) or not isinstance(plain.get("agent"), dict):
            raise ValueError(f"its {CONFIG} does not describe an agent")
        return plain
    except FileNotFoundError:
        raise SettingError(f"there is no file {file}") from None
    except Exception as error:
        raise _unreadable(file, error) from error


def _unreadable(file: Path, error: Exception) -> SettingError:
    return SettingError(f"{file} is not an agent from 'jaxenstein export': {reason_of_any(error)}")
