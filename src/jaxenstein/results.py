"""The results of an evaluation, and the file format for them.

A file is JSON with `format`, `version` and `results`, a list with an entry for each evaluation.
An entry has `environment` (see `Spec.to_json`), `policy`, `actions`, `episodes`, `seed`,
`made_with` and `runs`. `runs` maps the name of a run to its `return`, `length` and `success`,
lists with one value per episode.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .errors import JAXensteinError, SettingError, quoted
from .fields import check_seed, check_whole
from .files import LONGEST_TEXT, atomic, read_json
from .intervals import mean_interval
from .machine import made_by
from .spec import Spec

FORMAT, VERSION = "jaxenstein-results", 1
ACTIONS = ("greedy", "sampled", None)
# The entry of `made_with` for episodes in ViZDoom.
GAME = "vizdoom"
# The entries of a run, the matching attributes of `Results`, and the types of their values.
PARTS: dict[str, tuple[str, tuple[type, ...], Any]] = {
    "return": ("returns", (int, float), np.float64),
    "length": ("lengths", (int,), np.int32),
    "success": ("successes", (bool,), np.bool_),
}


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Results:
    """The episodes of one policy in one environment, for one or more training runs.

    Attributes:
        environment: the spec of the environment and its params.
        policy: the name of the policy.
        actions: `"greedy"` for the most likely actions, `"sampled"`, or None if the policy
            has no such choice.
        seed: the seed of the evaluation, 0 to 2**32 - 1.
        names: the names of the runs, all different.
        returns: float64[runs, episodes], undiscounted.
        lengths: int32[runs, episodes], steps, at least 1.
        successes: bool[runs, episodes], whether the aim of the task was reached.
        made_with: versions of this package, JAX, numpy, Python and, for episodes in ViZDoom,
            `vizdoom`, and the hardware; by default those of this process.

    Raises:
        SettingError: an attribute has the wrong type or shape, or a return is not finite.
    """

    environment: Spec
    policy: str
    actions: str | None = None
    seed: int = 0
    names: tuple[str, ...]
    returns: np.ndarray
    lengths: np.ndarray
    successes: np.ndarray
    made_with: Mapping[str, str] = dataclasses.field(default_factory=made_by)

    def __post_init__(self) -> None:
        """Check all attributes, and convert arrays to their dtypes."""
        if not isinstance(self.environment, Spec):
            raise SettingError(f"environment must be a Spec, not {quoted(self.environment)}")
        check_text("policy", self.policy)
        if self.actions not in ACTIONS:
            shown = quoted(self.actions)
            raise SettingError(f"actions must be 'greedy', 'sampled' or None, not {shown}")
        object.__setattr__(self, "seed", check_seed(self.seed))
        if not isinstance(self.names, Sequence) or isinstance(self.names, str):
            raise SettingError(f"names must be a tuple of texts, not {quoted(self.names)}")
        for name in self.names:
            check_text("the name of a run", name)
        object.__setattr__(self, "names", tuple(self.names))
        if not isinstance(self.made_with, Mapping):
            raise SettingError(f"made_with must map names to texts, not {quoted(self.made_with)}")
        for name, value in self.made_with.items():
            check_text("a name in made_with", name)
            check_text(f"'made_with.{name}'", value)
        if len(set(self.names)) != len(self.names):
            raise SettingError(f"names of runs must differ, not {', '.join(self.names)}")
        arrays = {
            name: _array(name, getattr(self, name), dtype) for name, _, dtype in PARTS.values()
        }
        shape = arrays["returns"].shape
        if len(shape) != 2 or 0 in shape or shape[0] != len(self.names):
            runs = len(self.names)
            raise SettingError(
                f"returns must have the shape [runs, episodes] with {runs} runs, not {shape}"
            )
        for attribute, array in arrays.items():
            if array.shape != shape:
                raise SettingError(f"{attribute} must have the shape {shape}, not {array.shape}")
            object.__setattr__(self, attribute, array)
        with np.errstate(over="ignore"):
            finite = np.isfinite(self.returns.astype(np.float32))
        if not finite.all():
            run, episode = np.argwhere(~finite)[0]
            raise SettingError(
                f"the return of episode {episode} (from 0) of {quoted(self.names[run])} is "
                f"{self.returns[run, episode]}; it must be finite in float32"
            )
        if self.lengths.min() < 1:
            raise SettingError(f"lengths must be at least 1, not {self.lengths.min()}")

    @property
    def episodes(self) -> int:
        """The number of episodes of each run."""
        return int(self.returns.shape[1])

    @property
    def in_game(self) -> bool:
        """Whether the episodes were played in ViZDoom; `made_with` then has its version."""
        return GAME in self.made_with

    @property
    def best(self) -> int:
        """The run with the highest mean return; of equal runs, the one with shorter episodes."""
        order = np.lexsort((self.lengths.mean(axis=1), -self.returns.mean(axis=1)))
        return int(order[0])

    def summary(self) -> str:
        """One line: mean return and success rate with their 95 % bootstrap intervals."""
        earned = mean_interval(self.returns)
        reached = mean_interval(self.successes)
        return (
            f"{self.policy} in {self.environment.id or 'a map'}: "
            f"return {earned.mean:.4g} ({earned.low:.4g} to {earned.high:.4g}), "
            f"success {reached.mean:.1%} ({reached.low:.1%} to {reached.high:.1%}), "
            f"{self.returns.size} episodes"
        )

    def save(self, path: str | Path) -> None:
        """Write a file with only these results; see `write_results`."""
        write_results(path, [self])

    def to_json(self) -> dict[str, Any]:
        """Convert to plain JSON values: an entry of `results` in a file.

        Raises:
            SettingError: a setting of the environment has no JSON form.
        """
        runs = {
            run: {part: getattr(self, name)[i].tolist() for part, (name, _, _) in PARTS.items()}
            for i, run in enumerate(self.names)
        }
        return {
            "environment": self.environment.to_json(),
            "policy": self.policy,
            "actions": self.actions,
            "episodes": self.episodes,
            "seed": self.seed,
            "runs": runs,
            "made_with": dict(self.made_with),
        }


def write_results(path: str | Path, results: Sequence[Results]) -> None:
    """Write evaluations to one file, atomically.

    Raises:
        SettingError: there are no results, a setting of an environment has no JSON form, or the
            file would be larger than `read_results` accepts.
        OutputError: the file cannot be written.
    """
    listed = isinstance(results, Sequence) and all(isinstance(one, Results) for one in results)
    if not (listed and results):
        raise SettingError(f"results must be a list of at least one Results, not {quoted(results)}")
    dense = {"allow_nan": False, "separators": (",", ":")}
    entries = ",\n".join(json.dumps(one.to_json(), **dense) for one in results)
    head = f'"format": "{FORMAT}",\n"version": {VERSION},\n'
    text = f'{{\n{head}"results": [\n{entries}\n]\n}}\n'
    if len(text) > LONGEST_TEXT:
        raise SettingError(
            f"{path} would have more than {LONGEST_TEXT} characters: use fewer episodes"
        )
    with atomic(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def read_results(path: str | Path) -> tuple[Results, ...]:
    """Read an untrusted file in the format of `write_results`; builds no environment.

    Raises:
        SettingError: the file cannot be read, is too large, is not a results file, has a newer
            format, or has an entry that is missing, unknown or wrong; the message names file and
            entry.
    """
    try:
        table = read_json(path, "a results file")
        if not isinstance(table, dict) or table.get("format") != FORMAT:
            raise SettingError(f"not a results file: 'format' is not {FORMAT!r}")
        check_whole("version", table.get("version"), 1)
        if table["version"] > VERSION:
            raise SettingError(
                f"its format is version {table['version']}, but this version of jaxenstein only "
                f"reads up to {VERSION}: use a newer jaxenstein"
            )
        _only(table, ("format", "version", "results"))
        entries = table["results"]
        if not isinstance(entries, list) or not entries:
            raise SettingError("'results' must be a list with an entry for each evaluation")
    except JAXensteinError as error:
        raise SettingError(f"{path}: {error}") from error
    return tuple(_read(path, i, entry) for i, entry in enumerate(entries))


def _read(path: str | Path, index: int, entry: Any) -> Results:
    """Read an entry of `results`."""
    try:
        names = ("environment", "policy", "actions", "episodes", "seed", "runs", "made_with")
        _only(_object("the entry", entry), names)
        check_whole("'episodes'", entry["episodes"], 1)
        runs = _object("'runs'", entry["runs"])
        for name, run in runs.items():
            _only(_object(f"'runs.{name}'", run), tuple(PARTS), f"runs.{name}.")
        arrays = {
            attribute: np.array(
                [
                    _values(f"'runs.{name}.{part}'", run[part], entry["episodes"], types)
                    for name, run in runs.items()
                ],
                dtype,
            )
            for part, (attribute, types, dtype) in PARTS.items()
        }
        return Results(
            environment=Spec.from_json(entry["environment"]),
            policy=entry["policy"],
            actions=entry["actions"],
            seed=entry["seed"],
            names=tuple(runs),
            made_with=entry["made_with"],
            **arrays,
        )
    except (JAXensteinError, OverflowError, RecursionError) as error:
        raise SettingError(f"{path}: results[{index}]: {error}") from error


def _values(label: str, values: Any, count: int, types: tuple[type, ...]) -> list[Any]:
    """Check a list with one value of the right type per episode."""
    if not isinstance(values, list) or len(values) != count:
        many = f"a list of {len(values)}" if isinstance(values, list) else "another value"
        raise SettingError(
            f"{label} must be a list of {count} values, as 'episodes' says, not {many}"
        )
    for number, value in enumerate(values):
        if type(value) not in types:
            wanted = " or ".join(one.__name__ for one in types)
            shown = quoted(value)
            raise SettingError(f"{label}: episode {number} (from 0) must be {wanted}, not {shown}")
    return values


def _only(table: dict[str, Any], names: tuple[str, ...], within: str = "") -> None:
    """Raise unless a table has exactly these entries."""
    for name in names:
        if name not in table:
            raise SettingError(f"the entry '{within}{name}' is missing")
    for name in table:
        if name not in names:
            raise SettingError(f"unknown entry '{within}{name}'")


def _object(label: str, value: Any) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise SettingError(f"{label} must be an object of named entries, not {quoted(value)}")
    return value


def _array(name: str, value: Any, dtype: Any) -> np.ndarray:
    """Convert a value to an array of a dtype that holds its numbers exactly."""
    words = {np.float64: "numbers", np.int32: "whole numbers", np.bool_: "truth values"}[dtype]
    with contextlib.suppress(ValueError), np.errstate(invalid="ignore"):
        given = np.asarray(value)
        array = given.astype(dtype) if given.dtype.kind in "biuf" else None
        if array is not None and (dtype is np.float64 or np.array_equal(array, given)):
            return array
    raise SettingError(f"{name} must be an array [runs, episodes] of {words}, not {quoted(value)}")


def check_text(label: str, value: Any) -> None:
    """Raise a `SettingError` unless a value is one line of printable text."""
    if not isinstance(value, str) or not value.isprintable():
        raise SettingError(f"{label} must be one line of text, not {quoted(value)}")
