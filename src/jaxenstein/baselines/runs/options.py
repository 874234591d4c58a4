"""What may be set: every option with its name, kind and default, from flags and from files.

The options are the fields of `Config` and `HParams`, those of every bonus' settings and numbers,
and a few that say which environment is trained on and how many runs. A file and the flags give
the same names; flags win.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import tomllib
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from ...docstrings import attributes
from ...errors import SettingError, nearest
from ...recipe import Recipe
from ...registry import portable_id
from ..learning.algorithms import Algorithm, algorithms
from ..learning.config import Config
from ..learning.hparams import HParams
from .experiment import OF_RECIPE, Experiment, as_tuples, check_seeds, config_of

Kind = Literal["count", "number", "flag", "choice", "layers", "angle", "text", "table"]

OBSERVATIONS = ("rgb", "gray", "depth", "labels", "dict")


@dataclasses.dataclass(frozen=True)
class Option:
    """One thing that may be set.

    Attributes:
        name: as in a file; the flag has hyphens for underscores.
        group: what it belongs to, for the help.
        kind: what its values are.
        default: its value if nothing is said.
        help: what it does.
        choices: the values there are, if they are few.
    """

    name: str
    group: str
    kind: Kind
    default: Any
    help: str
    choices: tuple[str, ...] = ()


_PLACE = "environment"
_TRAINING = "training"
_NUMBERS = "numbers"
_RUNS = "runs"
OWN = (
    Option("env", _PLACE, "text", "simple", "id of the environment, see 'jaxenstein list'"),
    Option("map", _PLACE, "text", None, "a map as text, instead of env"),
    Option("map_file", _PLACE, "text", None, "a file with a map, instead of env"),
    Option(
        "heading",
        _PLACE,
        "angle",
        None,
        "first heading on that map, degrees, or LOW,HIGH (default: any)",
    ),
    Option("height", _PLACE, "count", 64, "image height in pixels"),
    Option("width", _PLACE, "count", 64, "image width in pixels"),
    Option("observation", _PLACE, "choice", "rgb", "what the agent sees", OBSERVATIONS),
    Option("frame_skip", _PLACE, "count", 1, "steps of the world for which an action is taken"),
    Option("horizon", _PLACE, "count", None, "most steps of the world in an episode"),
    Option("settings", _PLACE, "table", None, "other settings of jaxenstein.make"),
    Option("params", _PLACE, "table", None, "numbers of the environment's params"),
    Option("seed", _RUNS, "count", 0, "the first seed"),
    Option("seeds", _RUNS, "count", 1, "number of runs with seeds of their own, side by side"),
    Option("grid", _RUNS, "table", None, "numbers that differ between runs, with their values"),
)
# Texts that come with a map file; see `jaxenstein.maps.map_files.read_map`.
MAP_TEXTS = ("regions", "faces")


def all_options() -> dict[str, Option]:
    """Every option, by name."""
    return _options(tuple(algorithms().items()))


@functools.cache
def _options(rows: tuple[tuple[str, Algorithm], ...]) -> dict[str, Option]:
    found = list(OWN)
    for cls in (Config, *(row.settings for _, row in rows)):
        found += _fields(cls, _TRAINING)
    for cls in (HParams, *(row.numbers for _, row in rows)):
        found += _fields(cls, _NUMBERS)
    return {option.name: option for option in found}


def _fields(cls: type, group: str) -> list[Option]:
    """The options that the fields of settings or numbers are."""
    helps, hints = _help_texts(cls), typing.get_type_hints(cls)
    found = []
    for field in dataclasses.fields(cls):
        if field.name in (*OF_RECIPE, "bonus"):
            continue
        kind, choices = ("number", ()) if group == _NUMBERS else _kind(hints[field.name])
        text = helps.get(field.name, "")
        found.append(Option(field.name, group, kind, field.default, text, choices))
    return found


def _kind(hint: Any) -> tuple[Kind, tuple[str, ...]]:
    if hint is bool:
        return "flag", ()
    if hint is int:
        return "count", ()
    if typing.get_origin(hint) is Literal:
        return "choice", typing.get_args(hint)
    if hint is str:
        return "choice", tuple(algorithms())
    return "layers", ()


def _help_texts(cls: type) -> dict[str, str]:
    """What the docstring says of each attribute; where docstrings are stripped it says so."""
    texts = {name: text.replace("`", "").rstrip(".") for name, text in attributes(cls).items()}
    return texts or {
        field.name: "(python -OO strips the explanation)" for field in dataclasses.fields(cls)
    }


def read_file(path: Path) -> dict[str, Any]:
    """The options of a TOML file, or of a YAML one where PyYAML is installed.

    Raises:
        SettingError: it cannot be read, is no such file, or has an option that there is not.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise SettingError(f"cannot read {path}: {reason.lower()}") from error
    try:
        given = _yaml(path, text) if path.suffix in (".yaml", ".yml") else tomllib.loads(text)
    except SettingError:
        raise
    except (ValueError, RecursionError) as error:
        raise SettingError(f"{path} is not TOML: {error}") from error
    if not isinstance(given, dict):
        raise SettingError(f"{path} must hold names with values")
    try:
        return check({str(name).replace("-", "_"): value for name, value in given.items()})
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
        raise SettingError(f"{path} is not YAML: {' '.join(str(error).split())}") from error


def check(given: Mapping[str, Any]) -> dict[str, Any]:
    """Check names and kinds of options; whole numbers may be written as 3e6.

    Raises:
        SettingError: there is no such option, or its value is of another kind.
    """
    known = all_options()
    checked = {}
    for name, value in given.items():
        if name in MAP_TEXTS:
            checked[name] = value
        elif name not in known:
            raise SettingError(f"unknown option {name!r}{nearest(name, known)}")
        else:
            checked[name] = coerce(known[name], value)
    return checked


def coerce(option: Option, value: Any) -> Any:
    """A value of an option from a file, as its kind.

    Raises:
        SettingError: it is of another kind.
    """
    name, kind = option.name, option.kind
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if kind == "count" and number and math.isfinite(value) and value == int(value):
        return int(value)
    if kind == "number" and number:
        return float(value)
    table = isinstance(value, dict) and all(isinstance(key, str) for key in value)
    if (kind == "flag" and isinstance(value, bool)) or (kind == "table" and table):
        return value
    if kind in ("text", "choice") and isinstance(value, str):
        if kind == "choice" and value not in option.choices:
            close = nearest(value, option.choices)
            known = ", ".join(map(repr, option.choices))
            raise SettingError(f"{name} must be one of {known}, not {value!r}{close}")
        return value
    listed = isinstance(value, list | tuple)
    if kind == "layers" and listed and all(isinstance(layer, list | tuple) for layer in value):
        return as_tuples(value)
    if kind == "angle" and (number or (listed and len(value) == 2)):
        return as_tuples(value)
    raise SettingError(f"{name} must be {_KINDS[kind]}, not {value!r}")


_KINDS = {
    "count": "a whole number",
    "number": "a number",
    "flag": "true or false",
    "choice": "a word",
    "text": "a text",
    "layers": "a list of [kernel, stride, features]",
    "table": "a table of names with values",
    "angle": "a number or two, in degrees",
}


def merge(file: Mapping[str, Any], flags: Mapping[str, Any]) -> dict[str, Any]:
    """Options of a file with those of flags on top.

    Tables are merged; an environment named by a flag replaces the map of the file.
    """
    places = ("env", "map", "map_file", *MAP_TEXTS)
    chosen = any(name in flags for name in places)
    merged = {name: v for name, v in file.items() if not (chosen and name in places)}
    for name, value in flags.items():
        before = merged.get(name)
        if isinstance(value, dict) and isinstance(before, dict):
            merged[name] = {**before, **value}
        else:
            merged[name] = value
    return merged


def resolve(given: Mapping[str, Any]) -> Experiment:
    """The experiment of some options; those not given have their defaults.

    Raises:
        JAXensteinError: an option is unknown or has a value it cannot have, or the environment
            and the training do not fit.
    """
    given = check(given)
    recipe = recipe_from(given)
    config = config_of(recipe, _picked(given, _TRAINING))
    hparams = HParams.of(config.algorithm, _picked(given, _NUMBERS))
    hparams.check()
    experiment = Experiment(
        recipe,
        config,
        hparams.flat(),
        check_seeds(given.get("seed", 0), given.get("seeds", 1)),
        check_grid(given.get("grid") or {}, config.algorithm),
    )
    # A network that does not fit the image is told now.
    experiment.learner  # noqa: B018
    return experiment


def given_by(experiment: Experiment) -> dict[str, Any]:
    """The options that `resolve` makes an experiment of."""
    recipe, config = experiment.recipe, experiment.config
    settings = dict(recipe.settings)
    given: dict[str, Any] = {"env": recipe.id}
    if recipe.id is None:
        given = {"map": settings.pop("text")}
        given |= {name: settings.pop(name) for name in MAP_TEXTS if name in settings}
    for name in ("height", "width", "observation", "frame_skip", "heading"):
        if settings.get(name) is not None:
            given[name] = settings.pop(name)
    given |= {name: value for name, value in config.flat().items() if name not in OF_RECIPE}
    given |= experiment.hparams
    given |= {
        "settings": settings,
        "params": dict(recipe.params),
        "seed": experiment.seeds[0],
        "seeds": len(experiment.seeds),
        "grid": {name: list(values) for name, values in experiment.grid},
    }
    return {name: value for name, value in given.items() if value is not None}


def _picked(given: Mapping[str, Any], group: str) -> dict[str, Any]:
    names = {option.name for option in all_options().values() if option.group == group}
    return {name: value for name, value in given.items() if name in names}


def recipe_from(given: Mapping[str, Any]) -> Recipe:
    """How to build the environment that the options name.

    Raises:
        JAXensteinError: it cannot be built.
    """
    if "env" in given and "map" in given:
        raise SettingError("give either env or a map, not both")
    settings = {
        "height": given.get("height", 64),
        "width": given.get("width", 64),
        **{name: given[name] for name in ("observation", "frame_skip") if name in given},
        **(given.get("settings") or {}),
    }
    settings = {name: as_tuples(value) for name, value in settings.items()}
    params = dict(given.get("params") or {})
    if "horizon" in given:
        if given["horizon"] < 1:
            raise SettingError(f"horizon must be a whole number from 1, not {given['horizon']}")
        params["max_steps_in_episode"] = given["horizon"]
    if "map" in given:
        texts = {name: given[name] for name in ("map", *MAP_TEXTS) if name in given}
        settings |= {"text": texts.pop("map"), **texts}
        settings |= {"heading": given["heading"]} if "heading" in given else {}
        recipe = Recipe(None, 0, settings, params)
    elif "heading" in given:
        raise SettingError("heading goes with a map; an env has headings of its own")
    else:
        recipe = Recipe(str(given.get("env", "simple")), 0, settings, params)
    _, defaults = dataclasses.replace(recipe, params={}).build()
    names = [field.name for field in dataclasses.fields(defaults)]
    for name in params:
        if name not in names:
            raise SettingError(
                f"unknown param {name!r}{nearest(name, names)}; known: {', '.join(names)}"
            )
    env, _ = recipe.build()
    # An id may have been an alias, or known to this process alone.
    name = None if recipe.id is None else portable_id(recipe.id)
    return dataclasses.replace(recipe, id=name, version=env.version)


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
