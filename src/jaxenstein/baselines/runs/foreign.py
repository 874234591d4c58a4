"""Reads metrics of other programs: JSON Lines and TensorBoard event files."""

from __future__ import annotations

import dataclasses
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ...errors import SettingError, nearest, one_line
from ...files import name_of, read_text, reason_of
from .folder import has_run
from .metrics import EPISODE_MEANS, LONGEST, METRICS, Row, is_finite_number

Over = Literal["decisions", "minutes"]
EVENTS = "*tfevents*"
# Names of step columns, in the order in which they are tried. `a/b` also matches `b`.
STEPS = (
    "step", "steps", "global_step", "env_step", "env_steps", "timestep", "timesteps", "total_steps",
    "total_timesteps", "num_timesteps", "_step", "iteration", "update",
)  # fmt: skip
SECONDS = ("seconds", "time_elapsed", "elapsed", "_runtime")
SEED = "seed"


@dataclasses.dataclass(frozen=True)
class Foreign:
    """One or more runs of an experiment.

    Attributes:
        label: label in the legend.
        metric: the column that was found.
        runs: the rows of each run that have the column, ordered by position.
        at: the positions of the rows of each run, float64[rows]: steps or minutes.
    """

    label: str
    metric: str
    runs: Sequence[Sequence[Row]]
    at: Sequence[np.ndarray]


def is_foreign(path: Path) -> bool:
    """Whether a path is a file, or a folder with metrics of another program."""
    return any(map(os.path.isfile, (path, path / METRICS))) or bool(_event_folders(path))


def read_foreign(
    path: Path, metrics: Sequence[str], steps: Sequence[str] = (), over: Over = "decisions"
) -> Foreign:
    """Read JSON Lines, or TensorBoard scalars.

    A line is an object with a step column, optionally a column `seed`, and metrics. A metric that
    is null or not finite in float32 is missing at that step. In a TensorBoard folder, every folder
    with event files is a run.

    Args:
        path: a file, a folder with `metrics.jsonl`, or a folder with event files at any depth.
        metrics: names of the metric; the first existing column is used. `b` also matches a column
            `a/b`, if only one column ends in `/b`.
        steps: names of the step column; empty for `STEPS`.
        over: the positions: steps ("decisions"), or minutes, from a column in `SECONDS` or from the
            clock of TensorBoard.

    Raises:
        SettingError: the path cannot be read, or has no such column.
    """
    file = path / METRICS if os.path.isfile(path / METRICS) else path
    if not os.path.isfile(file):
        return _read_events(path, metrics, over)
    rows = _read_lines(file)
    columns = dict.fromkeys(
        name for row in rows for name, value in row.items() if is_finite_number(value)
    )
    metric = _pick(file, columns, metrics, "--metric")
    if over == "minutes":
        place, scale = _pick(file, columns, SECONDS, None, "of seconds"), 1 / 60
    else:
        place, scale = _pick(file, columns, steps or STEPS, "--step", "of steps"), 1
    by_seed: dict[str, list[tuple[float, Row]]] = {}
    for row in rows:
        if metric in row and is_finite_number(row.get(place)):
            of_seed = by_seed.setdefault(json.dumps(row.get(SEED)), [])
            of_seed.append((row[place] * scale, _numbers(row, metric)))
    if not by_seed:
        raise SettingError(f"no line of {file} has both {metric!r} and {place!r}")
    name = name_of(file.parent) if file.name == METRICS else file.stem
    return _foreign(name, metric, by_seed.values())


def _read_lines(file: Path) -> list[dict[str, Any]]:
    """Read the objects in the lines of a file; an incomplete last line is skipped."""
    try:
        lines = read_text(file, LONGEST).split("\n")
    except (OSError, UnicodeDecodeError) as error:
        raise SettingError(f"cannot read {file}: {reason_of(error)}") from error
    rows = []
    for number, line in enumerate(lines, 1):
        try:
            row = json.loads(line) if line.strip() else {}
        except (ValueError, RecursionError):
            row = None
        if row is None and number == len(lines) and number > 1:
            continue
        if not isinstance(row, dict):
            what = f'an object such as {{"step": 1000, "return": 0.5}}, not {line[:60]!r}'
            raise SettingError(f"{file}, line {number}: each line must be {what}")
        rows.append(row)
    if not any(rows):
        raise SettingError(f"{file} has no metrics yet")
    return rows


def _pick(
    file: Path, columns: Iterable[str], names: Iterable[str], flag: str | None, what: str = ""
) -> str:
    """The first of some names that is a column."""
    known, wanted = list(columns), list(names)
    for name in wanted:
        ends = [column for column in known if column.rpartition("/")[2] == name]
        if name in known or len(ends) == 1:
            return name if name in known else ends[0]
    asked = " or ".join(map(repr, wanted)) if not what or len(wanted) < 3 else what
    close = nearest(wanted[0], known) if flag == "--metric" else ""
    listed = ", ".join(known) or "no column of numbers"
    hint = f"; choose one with {flag} NAME" if flag else f"; rename one to {wanted[0]!r}"
    raise SettingError(f"{file} has no column {asked}{close}; it has: {listed}{hint}")


def _numbers(row: Mapping[str, Any], metric: str) -> Row:
    """The columns that a curve of the metric needs."""
    names = (metric, "episodes", EPISODE_MEANS.get(metric, metric))
    return {name: row[name] for name in names if is_finite_number(row.get(name))}


def _foreign(label: str, metric: str, runs: Iterable[list[tuple[float, Row]]]) -> Foreign:
    ordered = [sorted(run, key=lambda entry: entry[0]) for run in runs]
    at = [np.array([place for place, _ in run], np.float64) for run in ordered]
    return Foreign(label, metric, [[row for _, row in run] for run in ordered], at)


def _event_folders(path: Path) -> list[Path]:
    """The folders with event files at any depth, without those of our own runs."""
    if not os.path.isdir(path):
        return []
    folders = {file.parent for file in path.rglob(EVENTS) if os.path.isfile(file)}
    return sorted(
        folder
        for folder in folders
        if not any(has_run(path / part) for part in folder.relative_to(path).parents)
    )


def _read_events(path: Path, metrics: Sequence[str], over: Over) -> Foreign:
    """Read TensorBoard scalars; each folder with event files is a run."""
    scalars = [_scalars(folder) for folder in _event_folders(path)]
    columns = dict.fromkeys(name for of_run in scalars for name in of_run)
    metric = _pick(path, columns, metrics, "--metric")
    found = []
    for of_run in scalars:
        begin = min((event[0] for events in of_run.values() for event in events), default=0.0)
        minutes = over == "minutes"
        entries: list[tuple[float, Row]] = [
            ((clock - begin) / 60 if minutes else step, _numbers({metric: value}, metric))
            for clock, step, value in of_run.get(metric, ())
        ]
        if entries:
            found.append(entries)
    return _foreign(name_of(path), metric, found)


def _scalars(folder: Path) -> dict[str, list[tuple[float, int, float]]]:
    """The (clock, step, value) of all scalars in the event files of a folder, by name."""
    try:
        from tensorboard.backend.event_processing import (  # pyright: ignore[reportMissingImports]
            plugin_event_accumulator,
        )
        from tensorboard.util import tensor_util  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        raise SettingError(
            f"{folder} has TensorBoard files, which need tensorboard ({error}): "
            "pip install tensorboard"
        ) from error
    events = plugin_event_accumulator.EventAccumulator(str(folder), size_guidance={"tensors": 0})
    try:
        events.Reload()
        tags = events.PluginTagToContent("scalars") if "scalars" in events.ActivePlugins() else {}
        return {
            tag: [
                (event.wall_time, event.step, float(tensor_util.make_ndarray(event.tensor_proto)))
                for event in events.Tensors(tag)
            ]
            for tag in tags
        }
    # On a damaged file, the reader can raise any error.
    except Exception as error:
        raise SettingError(f"cannot read {folder}: {one_line(str(error))[:200]}") from error
