"""Read the results of several policies on the same tasks from files, and check them."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .environment import AnyEnvironment
from .errors import SettingError, nearest, one_line, quoted
from .files import read_json
from .intervals import Interval
from .results import Results, read_results
from .scores import normalised
from .spec import Spec

Compared = dict[str, dict[str, Results]]
"""Results by policy and then by task; all policies have the same tasks in the same order."""


@dataclasses.dataclass(frozen=True)
class Reference:
    """The returns that set the scale of a task's normalised scores.

    Attributes:
        random: the return of a player that samples actions uniformly.
        expert: the return of a good player.
    """

    random: float
    expert: float


@dataclasses.dataclass(frozen=True)
class _Entry:
    """One evaluation in a file.

    Attributes:
        path: the file.
        label: the name of the policy.
        results: the evaluation.
    """

    path: Path
    label: str
    results: Results

    @property
    def task(self) -> str:
        spec = self.results.environment
        return spec.id or one_line(str(spec.settings.get("name", "map")))


def gather(files: Iterable[tuple[str | None, Path]], actions: str | None = None) -> Compared:
    """Read files of results, and combine those that belong to one policy.

    Results with the same label and the same way of choosing actions belong to one policy. Several
    results on one task are combined as its runs. Results in ViZDoom are another policy.

    Args:
        files: each with a label, or None to use the policy names in the file.
        actions: "greedy" or "sampled" to keep only results with these actions, and those of
            policies without such a choice; None keeps all.

    Raises:
        SettingError: a file cannot be read; a task has different versions, settings or params in
            two files; a policy has a run twice, or runs with different episodes; a policy lacks a
            task; nothing is left.
    """
    entries = [
        _Entry(path, _label(label, results), results)
        for label, path in files
        for results in read_results(path)
        if actions is None or results.actions in (actions, None)
    ]
    if not entries:
        raise SettingError(f"the files have no results with {actions or 'any'} actions")
    _check_environments(entries)
    groups: dict[str, dict[str, list[_Entry]]] = {}
    for policy, entry in zip(_policies(entries), entries, strict=True):
        groups.setdefault(policy, {}).setdefault(entry.task, []).append(entry)
    _check_tasks(groups)
    tasks = sorted({entry.task for entry in entries})
    return {
        policy: {task: _together(policy, mine[task]) for task in tasks}
        for policy, mine in groups.items()
    }


def _label(label: str | None, results: Results) -> str:
    """The name of a policy; a label replaces it, but still says that it played in ViZDoom."""
    if label is None:
        return results.policy
    return f"{label} in ViZDoom" if results.in_game else label


def _policies(entries: Sequence[_Entry]) -> list[str]:
    """The policy of each entry: its label, with the kind of actions if the label has both."""
    ways: dict[str, set[str | None]] = {}
    for entry in entries:
        ways.setdefault(entry.label, set()).add(entry.results.actions)
    return [
        entry.label
        if len(ways[entry.label]) == 1
        else f"{entry.label}, {entry.results.actions or 'own actions'}"
        for entry in entries
    ]


def _check_environments(entries: Sequence[_Entry]) -> None:
    """Raise unless every task has the same environment in all files."""
    first: dict[str, _Entry] = {}
    for entry in entries:
        other = first.setdefault(entry.task, entry)
        if fault := difference(other.results.environment, entry.results.environment):
            raise SettingError(
                f"{entry.task}: {fault[0]} is {fault[1]} in {other.path} and {fault[2]} in "
                f"{entry.path}; one task needs one environment: score these results separately"
            )


def difference(one: Spec, other: Spec) -> tuple[str, Any, Any] | None:
    """What differs, with both values; missing values are defaults."""
    if one.version != other.version:
        return "the version", one.version, other.version
    if one == other or _same(one, other):
        return None
    for what in ("settings", "params"):
        mine, its = getattr(one, what), getattr(other, what)
        for name, value in {**mine, **its}.items():
            of_name = f"the {what.removesuffix('s')} {quoted(name)}"
            if name in mine and name in its:
                if mine[name] != its[name]:
                    return _part_of(of_name, mine[name], its[name])
                continue
            lacking = other if name in mine else one
            filled = {**getattr(lacking, what), name: value}
            if not _same(lacking, dataclasses.replace(lacking, **{what: filled})):
                here, there = (
                    quoted(given[name]) if name in given else "the default" for given in (mine, its)
                )
                return of_name, here, there
    return "the id", one.id, other.id


def _part_of(name: str, one: Any, other: Any) -> tuple[str, str, str]:
    """Two values that differ, with their name; of long texts, the first line that differs."""
    if isinstance(one, str) and isinstance(other, str):
        pairs = itertools.zip_longest(one.splitlines(), other.splitlines(), fillvalue="")
        for number, (here, there) in enumerate(pairs):
            if here != there and (number or "\n" in one + other):
                return f"line {number + 1} of {name}", quoted(here), quoted(there)
    return name, quoted(one), quoted(other)


def _same(one: Spec, other: Spec) -> bool:
    """Whether both build the same environment, even if one spells out defaults."""
    try:
        built = [_with_numbers(*spec.build()) for spec in (one, other)]
    # Errors that untrusted files can cause; a JAXensteinError is a ValueError.
    except (TypeError, ValueError, IndexError, OverflowError, AttributeError):
        return False
    return built[0] == built[1]


def _with_numbers(env: AnyEnvironment, params: Any) -> tuple[AnyEnvironment, dict[str, Any]]:
    numbers = {
        field.name: np.asarray(getattr(params, field.name)).tolist()
        for field in dataclasses.fields(params)
    }
    return env, numbers


def _check_tasks(groups: Mapping[str, Mapping[str, list[_Entry]]]) -> None:
    """Raise unless all policies have all tasks."""
    for policy, mine in groups.items():
        for other, its in groups.items():
            if missing := sorted({*its} - {*mine}):
                raise SettingError(
                    f"{policy} has no results for {', '.join(missing)}, but {other} does: policies "
                    f"are compared on the same tasks (--label NAME FILES combines the files of one "
                    "policy)"
                )


def _together(policy: str, entries: Sequence[_Entry]) -> Results:
    """Combine the runs of one policy on one task from all files."""
    first, *others = entries
    for entry in others:
        for what in ("episodes", "seed"):
            here, there = (getattr(one.results, what) for one in (first, entry))
            if here != there:
                raise SettingError(
                    f"{policy} on {first.task}: {what} {here} in {first.path} and {there} in "
                    f"{entry.path}; runs of one policy need the same episodes"
                )
    seen: dict[str, Path] = {}
    for entry in entries:
        for name in entry.results.names:
            if name in seen:
                where = f"both in {seen[name]} and in {entry.path}"
                if seen[name] == entry.path:
                    where = f"twice in {entry.path}"
                raise SettingError(
                    f"{policy} on {first.task}: the run {quoted(name)} is {where}; give each seed "
                    "of a policy its own name (`name` or --name of evaluate), each policy its own "
                    "--label, and files with several policies before the first --label"
                )
            seen[name] = entry.path
    arrays = {
        name: np.concatenate([getattr(entry.results, name) for entry in entries])
        for name in ("returns", "lengths", "successes")
    }
    return dataclasses.replace(first.results, policy=policy, names=tuple(seen), **arrays)


def read_reference(path: str | Path) -> dict[str, Reference]:
    """Read a file of reference returns: {"task id": {"random": x, "expert": y}, ...}.

    Raises:
        SettingError: the file cannot be read or has other content; the message names it.
    """
    try:
        plain = read_json(path, "a file of reference returns")
    except SettingError as error:
        raise SettingError(f"{path}: {error}") from error
    if not isinstance(plain, dict):
        raise SettingError(f'{path} must hold {{"task id": {{"random": x, "expert": y}}}}')
    return {task: _reference(path, task, entry) for task, entry in plain.items()}


def _reference(path: str | Path, task: str, entry: Any) -> Reference:
    if not isinstance(entry, dict) or not {"random", "expert"} <= {*entry}:
        raise SettingError(f"{path}: {quoted(task)} must be an object with 'random' and 'expert'")
    try:
        normalised(0.0, entry["random"], entry["expert"])
    except SettingError as error:
        raise SettingError(f"{path}: {quoted(task)}: {error}") from error
    return Reference(float(entry["random"]), float(entry["expert"]))


def score_interval(earned: Interval, ends: Reference) -> Interval:
    """The normalised score of a policy in a task, from its mean return."""
    numbers = normalised([earned.mean, earned.low, earned.high], ends.random, ends.expert)
    return Interval(*map(float, numbers))


def run_returns(mine: Mapping[str, Results]) -> list[np.ndarray]:
    """The mean return of each run of a policy: float64[runs] for each task."""
    return [results.returns.mean(axis=1, dtype=np.float64) for results in mine.values()]


def run_scores(mine: Mapping[str, Results], reference: Mapping[str, Reference]) -> list[np.ndarray]:
    """As `run_returns`, normalised.

    Raises:
        SettingError: a task has no reference.
    """
    for task in mine:
        if task not in reference:
            raise SettingError(
                f"there is no reference for {quoted(task)}{nearest(task, reference)}"
            )
    return [
        normalised(returns, reference[task].random, reference[task].expert)
        for task, returns in zip(mine, run_returns(mine), strict=True)
    ]
