"""The options of a training: names, defaults, config files, recipes, and grids.

The options are those of the environment, `recipe` and `network`, the fields of `Config` and
`HParams`, the options of every bonus, and the number of runs. Files and flags use the same names;
flags override files.
"""

from __future__ import annotations

import dataclasses
import functools
import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ...errors import SettingError, one_line, quoted
from ...fields import Domain, Option, check_names, is_number, names_of, options_of
from ...files import read_text, reason_of, without_repeats
from ...settings import checked, environment_options, spec_from
from ...settings import given_by as environment_given_by
from ..bonuses import NoBonus
from ..config import Algorithm, Config, HParams, algorithms
from ..networks import PATCHES, SMALL
from .experiment import Experiment, check_seeds

# The default size of images.
SIZE = {"height": 64, "width": 64}
# The maximum number of characters in a file, and the maximum depth of nested lists and tables.
LONGEST, DEEPEST = 2**20, 20
# Strings and comments of a TOML file, and a key with too many parts.
_QUOTED = re.compile(
    r'''"""(?:\\.|[^\\])*?"""|\'{3}.*?\'{3}|"(?:\\.|[^"\\\n])*"|'[^'\n]*'|\#[^\n]*''', re.DOTALL
)
_LONG_KEY = re.compile(rf"(?<![\w-])(?:[\w-]+[ \t]*\.[ \t]*){{{DEEPEST}}}")
PRESETS, TRAINING, NUMBERS = "presets", "training", "hyperparameters"
RUNS = (
    Option("seed", "runs", Domain("whole", 0, 2**32 - 1), 0, "the first seed"),
    Option("seeds", "runs", Domain("whole", 1), 1, "parallel runs, each with its own seed"),
    Option("grid", "runs", Domain("table"), None, "hyperparameters that differ between runs"),
)
NETWORKS: Mapping[str, Mapping[str, Any]] = {
    "paper": {},
    "small": {"features": 64, "hidden": 64, "head": 64, "convolutions": SMALL},
    "tiny": {"features": 64, "hidden": 64, "head": 64, "convolutions": PATCHES},
}
_OWN_VALUES = {
    "normalise_bonus": True,
    "bonus_values": True,
    "bonus_advantage": 0.3,
    "entropy": 0.003,
}
_TUNED: Mapping[str, Mapping[str, Any]] = {
    "*": {
        "network": "tiny",
        "num_envs": 64,
        "rollout": 128,
        "gamma": 0.99,
        "epochs": 2,
        "learning_rate": 1e-3,
        "anneal": False,
        "value_clip": 10.0,
        "zero_values": True,
        "contrast": 10.0,
        "advantage_floor": 0.01,
    },
    "rnd": {
        "normalise_bonus": True,
        "bonus_memory": 0.9,
        "bonus_learning_rate": 1e-4,
        "bonus_advantage": 0.3,
        "entropy": 0.003,
        "contrast": 0.0,
    },
    "icm": _OWN_VALUES,
    "e3b": {**_OWN_VALUES, "e3b_lambda": 0.1, "random_clocks": True},
}
_LONG = {"gamma": 0.997, "gae_lambda": 0.98, "bonus_gamma": 0.99, "normalise_rewards": True}
# Bonuses that weigh less and last longer, and new policies that repeat their actions.
_FAINT_BONUS = {
    "bonus_advantage": 0.02,
    "bonus_memory": 1.0,
    "bonus_learning_rate": 3e-5,
    "contrast": 0.0,
    "persistence": 2.0,
}
_TEMPORAL = {
    "e3b_embedding": "temporal",
    "e3b_latent": 128,
    "e3b_reach": 24,
    "bonus_learning_rate": 1e-3,
    "bonus_values": False,
    "bonus_reward": 0.1,
    "persistence": 2.0,
}
# The defaults of each recipe that differ from the paper: for all algorithms ("*"), then for one.
# docs/ablations.md has the measurements.
RECIPES: Mapping[str, Mapping[str, Mapping[str, Any]]] = {
    "paper": {},
    "tuned": _TUNED,
    "long": {
        **_TUNED,
        "*": {**_TUNED["*"], **_LONG},
        "rnd": {**_TUNED["rnd"], **_FAINT_BONUS},
        "icm": {**_TUNED["icm"], **_FAINT_BONUS},
        "e3b": {**_TUNED["e3b"], **_TEMPORAL},
    },
}


def all_options() -> dict[str, Option]:
    """Every option, by name."""
    return _options(tuple(algorithms().items()))


@functools.cache
def _options(rows: tuple[tuple[str, Algorithm], ...]) -> dict[str, Option]:
    found = [*options_of(Experiment, PRESETS, ("recipe", "network")), *RUNS]
    found += options_of(Config, TRAINING)
    found += options_of(HParams, NUMBERS)
    for _, row in rows:
        found += options_of(row.options, TRAINING, row.settings)
        found += options_of(row.options, NUMBERS, row.numbers)
    options = environment_options() | {option.name: option for option in found}
    # Its entries are options themselves.
    del options["bonus"]
    names = Domain("choice", choices=tuple(name for name, _ in rows))
    options["algo"] = dataclasses.replace(options["algo"], domain=names)
    return options


def read_file(path: Path) -> dict[str, Any]:
    """Read the options of a TOML file, or of a YAML file if PyYAML is installed.

    Raises:
        SettingError: the file cannot be read, has another format, or has an unknown option.
    """
    try:
        text = read_text(path, LONGEST)
    except (OSError, UnicodeDecodeError) as error:
        raise SettingError(f"cannot read {path}: {reason_of(error)}") from error
    try:
        given = _yaml(path, text) if path.suffix in (".yaml", ".yml") else _toml(text)
    except SettingError:
        raise
    except (ValueError, RecursionError) as error:
        raise SettingError(f"{path} is not TOML: {error}") from error
    if not isinstance(given, dict):
        raise SettingError(f"{path} must be a table of names with values")
    try:
        named = [(str(name).replace("-", "_"), value) for name, value in given.items()]
        given = without_repeats(named)
        return checked(given, all_options())
    except SettingError as error:
        raise SettingError(f"{path}: {error}") from None


def _toml(text: str) -> Any:
    # Reading takes the square of the parts of a key.
    if _LONG_KEY.search(_QUOTED.sub("s", text)):
        raise ValueError(f"a key has more than {DEEPEST} parts")
    return tomllib.loads(text)


def _yaml(path: Path, text: str) -> Any:
    try:
        import yaml
    except ImportError as error:
        raise SettingError(
            f"{path}: YAML needs PyYAML ({error}): pip install pyyaml, or write TOML"
        ) from error
    try:
        # A few lines of aliases can expand to more values than fit into memory.
        depth = 0
        for event in yaml.parse(text):
            if isinstance(event, yaml.AliasEvent):
                raise yaml.YAMLError("aliases such as '*name' are not allowed; repeat the value")
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            # The time to parse grows with the square of the depth.
            if depth > DEEPEST:
                raise yaml.YAMLError(f"lists and tables are nested more than {DEEPEST} deep")
        return _yaml_loader()(text).get_single_data() or {}
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise SettingError(f"{path} is not YAML: {one_line(str(error))}") from error


def _yaml_loader() -> Any:
    """PyYAML's safe loader, which also reads numbers such as 3e-4, and refuses repeated names."""
    import yaml

    class Loader(yaml.SafeLoader):
        def construct_mapping(self, node: Any, deep: bool = False) -> Any:
            table = super().construct_mapping(node, deep)
            without_repeats([(key.value, value) for key, value in node.value])
            return table

    number = re.compile(r"[-+]?\d+(\.\d*)?[eE][-+]?\d+$")
    Loader.add_implicit_resolver("tag:yaml.org,2002:float", number, list("-+0123456789"))
    return Loader


def defaults_of(given: Mapping[str, Any]) -> dict[str, Any]:
    """The options that a recipe and a network set, including their names.

    Args:
        given: checked options; only `recipe`, `network` and `algo` are read.
    """
    recipe = given.get("recipe", Experiment.recipe)
    row = RECIPES[recipe]
    values = {**row.get("*", {}), **row.get(given.get("algo", Config.algo), {})}
    network = given.get("network", values.get("network", Experiment.network))
    return {**NETWORKS[network], **values, "recipe": recipe, "network": network}


def resolve(given: Mapping[str, Any]) -> Experiment:
    """Make an experiment from options; others get the recipe's value or their default.

    A hyperparameter may be given or in the grid, not both.

    Raises:
        JAXensteinError: an option is unknown or has a wrong value, or the config does not suit the
            environment.
    """
    given = checked(given, all_options())
    for name in given.get("grid") or {}:
        if name.replace("-", "_") in given:
            raise SettingError(f"{name} is given and also in the grid: leave one of them out")
    given = {**defaults_of(given), **given}
    place = SIZE if "map" in given else {"env": "simple", **SIZE}
    environment = spec_from({**place, **given})
    config = Config.of(_picked(given, TRAINING))
    experiment = Experiment(
        environment=environment,
        config=config,
        hparams=HParams.of(config.algo, _picked(given, NUMBERS)).flat(),
        seeds=check_seeds(given.get("seed", 0), given.get("seeds", 1)),
        grid=check_grid(given.get("grid") or {}, config.algo),
        recipe=given["recipe"],
        network=given["network"],
    )
    # Raise now if the network does not suit the image.
    experiment.learner  # noqa: B018
    return experiment


def given_by(experiment: Experiment) -> dict[str, Any]:
    """The options from which `resolve` makes this experiment."""
    varied = dict(experiment.grid)
    place = environment_given_by(experiment.environment)
    return {
        **{name: value for name, value in place.items() if value is not None},
        "recipe": experiment.recipe,
        "network": experiment.network,
        **experiment.config.flat(),
        **{name: value for name, value in experiment.hparams.items() if name not in varied},
        "seed": experiment.seeds[0],
        "seeds": len(experiment.seeds),
        "grid": {name: list(values) for name, values in varied.items()},
    }


def check_effect(names: Iterable[str], algos: Sequence[str]) -> None:
    """Raise a `SettingError` if an option changes the training of none of these algorithms."""
    for name in names:
        users = [algo for algo, row in algorithms().items() if name in names_of(row.options)]
        if not users and "bonus" in name:
            users = [algo for algo, row in algorithms().items() if row.bonus is not NoBonus]
            if name == "bonus_values":
                users.remove("rnd")  # It always has a value head for the bonus.
        if users and not {*users} & {*algos}:
            raise SettingError(
                f"{name} has no effect on {' or '.join(algos)}, only on {', '.join(users)}"
            )


def _picked(given: Mapping[str, Any], group: str) -> dict[str, Any]:
    names = {option.name for option in all_options().values() if option.group == group}
    return {name: value for name, value in given.items() if name in names}


def check_grid(table: Mapping[str, Any], algo: str) -> tuple[tuple[str, tuple[float, ...]], ...]:
    """Check a grid; a `SettingError` if the algorithm lacks a hyperparameter."""
    check_effect(table, [algo])
    check_names(table, HParams.of(algo, {}).flat(), "hyperparameter in a grid:")
    grid = []
    for name, values in table.items():
        listed = values if isinstance(values, list | tuple) else [values]
        if not listed or not all(map(is_number, listed)) or len(set(listed)) < len(listed):
            raise SettingError(
                f"grid.{name} must be a list of different numbers, not {quoted(values)}"
            )
        for value in listed:
            HParams.of(algo, {name: value})
        grid.append((name, tuple(map(float, listed))))
    return tuple(grid)
