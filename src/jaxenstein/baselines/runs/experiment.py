"""What a run directory is about: environment, static settings, numbers, seeds, and a grid."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import json
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp

from ...errors import SettingError
from ...spec import Spec, as_tuples
from ..learning.config import Config
from ..learning.fields import values_of
from ..learning.hparams import HParams
from ..learning.learner import Learner
from ..learning.state import IMPLEMENTATION
from .presets import PAPER, Presets

FORMAT = 1
# Seeds of one experiment, which are trained side by side; a mistyped number would fill the memory.
MOST_SEEDS = 100_000


@dataclasses.dataclass(frozen=True)
class Experiment:
    """Runs that one compiled program trains side by side.

    Attributes:
        spec: how the environment and its params are built.
        config: the static settings.
        hparams: the numbers, by name; None where a number is left to the environment.
        seeds: one run for each, at every point of the grid.
        grid: (name, values) of the numbers that differ between runs.
        presets: where the static settings and numbers that were not given come from.
    """

    spec: Spec
    config: Config
    hparams: Mapping[str, float | None]
    seeds: tuple[int, ...]
    grid: tuple[tuple[str, tuple[float, ...]], ...] = ()
    presets: Presets = PAPER

    @property
    def runs(self) -> tuple[dict[str, float | int], ...]:
        """What tells each run from the others: its numbers of the grid, and its `seed`."""
        names = [name for name, _ in self.grid]
        points = itertools.product(*(values for _, values in self.grid))
        return tuple(
            {**dict(zip(names, point, strict=True)), "seed": seed}
            for point in points
            for seed in self.seeds
        )

    @functools.cached_property
    def learner(self) -> Learner:
        """The training loop, with the environment built anew.

        Raises:
            JAXensteinError: the environment cannot be built, or does not fit the config.
        """
        return Learner(*self.spec.build(), self.config)

    def keys(self) -> jax.Array:
        """A typed random key for each run: that of its seed."""
        keys = {seed: jax.random.key(seed, impl=IMPLEMENTATION) for seed in self.seeds}
        return jnp.stack([keys[int(run["seed"])] for run in self.runs])

    def numbers(self) -> HParams:
        """The numbers of all runs: those of the grid as float32[runs], the others as they are."""
        varied = {
            name: jnp.asarray([run[name] for run in self.runs], jnp.float32)
            for name, _ in self.grid
        }
        return HParams.of(self.config.algorithm, {**self.hparams, **varied})

    def to_json(self) -> dict[str, Any]:
        """As plain JSON values, which `from_json` reads."""
        plain = {
            "format": FORMAT,
            "environment": {
                "id": self.spec.id,
                "version": self.spec.version,
                "settings": dict(self.spec.settings),
                "params": dict(self.spec.params),
            },
            "presets": values_of(self.presets),
            "config": self.config.flat(),
            "hparams": dict(self.hparams),
            "seeds": list(self.seeds),
            "grid": {name: list(values) for name, values in self.grid},
        }
        return json.loads(json.dumps(plain))

    @classmethod
    def from_json(cls, plain: Any) -> Experiment:
        """What `to_json` wrote.

        Raises:
            SettingError: it is something else, or of another version of this package.
        """
        try:
            if plain["format"] != FORMAT:
                raise SettingError(f"format {plain['format']!r}, not {FORMAT}")
            place = plain["environment"]
            spec = Spec(place["id"], place["version"], _tuples(place["settings"]), place["params"])
            config = Config.of({name: as_tuples(v) for name, v in plain["config"].items()})
            grid = tuple((name, tuple(values)) for name, values in plain["grid"].items())
            hparams = HParams.of(config.algorithm, plain["hparams"]).flat()
            # Runs of before there was a choice have none.
            presets = Presets(**plain.get("presets", {}))
            return cls(spec, config, hparams, tuple(plain["seeds"]), grid, presets)
        except (KeyError, TypeError, AttributeError) as error:
            raise SettingError(f"not the configuration of a run: {error!r}") from error

    def differences(self, other: Experiment) -> list[str]:
        """The fields in which two experiments differ, each with both values."""
        mine, its = _flat(self.to_json()), _flat(other.to_json())
        return [
            f"{name} ({_shown(mine.get(name))}, not {_shown(its.get(name))})"
            for name in sorted({*mine, *its})
            if mine.get(name, ...) != its.get(name, ...)
        ]

    def __hash__(self) -> int:
        """By what it is about; the mappings in it are not changed."""
        return hash(json.dumps(self.to_json(), sort_keys=True))


def check_seeds(first: int, count: int) -> tuple[int, ...]:
    """`count` seeds from `first` on.

    Raises:
        SettingError: there is none, or they are not all whole numbers from 0 to 2**32 - 1.
    """
    if count < 1:
        raise SettingError(f"seeds must be a whole number from 1, not {count!r}")
    if count > MOST_SEEDS:
        raise SettingError(f"seeds must be at most {MOST_SEEDS}, not {count!r}")
    if first < 0 or first + count > 2**32:
        raise SettingError(
            f"seed must be a whole number from 0 to {2**32 - count}, the first of {count}, not "
            f"{first!r}"
        )
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


def _shown(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def exact(value: float | int) -> str:
    """A number as short as it can be written without becoming another one."""
    short = f"{value:g}"
    return short if float(short) == value else repr(value)
