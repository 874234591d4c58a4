"""Files of results: what policies achieved in an environment, episode by episode."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .errors import JAXensteinError, SettingError
from .fields import as_tuples, check_whole
from .files import atomic, reason_of
from .spec import Spec

FORMAT, VERSION = "jaxenstein-results", 1


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Results:
    """The episodes of a policy in an environment.

    Attributes:
        environment: how it is built.
        policy: a name to show.
        actions: "greedy", "sampled", or None where the policy decides itself.
        seed: of the evaluation.
        names: of the runs.
        returns: float64[runs, episodes], undiscounted.
        lengths: int64[runs, episodes], steps.
        successes: bool[runs, episodes].
        made_with: versions of this package and its libraries.
    """

    environment: Spec
    policy: str
    actions: str | None = None
    seed: int = 0
    names: tuple[str, ...]
    returns: np.ndarray
    lengths: np.ndarray
    successes: np.ndarray
    made_with: Mapping[str, str] = dataclasses.field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """As plain JSON values."""
        columns = (self.returns, self.lengths, self.successes)
        return {
            "environment": dataclasses.asdict(self.environment),
            "policy": self.policy,
            "actions": self.actions,
            "episodes": int(self.returns.shape[1]),
            "seed": self.seed,
            "runs": {
                name: {
                    what: column[n].tolist()
                    for what, column in zip(("return", "length", "success"), columns, strict=True)
                }
                for n, name in enumerate(self.names)
            },
            "made_with": dict(self.made_with),
        }


def write_results(path: str | Path, results: Sequence[Results]) -> None:
    """Write a file of results, whole or not at all.

    Raises:
        OutputError: it cannot be written.
    """
    plain = {
        "format": FORMAT,
        "version": VERSION,
        "results": [result.to_json() for result in results],
    }
    with atomic(path) as temporary:
        temporary.write_text(json.dumps(plain, allow_nan=False) + "\n", encoding="utf-8")


def read_results(path: str | Path) -> tuple[Results, ...]:
    """What `write_results` wrote.

    Raises:
        SettingError: it cannot be read, or is something else; the message names the file.
    """
    try:
        plain = json.loads(Path(path).read_text(encoding="utf-8"))
        if plain["format"] != FORMAT or plain["version"] != VERSION:
            raise SettingError(f"'format' is not {FORMAT!r} of version {VERSION}")
        return tuple(_result(entry) for entry in plain["results"])
    except OSError as error:
        raise SettingError(f"cannot read {path}: {reason_of(error)}") from error
    except JAXensteinError as error:
        raise SettingError(f"{path}: {error}") from error
    except (KeyError, TypeError, AttributeError, ValueError, RecursionError) as error:
        raise SettingError(f"{path} is no file of results: {error!r}") from error


def _result(entry: Any) -> Results:
    place = entry["environment"]
    check_whole("environment.version", place["version"], 0)
    settings = {name: as_tuples(value) for name, value in place["settings"].items()}
    runs = entry["runs"]
    columns = [
        np.array([run[name] for run in runs.values()], kind)
        for name, kind in (("return", np.float64), ("length", np.int64), ("success", bool))
    ]
    if any(column.shape != (len(runs), entry["episodes"]) for column in columns):
        raise SettingError("'runs' have other numbers of episodes than 'episodes'")
    if not np.all(np.isfinite(columns[0])):
        raise SettingError("a 'return' is not finite")
    return Results(
        environment=Spec(place["id"], place["version"], settings, place["params"]),
        policy=entry["policy"],
        actions=entry["actions"],
        seed=entry["seed"],
        names=tuple(runs),
        returns=columns[0],
        lengths=columns[1],
        successes=columns[2],
        made_with=entry["made_with"],
    )
