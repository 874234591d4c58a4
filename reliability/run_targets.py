"""Configurations of trainings and run directories, as targets of fuzzing. Needs `baselines`."""

from __future__ import annotations

import dataclasses
import functools
import json
import tempfile
import tomllib
from pathlib import Path
from typing import Any

from jaxenstein.baselines.runs.curves import curves_of
from jaxenstein.baselines.runs.experiment import Experiment
from jaxenstein.baselines.runs.folder import RunFolder, train
from jaxenstein.baselines.runs.options import all_options, read_file, resolve

from .cases import Case
from .mutate import Rng, as_text, spoil_bytes, spoil_json, spoil_lines, spoil_tree, spoil_words
from .targets import spoil_one

OPTIONS: dict[str, Any] = {
    "map": "####\n#SG#\n####",
    "height": 12,
    "width": 16,
    "horizon": 10,
    "total_steps": 2 * 4 * 8,
    "num_envs": 4,
    "rollout": 8,
    "minibatches": 2,
    "epochs": 1,
    "features": 8,
    "hidden": 8,
    "head": 8,
    "convolutions": [[4, 4, 4]],
    "seeds": 2,
}
TOML = """\
env = "simple"
algo = "rnd"
height = 12
width = 16
observation = "rgb"
total_steps = 1e4
num_envs = 4
rollout = 8
convolutions = [[4, 4, 4], [2, 1, 8]]
features = 8
hidden = 8
learning_rate = 3e-4
gamma = 0.9
anneal = true
dtype = "float32"
seed = 3
seeds = 2
horizon = 20
[settings]
field_of_view = 75
[params]
move_distance = 0.2
[grid]
bonus_reward = [0.1, 1]
"""
MAP = (
    "map = '''\n####\n#SG#\n####\n'''\nheading = [-10, 10]\nheight = 12\nwidth = 16\nfeatures = 8\n"
)
YAML = """\
env: simple
algo: icm
height: 12
width: 16
num_envs: 4
convolutions: [[4, 4, 4]]
params: {move_distance: 0.2}
grid:
  icm_inverse: [0.1, 1]
"""


class Configurations:
    """Files of options, TOML and YAML, up to an experiment."""

    name, named, quiet = "config", False, True

    def seeds(self) -> list[Case]:
        """With an id, with a map, and in YAML."""
        cases = [Case({"c.toml": text.encode()}) for text in (TOML, MAP)]
        try:
            import yaml  # noqa: F401
        except ImportError:
            return cases
        return [*cases, Case({"c.yaml": YAML.encode()})]

    def spoil(self, case: Case, rng: Rng) -> Case:
        """A change of words, lines or bytes."""
        known = (*all_options(), "[", "]", "{", "}", "[[grid]]", "'''", "true", "rnd", "!!python/x")
        words = as_text(functools.partial(spoil_words, known=known))
        ways = (_spoil_options, words, as_text(spoil_lines), spoil_bytes)
        way = rng.choices(ways, (6, 2, 1, 1))[0]
        return spoil_one(case, rng, {".toml": way, ".yaml": way})

    def run(self, case: Case, folder: Path) -> None:
        """As `jaxenstein train --config` does, up to the training itself."""
        (name,) = case.files
        experiment = resolve(bounded(read_file(Path(name))))
        assert Experiment.from_json(experiment.to_json()) == experiment


def bounded(given: dict[str, Any]) -> dict[str, Any]:
    """The options without sizes that are allowed but more than a test should take."""
    sizes = ("features", "hidden", "head", "rnd_hidden", "rnd_output", "icm_latent", "icm_hidden")
    most = dict.fromkeys(sizes, 64) | {"rnd_layers": 4, "icm_layers": 4, "seeds": 1000}
    return {
        name: min(value, most[name]) if name in most and value > most[name] else value
        for name, value in given.items()
    }


def _spoil_options(data: bytes, rng: Rng) -> bytes:
    """TOML or YAML with a value changed, as TOML, whose values are those of JSON but for null."""
    try:
        tree = tomllib.loads(data.decode())
    except (ValueError, RecursionError):
        return as_text(spoil_words)(data, rng)
    known = (*all_options(), "rnd", "icm", "simple", [[4, 4, 4]], {"gamma": [0.9]}, [0.1, 1])
    spoilt = spoil_tree(tree, rng, known)
    if not isinstance(spoilt, dict):
        return data
    lines = [f"{json.dumps(name)} = {_toml(value)}" for name, value in spoilt.items()]
    return "\n".join(lines).encode("utf-8", "surrogatepass")


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(k)} = {_toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return json.dumps(value).replace("Infinity", "inf").replace("NaN", "nan")


class Runs:
    """Run directories: configuration, checkpoints, metrics; they are read and left as they are."""

    name, named, quiet = "run", True, True

    @functools.cached_property
    def _case(self) -> Case:
        """A run that was trained in seconds."""
        with tempfile.TemporaryDirectory() as name:
            folder = RunFolder.create(Path(name) / "run", resolve(OPTIONS))
            train(folder)
            files = {
                str(path.relative_to(name)): path.read_bytes()
                for path in sorted(Path(name).rglob("*"))
                if path.is_file()
            }
        return Case(files)

    @functools.cached_property
    def _experiment(self) -> Experiment:
        return resolve(OPTIONS)

    @functools.cached_property
    def _template(self) -> Any:
        with tempfile.TemporaryDirectory() as name:
            return RunFolder(Path(name), self._experiment).template

    def seeds(self) -> list[Case]:
        """The whole run, and one with its last checkpoint alone."""
        files = self._case.files
        first = {name: data for name, data in files.items() if "/checkpoints/0/" not in name}
        return [self._case, Case(first)]

    def spoil(self, case: Case, rng: Rng) -> Case:
        """A change of one file; or one that is gone, empty, or another's."""
        if rng.random() < 0.2:
            name, other = rng.choice(list(case.files)), rng.choice(list(case.files))
            files = {key: data for key, data in case.files.items() if key != name}
            if rng.random() < 0.5 or not files:
                files[name] = rng.choice((b"", case.files[other]))
            return dataclasses.replace(case, files=files)
        plain = ("run/config.json", "metrics.jsonl", "metrics.csv", "checkpoint.json")
        some = [name for name in case.files if name.endswith(plain)]
        if some and rng.random() < 0.6:
            name = rng.choice(some)
            part = spoil_one(Case({name: case.files[name]}), rng, {".jsonl": _spoil_line, **_JSON})
            return dataclasses.replace(case, files={**case.files, **part.files})
        return spoil_one(case, rng, _JSON)

    def run(self, case: Case, folder: Path) -> None:
        """Open the run, restore its newest checkpoint, and read its metrics."""
        opened = RunFolder.open("run")
        if opened.experiment == self._experiment:
            restored = opened.checkpoints.restore(self._template)
        else:
            restored = opened.restore()
        assert restored is None or restored.update >= 0
        curves_of(Path("run"), "return", 10)


def _spoil_line(data: bytes, rng: Rng) -> bytes:
    """A change of one of some lines of JSON."""
    lines = data.split(b"\n")
    place = rng.randrange(len(lines))
    lines[place] = spoil_json(lines[place], rng)
    return b"\n".join(lines)


_JSON = {".json": spoil_json}
