"""Experiments: an environment, static settings, hyperparameters, seeds, and a grid."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import json
from collections.abc import Mapping
from typing import Any, Literal

import jax
import jax.numpy as jnp

from ...errors import SettingError, quoted, shortened
from ...fields import as_tuples, check, check_whole, choice, is_whole
from ...seeds import key_of
from ...spec import Spec
from ..config import Config, HParams
from ..learner import Learner

FORMAT = 1
# The maximum number of seeds. All are trained in parallel; more would fill the memory.
MOST_SEEDS = 100_000
RecipeName = Literal["paper", "tuned", "long"]
NetworkName = Literal["paper", "small", "tiny"]


@dataclasses.dataclass(frozen=True)
class Experiment:
    """A set of runs that one compiled program trains in parallel.

    Attributes:
        environment: spec of the environment and its params.
        config: the static settings.
        hparams: the hyperparameters by name; None leaves a value to the environment.
        seeds: every point of the grid has one run for each seed.
        grid: (name, values) of the hyperparameters that differ between runs.
        recipe: a set of defaults: paper; tuned, which learns faster; or long, which is tuned for
            long episodes and large rewards.
        network: default sizes of the network: paper: 256 units; small: 64 units and small
            convolutions; tiny: 64 units and one layer of patches; tuned and long use tiny.
    """

    environment: Spec
    config: Config
    hparams: Mapping[str, float | None]
    seeds: tuple[int, ...]
    grid: tuple[tuple[str, tuple[float, ...]], ...] = ()
    recipe: RecipeName = choice("paper", RecipeName)
    network: NetworkName = choice("paper", NetworkName)

    def __post_init__(self) -> None:
        """Check the names of the recipe and the network."""
        check(self)

    @property
    def runs(self) -> tuple[dict[str, float | int], ...]:
        """The values in which runs differ: their point of the grid, and their `seed`."""
        names = [name for name, _ in self.grid]
        points = itertools.product(*(values for _, values in self.grid))
        return tuple(
            {**dict(zip(names, point, strict=True)), "seed": seed}
            for point in points
            for seed in self.seeds
        )

    @functools.cached_property
    def learner(self) -> Learner:
        """The training loop, with a new environment.

        Raises:
            JAXensteinError: the environment cannot be built, or does not suit the config.
        """
        return Learner(*self.environment.build(), self.config)

    def keys(self) -> jax.Array:
        """A typed random key for each run, from its seed."""
        keys = {seed: key_of(seed) for seed in self.seeds}
        return jnp.stack([keys[int(run["seed"])] for run in self.runs])

    def numbers(self) -> HParams:
        """The hyperparameters of all runs: those of the grid are float32[runs], others scalars."""
        varied = {
            name: jnp.asarray([run[name] for run in self.runs], jnp.float32)
            for name, _ in self.grid
        }
        return HParams.of(self.config.algo, {**self.hparams, **varied})

    def to_json(self) -> dict[str, Any]:
        """Convert to plain JSON values for `from_json`."""
        plain = {
            "format": FORMAT,
            "environment": self.environment.to_json(),
            "presets": {"recipe": self.recipe, "network": self.network},
            "config": self.config.flat(),
            "hparams": dict(self.hparams),
            "seeds": list(self.seeds),
            "grid": {name: list(values) for name, values in self.grid},
        }
        return json.loads(json.dumps(plain))

    @classmethod
    def from_json(cls, plain: Any) -> Experiment:
        """Make an experiment from the result of `to_json`.

        Raises:
            SettingError: `plain` is something else, or from another version of this package.
        """
        try:
            if plain["format"] != FORMAT or not is_whole(plain["format"]):
                raise SettingError(f"format {quoted(plain['format'])}, not {FORMAT}")
            place = plain["environment"]
            check_whole("environment.version", place["version"], 0)
            environment = Spec(
                place["id"], place["version"], _tuples(place["settings"]), _tuples(place["params"])
            )
            # Runs saved without this option continue after a divergence.
            config = Config.of({"on_divergence": "continue", **_tuples(plain["config"])})
            grid = tuple((name, tuple(values)) for name, values in plain["grid"].items())
            hparams = HParams.of(config.algo, plain["hparams"]).flat()
            seeds = tuple(plain["seeds"])
            return cls(environment, config, hparams, seeds, grid, **plain["presets"])
        except (KeyError, TypeError, AttributeError) as error:
            raise SettingError(f"not the config of a run: {quoted(error)}") from error

    def differences(self, other: Experiment) -> list[str]:
        """The fields in which two experiments differ, each with both values."""
        mine, its = _flat(self.to_json()), _flat(other.to_json())

        def shown(value: Any) -> str:
            return shortened(json.dumps(value), 60)

        return [
            f"{name} ({shown(mine.get(name))}, not {shown(its.get(name))})"
            for name in sorted({*mine, *its})
            if mine.get(name, ...) != its.get(name, ...)
        ]


def check_seeds(first: int, count: int) -> tuple[int, ...]:
    """Return `count` seeds from `first`; a `SettingError` unless all are from 0 to 2**32 - 1."""
    count = check_whole("seeds", count, 1, MOST_SEEDS)
    first = check_whole("seed", first, 0, 2**32 - count)
    return tuple(range(first, first + count))


def _tuples(values: Mapping[str, Any]) -> dict[str, Any]:
    return {name: as_tuples(value) for name, value in values.items()}


def _flat(tree: Any, prefix: str = "") -> dict[str, Any]:
    """The leaves of nested dictionaries, by their dotted names."""
    if not isinstance(tree, dict):
        return {prefix: tree}
    found: dict[str, Any] = {}
    for name, value in tree.items():
        found |= _flat(value, f"{prefix}.{name}" if prefix else name)
    return found


def exact(value: float | int) -> str:
    """The shortest exact text of a number; integers have no exponent."""
    if isinstance(value, int):
        return str(value)
    short = f"{value:g}"
    return short if float(short) == value else repr(value)
