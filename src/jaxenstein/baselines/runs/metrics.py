"""The metrics and the timing of a run, as JSON Lines and in other tools."""

from __future__ import annotations

import json
import math
import os
import time
import uuid
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from ...errors import SettingError, quoted
from ...files import append, atomic, name_of, read_text, reason_of, writing
from ..divergence import METRIC, Divergence

METRICS, TIMING, WANDB_ID = "metrics.jsonl", "timing.jsonl", "wandb-id.txt"
# The largest integer in a row, a count or a seed, and the bound of all other numbers.
LARGEST, BEYOND_FLOAT32 = 2**63 - 1, 2.0**128
# The maximum number of characters in a file of rows.
LONGEST = 2**30
# Columns of integers that every row has.
COUNTS = ("update", "steps", "episodes")
# Means over episodes, and the sums that they are computed from.
EPISODE_MEANS = {"return": "return_sum", "length": "length_sum", "success": "successes"}
Number = int | float | None
Row = dict[str, Number]


def rows_of(
    metrics: Mapping[str, Any], runs: Sequence[Mapping[str, Any]], first: int, steps: int
) -> list[Row]:
    """The rows of a chunk, one per update and run.

    Args:
        metrics: arrays [runs, updates] by name.
        runs: the grid point and the seed of each run.
        first: number of updates before the chunk.
        steps: environment steps per update.

    Returns:
        Rows ordered by update, then by run. A row has `update` (from 1), `steps`, the grid point
        and seed of the run, the mean return, length and success rate of the episodes that ended
        (None if none did), and the metrics. A grid number with the name of a metric, such as
        `entropy`, is called `grid_entropy`.
    """
    arrays = {name: np.asarray(values) for name, values in metrics.items()}
    rows: list[Row] = []
    for update in range(next(iter(arrays.values())).shape[1]):
        for number, run in enumerate(runs):
            values = {name: _plain(array[number, update]) for name, array in arrays.items()}
            measured = means(values) | values
            own = {f"grid_{name}" if name in measured else name: of for name, of in run.items()}
            count = first + update + 1
            rows.append({"update": count, "steps": count * steps, **own, **measured})
    return rows


def means(sums: Mapping[str, Number]) -> Row:
    """Mean return, length and success rate, from sums over episodes; None without episodes."""
    episodes = sums.get("episodes") or 0
    return {
        name: total / episodes if episodes and (total := sums[key]) is not None else None
        for name, key in EPISODE_MEANS.items()
    }


def _plain(value: np.generic) -> Number:
    """The Python number with the shortest text that is exact in the precision of `value`."""
    if isinstance(value, np.floating):
        number = float(str(value))
        return number if math.isfinite(number) else None
    return int(value)


class Sink(Protocol):
    """A receiver of metrics, in addition to the run directory."""

    def write(self, rows: Sequence[Row]) -> None:
        """Take the rows of a chunk."""
        ...

    def close(self) -> None:
        """Finish."""
        ...


class MetricsFile:
    """`metrics.jsonl` of a run directory; infinite numbers and NaN are written as null."""

    def __init__(self, folder: Path, rows: int = 0) -> None:
        """Open the file to append after `rows` rows; later rows are cut off.

        Raises:
            SettingError: the file has fewer rows.
            OutputError: the file cannot be written, or has rows and does not exist.
        """
        self._path = folder / METRICS
        with writing(self._path), self._path.open("r+b" if rows else "a+b") as file:
            file.seek(0)
            for row in range(rows):
                if not file.readline().endswith(b"\n"):
                    raise SettingError(
                        f"{self._path} has {row} complete rows, but the checkpoint needs {rows}; "
                        "the file does not belong to this run"
                    )
            file.truncate(file.tell())

    def write(self, rows: Sequence[Row]) -> None:
        """Append rows and flush them to disk; an `OutputError` if that fails."""
        append(self._path, "".join(json.dumps(row) + "\n" for row in rows))


def read_metrics(folder: Path) -> list[Row]:
    """Read the rows of a run directory; an incomplete last line is skipped.

    Raises:
        SettingError: the file is missing or cannot be read.
    """
    path = folder / METRICS
    try:
        lines = read_text(path, LONGEST).split("\n")[:-1]
        rows = [json.loads(line) for line in lines]
        if not all(isinstance(row, dict) and all(map(_is_number, row.values())) for row in rows):
            raise ValueError("a row is not a table of numbers")
        for name in COUNTS:
            if not all(isinstance(row.get(name), int) for row in rows):
                raise ValueError(f"{quoted(name)} in a row is not a whole number")
        return rows
    except OSError as error:
        raise SettingError(f"cannot read {path}: {reason_of(error)}") from error
    except (ValueError, RecursionError) as error:
        raise SettingError(f"{path} is damaged: {error}") from error


def rows_by_run(rows: Sequence[Row], runs: int) -> list[list[Row]]:
    """The rows of each run, equally many for all.

    If training was killed, its last update may have rows of only some runs; these are left out.
    """
    whole = len(rows) // runs * runs
    return [list(rows[run:whole:runs]) for run in range(runs)]


def diverged_runs(rows: Sequence[Row], runs: int) -> dict[int, Divergence]:
    """The diverged runs by number, from the rows of whole updates."""
    found: dict[int, Divergence] = {}
    for number, row in enumerate(rows):
        if code := row.get(METRIC):
            found.setdefault(number % runs, Divergence(int(row["update"] or 0), int(code)))
    return found


def _is_number(value: Any) -> bool:
    """Whether a value is None or a number that a run can write: not NaN and not too large."""
    whole = isinstance(value, int)
    return value is None or (abs(value) <= LARGEST if whole else is_finite_number(value))


def is_finite_number(value: Any) -> bool:
    """Whether a value is a number that is finite in float32."""
    return isinstance(value, int | float) and abs(value) < BEYOND_FLOAT32


class Timing:
    """`timing.jsonl` of a run directory; separate, so that metrics repeat bit for bit."""

    def __init__(self, folder: Path, steps: int, update: int) -> None:
        """Start the clock at an update; `steps` is the number of steps per update, over all runs.

        A resumed session begins with a row of 0 seconds.

        Raises:
            OutputError: the file cannot be written.
        """
        self._path, self._steps = folder / TIMING, steps
        self._update, self._start = update, time.monotonic()
        self._before = self._start
        if os.path.exists(self._path):
            # An interrupted writer may have left an incomplete row.
            with writing(self._path), self._path.open("r+b") as file:
                file.truncate(file.read().rfind(b"\n") + 1)
            append(self._path, json.dumps({"update": update, "seconds": 0.0}) + "\n")

    def write(self, update: int) -> None:
        """Append the seconds since the start, and the rate since the last row."""
        now = time.monotonic()
        rate = (update - self._update) * self._steps / max(now - self._before, 1e-9)
        row = {"update": update, "seconds": round(now - self._start, 3)}
        append(self._path, json.dumps({**row, "steps_per_second": round(rate, 1)}) + "\n")
        self._update, self._before = update, now


def read_seconds(folder: Path, updates: int) -> np.ndarray:
    """The seconds of training until the end of each update, float64[updates], with compilation.

    A lower time than in the row before marks the start of a resumed session.

    Raises:
        SettingError: there are no rows, or they cannot be read.
    """
    path = folder / TIMING
    try:
        rows = [json.loads(line) for line in read_text(path, LONGEST).split("\n")[:-1]]
        done: dict[int, float] = {}
        before = total = 0.0
        for row in rows:
            now = float(row["seconds"])
            if not is_finite_number(now):
                raise ValueError(f"{now} seconds")
            if now < before:
                # The new session repeats the updates after its checkpoint.
                done = {update: at for update, at in done.items() if update <= row["update"]}
                before = 0.0
            total += now - before
            done[int(row["update"])], before = total, now
    except OSError as error:
        raise SettingError(f"cannot read {path}: {reason_of(error)}") from error
    except (ValueError, TypeError, KeyError, OverflowError, RecursionError) as error:
        raise SettingError(f"{path} is damaged: {quoted(error)}") from error
    if not done:
        raise SettingError(f"{path} has no rows yet")
    known = sorted(done)
    return np.interp(np.arange(1, updates + 1), known, [done[update] for update in known])


class TensorBoard:
    """Writes scalars for TensorBoard, with a TensorBoard run per run; needs only tensorboard."""

    def __init__(self, folder: Path, names: Sequence[str]) -> None:
        """Open a writer for each run; `names` are their names.

        Raises:
            ImportError: neither tensorboard nor tensorboardX is installed.
        """
        try:
            from tensorboard.summary import Writer  # pyright: ignore[reportMissingImports]
        except ImportError:
            from tensorboardX import SummaryWriter as Writer  # type: ignore[import-not-found]

        self._writers = [Writer(str(folder / name)) for name in names]

    def write(self, rows: Sequence[Row]) -> None:
        """Write every number of every row at its environment step."""
        for number, row in enumerate(rows):
            writer = self._writers[number % len(self._writers)]
            for name, value in _scalars(row):
                writer.add_scalar(name, value, int(row["steps"] or 0))
        for writer in self._writers:
            writer.flush()

    def close(self) -> None:
        """Close the writers."""
        for writer in self._writers:
            writer.close()


class WeightsAndBiases:
    """Sends scalars to one Weights & Biases run: means over runs, and each run by its name."""

    def __init__(
        self, folder: Path, names: Sequence[str], project: str, config: dict[str, Any]
    ) -> None:
        """Start or continue the run of a folder; a `SettingError` if wandb is not installed."""
        try:
            import wandb  # type: ignore[import-not-found]
        except ImportError as error:
            raise SettingError(
                f"Weights & Biases is not installed ({error}): pip install wandb"
            ) from error
        self._names = list(names)
        # Folders of different sweeps may have the same name.
        kept = folder / WANDB_ID
        if not os.path.exists(kept):
            with atomic(kept) as temporary:
                temporary.write_text(f"{name_of(folder)}-{uuid.uuid4().hex[:8]}\n", "utf-8")
        self._run: Any = wandb.init(
            project=project,
            id=kept.read_text("utf-8").strip(),
            name=name_of(folder),
            dir=str(folder),
            config=config,
            resume="allow",
        )

    def write(self, rows: Sequence[Row]) -> None:
        """Send the rows of each update together, at their environment step.

        The means leave out diverged runs.
        """
        many = len(self._names)
        for start in range(0, len(rows), many):
            together = rows[start : start + many]
            sent: dict[str, float] = {}
            for name, row in zip(self._names, together, strict=True):
                prefix = f"{name}/" if many > 1 else ""
                sent |= {f"{prefix}{key}": value for key, value in _scalars(row)}
            if many > 1:
                sent |= _averages([row for row in together if not row.get(METRIC)])
            self._run.log(sent, step=int(together[0]["steps"] or 0))

    def close(self) -> None:
        """Finish."""
        self._run.finish()


def _scalars(row: Row) -> Iterable[tuple[str, float]]:
    return (
        (name, float(value))
        for name, value in row.items()
        if value is not None and name not in ("update", "steps", "seed")
    )


def _averages(rows: Sequence[Row]) -> dict[str, float]:
    """The mean over runs of every number that all runs have."""
    scalars = [dict(_scalars(row)) for row in rows]
    names = scalars[0] if scalars else ()
    shared = [name for name in names if all(name in row for row in scalars)]
    return {name: float(np.mean([row[name] for row in scalars])) for name in shared}
