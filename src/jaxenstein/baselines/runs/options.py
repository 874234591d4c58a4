"""What may be set of a training: every option with its name, kind and default, and files of them.

The options are those of the environment, the fields of `Presets`, `Config` and `HParams`, those of
every bonus' settings and numbers, and a few that say how many runs there are. A file and the
flags give the same names; flags win.
"""

from __future__ import annotations

import dataclasses
import functools
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...errors import SettingError, nearest, one_line
from ...files import reason_of
from ...settings import Option, check, environment_options, options_of, spec_from
from ...settings import given_by as environment_given_by
from ..learning.algorithms import Algorithm, algorithms, without_removed
from ..learning.config import Config
from ..learning.fields import values_of
from ..learning.hparams import HParams
from .experiment import Experiment, check_seeds
from .presets import Presets, defaults_of

# The size of images, which a run writes down.
SIZE = {"height": 64, "width": 64}
PRESETS, TRAINING, NUMBERS = "presets", "training", "numbers"
RUNS = (
    Option("seed", "runs", "count", 0, "the first seed"),
    Option("seeds", "runs", "count", 1, "number of runs with seeds of their own, side by side"),
    Option("grid", "runs", "table", None, "numbers that differ between runs, with their values"),
)


def all_options() -> dict[str, Option]:
    """Every option, by name."""
    return _options(tuple(algorithms().items()))


@functools.cache
def _options(rows: tuple[tuple[str, Algorithm], ...]) -> dict[str, Option]:
    found = [*options_of(Presets, PRESETS), *RUNS]
    for cls in (Config, *(row.settings for _, row in rows)):
        found += options_of(cls, TRAINING)
    for cls in (HParams, *(row.numbers for _, row in rows)):
        found += options_of(cls, NUMBERS, kind="number")
    options = environment_options() | {option.name: option for option in found}
    # Its parts are options themselves.
    del options["bonus"]
    names = tuple(name for name, _ in rows)
    options["algo"] = dataclasses.replace(options["algo"], kind="choice", choices=names)
    return options


def read_file(path: Path) -> dict[str, Any]:
    """The options of a TOML file, or of a YAML one where PyYAML is installed.

    Raises:
        SettingError: it cannot be read, is no such file, or has an option that there is not.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise SettingError(f"cannot read {path}: {reason_of(error)}") from error
    try:
        given = _yaml(path, text) if path.suffix in (".yaml", ".yml") else tomllib.loads(text)
    except SettingError:
        raise
    except (ValueError, RecursionError) as error:
        raise SettingError(f"{path} is not TOML: {error}") from error
    if not isinstance(given, dict):
        raise SettingError(f"{path} must hold names with values")
    try:
        given = {str(name).replace("-", "_"): value for name, value in given.items()}
        return check(without_removed(given), all_options())
    except SettingError as error:
        raise SettingError(f"{path}: {error}") from None


def _yaml(path: Path, text: str) -> Any:
    try:
        import yaml
    except ImportError as error:
        raise SettingError(
            f"{path}: YAML needs PyYAML ({error}): pip install pyyaml, or write TOML"
        ) from error
    try:
        # A few lines of names for names would stand for more values than there is memory.
        if any(isinstance(event, yaml.AliasEvent) for event in yaml.parse(text)):
            raise yaml.YAMLError("'*name' is not known here; write the value again")
        return yaml.safe_load(text) or {}
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise SettingError(f"{path} is not YAML: {one_line(str(error))}") from error


def resolve(given: Mapping[str, Any]) -> Experiment:
    """The experiment of some options; those not given are the recipe's, or have their defaults.

    A number may be given or varied by the grid, not both.

    Raises:
        JAXensteinError: an option is unknown or has a value it cannot have, or the environment
            and the training do not fit.
    """
    given = check(without_removed(given), all_options())
    for name in given.get("grid") or {}:
        if name.replace("-", "_") in given:
            raise SettingError(f"{name} is given, and varied by the grid: leave one of them out")
    presets, below = defaults_of(given)
    given = {**below, **given}
    default = SIZE if "map" in given else {"env": "simple", **SIZE}
    spec = spec_from({**default, **given})
    config = Config.of(_picked(given, TRAINING))
    hparams = HParams.of(config.algorithm, _picked(given, NUMBERS))
    hparams.check()
    experiment = Experiment(
        spec,
        config,
        hparams.flat(),
        check_seeds(given.get("seed", 0), given.get("seeds", 1)),
        check_grid(given.get("grid") or {}, config.algorithm),
        presets,
    )
    # A network that does not fit the image is told now.
    experiment.learner  # noqa: B018
    return experiment


def given_by(experiment: Experiment) -> dict[str, Any]:
    """The options that `resolve` makes an experiment of."""
    varied = dict(experiment.grid)
    given = {
        **environment_given_by(experiment.spec),
        **values_of(experiment.presets),
        **experiment.config.flat(),
        **{name: value for name, value in experiment.hparams.items() if name not in varied},
        "seed": experiment.seeds[0],
        "seeds": len(experiment.seeds),
        "grid": {name: list(values) for name, values in varied.items()},
    }
    return {name: value for name, value in given.items() if value is not None}


def _picked(given: Mapping[str, Any], group: str) -> dict[str, Any]:
    names = {option.name for option in all_options().values() if option.group == group}
    return {name: value for name, value in given.items() if name in names}


def check_grid(
    table: Mapping[str, Any], algorithm: Algorithm
) -> tuple[tuple[str, tuple[float, ...]], ...]:
    """The numbers of a grid with their values; a `SettingError` for one the algorithm has not."""
    names = list(HParams.of(algorithm, {}).flat())
    grid = []
    for name, values in table.items():
        if name not in names:
            raise SettingError(
                f"unknown number {name!r} in grid{nearest(name, names)}; known: {', '.join(names)}"
            )
        listed = values if isinstance(values, list | tuple) else [values]
        good = [isinstance(value, int | float) and not isinstance(value, bool) for value in listed]
        if not listed or not all(good) or len(set(listed)) < len(listed):
            raise SettingError(f"grid.{name} must be a list of different numbers, not {values!r}")
        for value in listed:
            HParams.of(algorithm, {name: value}).check()
        grid.append((name, tuple(map(float, listed))))
    return tuple(grid)
