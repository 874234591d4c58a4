"""Read trajectory files, which may be edited, truncated, or from another version."""

from __future__ import annotations

import string
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..environment import AnyEnvironment
from ..errors import JAXensteinError, TrajectoryError, quoted
from ..fields import Domain, names_of
from ..files import read_json
from ..spec import TEXTS, Spec
from ..trajectory import DIGITS, FORMAT, FORMAT_VERSION, Checks, Trajectory, digest_spacing
from .session import NO_OP

# The most actions of an episode, so that a small file cannot ask for too much memory.
MOST_ACTIONS = 10_000_000
Table = dict[str, Any]


def load_trajectory(path: str | Path) -> Trajectory:
    """Read a trajectory file, and build its environment once to check that it is usable.

    Raises:
        TrajectoryError: the file cannot be read, is truncated or not a trajectory, has a newer
            format, or has an entry that is missing, unknown or wrong; the message names file and
            entry.
    """
    try:
        return _read(read_json(path, "a trajectory"))
    except (JAXensteinError, RecursionError) as error:
        raise TrajectoryError(f"{path}: {error}") from error


def _read(table: Any) -> Trajectory:
    if not isinstance(table, dict) or table.get("format") != FORMAT:
        raise TrajectoryError(f"not a trajectory: 'format' is not {FORMAT!r}")
    made_by = _made_by(table)
    version = _take(table, "format_version", Domain("whole", 1))
    if version > FORMAT_VERSION:
        raise TrajectoryError(
            f"its format is version {version}, from jaxenstein {made_by.get('jaxenstein')}, but "
            f"this version only reads up to {FORMAT_VERSION}: use a newer jaxenstein"
        )
    _only(table, "", ("format", "format_version", *names_of(Trajectory)))
    spec = _spec(_take(table, "environment", _object))
    try:
        env, _ = spec.try_out()
    except JAXensteinError as error:
        raise TrajectoryError(f"'environment': {error}") from error
    actions = _actions(table, env)
    return Trajectory(
        environment=spec,
        seed=_take(table, "seed", Domain("whole", 0, 2**32 - 1)),
        actions=actions,
        checks=_checks(_take(table, "checks", _object), len(actions)),
        made_by=made_by,
    )


def _made_by(table: Table) -> dict[str, str]:
    made_by = _take(table, "made_by", _object)
    return {name: _take(made_by, name, _text, "made_by.") for name in made_by}


def _spec(table: Table) -> Spec:
    within = "environment."
    _only(table, within, names_of(Spec))
    settings = dict(_take(table, "settings", _object, within))
    id = _take(table, "id", lambda value: None if value is None else _text(value), within)
    for name in ("autoreset", "final_observation"):
        if name in settings:
            raise TrajectoryError(f"'{within}settings.{name}' does not belong to a trajectory")
    if id is None and "text" not in settings:
        raise TrajectoryError("an environment without an id needs the map 'settings.text'")
    if id is None:
        for name in TEXTS:
            if name in settings:
                settings[name] = _take(settings, name, _lines, f"{within}settings.")
        settings["name"] = _take(settings, "name", _text, f"{within}settings.")
    params = _take(table, "params", _object, within)
    return Spec(
        id=id,
        version=_take(table, "version", Domain("whole", 0), within),
        settings={name: _frozen(value) for name, value in settings.items()},
        params={
            name: value
            if isinstance(value, bool | int)
            else _take(params, name, Domain("number"), f"{within}params.")
            for name, value in params.items()
        },
    )


def _actions(table: Table, env: AnyEnvironment) -> tuple[int, ...]:
    actions = _runs(table, "actions", "", Domain("whole"))
    for index, action in enumerate(actions):
        if not NO_OP <= action < env.num_actions:
            raise TrajectoryError(
                f"action {index} (from 0) is {action}, but {quoted(env.name)} has the actions 0 to "
                f"{env.num_actions - 1}, and {NO_OP} for none"
            )
    return actions


def _checks(table: Table, steps: int) -> Checks:
    within = "checks."
    _only(table, within, names_of(Checks))
    every = _take(table, "every", Domain("whole", 1), within)
    if every != (right := digest_spacing(steps + 1)):
        raise TrajectoryError(f"'{within}every' must be {right} for {steps} actions, not {every}")
    wanted = -(-(steps + 1) // every)
    checks = Checks(
        rewards=tuple(map(float, _runs(table, "rewards", within, Domain("number")))),
        terminated=_take(table, "terminated", Domain("switch"), within),
        truncated=_take(table, "truncated", Domain("switch"), within),
        every=every,
        states=_take(table, "states", _digests, within),
        observations=_take(table, "observations", _digests, within),
    )
    for name, count, right in (
        ("rewards", len(checks.rewards), steps),
        ("states", len(checks.states), wanted),
        ("observations", len(checks.observations), wanted),
    ):
        if count != right:
            raise TrajectoryError(
                f"'{within}{name}' has {count} values, but {steps} actions need {right}"
            )
    return checks


def _only(table: Table, within: str, names: tuple[str, ...]) -> None:
    """Raise unless all entries are known."""
    for name in table:
        if name not in names:
            raise TrajectoryError(f"unknown entry {quoted(within + name)}")


def _take(table: Table, name: str, kind: Domain | Callable[[Any], Any], within: str = "") -> Any:
    """Take an entry from a domain, or convert it with `kind`, which may raise ValueError."""
    if name not in table:
        raise TrajectoryError(f"the entry '{within}{name}' is missing")
    if isinstance(kind, Domain):
        if fault := kind.fault(table[name]):
            raise TrajectoryError(f"'{within}{name}' {fault}")
        return table[name]
    try:
        return kind(table[name])
    except JAXensteinError:
        raise
    except ValueError as error:
        raise TrajectoryError(
            f"'{within}{name}' must be {error}, not {quoted(table[name])}"
        ) from error


def _runs(table: Table, name: str, within: str, kind: Domain) -> tuple[Any, ...]:
    """The values of a list of runs [value, count]."""

    def convert(value: Any) -> tuple[Any, ...]:
        values: list[Any] = []
        for i, run in enumerate(_list(value)):
            if not isinstance(run, list) or len(run) != 2:
                raise TrajectoryError(f"'{within}{name}[{i}]' must be [value, count]")
            where = dict(enumerate(run))
            label = f"{within}{name}[{i}]"
            one = _take({label: where[0]}, label, kind)
            count = _take({label: where[1]}, label, Domain("whole", 1, MOST_ACTIONS - len(values)))
            values += [one] * count
        return tuple(values)

    return _take(table, name, convert, within)


def _text(value: Any) -> str:
    if not isinstance(value, str) or not value.isprintable():
        raise ValueError("one line of text")
    return value


def _list(value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise ValueError("a list")
    return value


def _object(value: Any) -> Table:
    if not isinstance(value, dict):
        raise ValueError("an object of named entries")
    return value


def _lines(value: Any) -> str:
    if not isinstance(value, list) or not all(isinstance(line, str) for line in value):
        raise ValueError("a list of lines")
    return "".join(f"{line}\n" for line in value)


def _digests(value: Any) -> tuple[str, ...]:
    digits = set(string.hexdigits.lower())
    if not isinstance(value, list) or not all(
        isinstance(item, str) and len(item) == DIGITS and set(item) <= digits for item in value
    ):
        raise ValueError(f"a list of digests of {DIGITS} hexadecimal digits")
    return tuple(value)


def _frozen(value: Any) -> Any:
    """Convert lists to tuples, because settings must be hashable."""
    if isinstance(value, dict):
        raise TrajectoryError(f"a setting cannot be an object: {quoted(value)}")
    return tuple(map(_frozen, value)) if isinstance(value, list) else value
