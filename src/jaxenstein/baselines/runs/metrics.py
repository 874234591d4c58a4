"""The metrics of a run: rows of numbers, as JSON lines and sent to other tools, and its timing."""

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
from ...files import append, atomic, read_text, reason_of, writing
from ..divergence import METRIC, Divergence

METRICS, TIMING, WANDB_ID = "metrics.jsonl", "timing.jsonl", "wandb-id.txt"
# The largest whole number in a row, a count or a seed, and what all other numbers are below.
LARGEST, BEYOND_FLOAT32 = 2**63 - 1, 2.0**128
# The most characters of the rows of a run.
LONGEST = 2**30
# Whole numbers that every row has.
COUNTS = ("update", "steps", "episodes")
# Means over episodes, and the sums from which they are computed.
EPISODE_MEANS = {"return": "return_sum", "length": "length_sum", "success": "successes"}
Number = int | float | None
Row = dict[str, Number]


def rows_of(
    metrics: Mapping[str, Any], runs: Sequence[Mapping[str, Any]], first: int, steps: int
) -> list[Row]:
    """The rows of a chunk, one for each update and run.

    Args:
        metrics: arrays [runs, updates] by name.
        runs: the grid's numbers and the seed of each run.
        first: updates before the chunk.
        steps: environment steps of an update.

    Returns:
        By update, then by run: `update` from 1, `steps`, the run's numbers of the grid and its seed
        (a number with the name of a metric, such as `entropy`, as `grid_entropy`), the mean return,
        length and success rate of the episodes that ended (None if none did), and the metrics.
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
    """Mean return, length and success rate of the episodes whose sums are given, None of no sum."""
    episodes = sums.get("episodes") or 0
    return {
        name: total / episodes if episodes and (total := sums[key]) is not None else None
        for name, key in EPISODE_MEANS.items()
    }


def _plain(value: np.generic) -> Number:
    """A Python number that is written as short as its precision allows."""
    if isinstance(value, np.floating):
        number = float(str(value))
        return number if math.isfinite(number) else None
    return int(value)


class Sink(Protocol):
    """A receiver of metrics besides the run directory."""

    def write(self, rows: Sequence[Row]) -> None:
        """Take the rows of a chunk."""
        ...

    def close(self) -> None:
        """Finish."""
        ...


class MetricsFile:
    """`metrics.jsonl` of a run directory, in which infinite numbers and NaN are null."""

    def __init__(self, folder: Path, rows: int = 0) -> None:
        """Open the file to append after `rows` rows; later ones are cut off.

        Raises:
            SettingError: it has fewer rows.
            OutputError: it cannot be written.
        """
        self._path = folder / METRICS
        with writing(self._path), self._path.open("a+b") as file:
            file.seek(0)
            for row in range(rows):
                if not file.readline().endswith(b"\n"):
                    raise SettingError(
                        f"{self._path} has {row} whole rows where the checkpoint needs {rows}; "
                        "it is not the file that the run wrote"
                    )
            file.truncate(file.tell())

    def write(self, rows: Sequence[Row]) -> None:
        """Append rows, and flush them to the disk; an `OutputError` if that fails."""
        append(self._path, "".join(json.dumps(row) + "\n" for row in rows))


def read_metrics(folder: Path) -> list[Row]:
    """The rows of a run directory; an incomplete last line of an interrupted run is skipped.

    Raises:
        SettingError: there are none, or they cannot be read.
    """
    path = folder / METRICS
    try:
        lines = read_text(path, LONGEST).split("\n")[:-1]
        rows = [json.loads(line) for line in lines]
        if not all(isinstance(row, dict) and all(map(_is_number, row.values())) for row in rows):
            raise ValueError("a row is no table of numbers")
        for name in COUNTS:
            if not all(isinstance(row.get(name), int) for row in rows):
                raise ValueError(f"the {quoted(name)} of a row is no whole number")
        return rows
    except OSError as error:
        raise SettingError(f"cannot read {path}: {reason_of(error)}") from error
    except (ValueError, RecursionError) as error:
        raise SettingError(f"{path} is damaged: {error}") from error


def rows_by_run(rows: Sequence[Row], runs: int) -> list[list[Row]]:
    """The rows of each run, the same number for all.

    A training that was killed may have left its last update with rows of only some runs.
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
    """Whether it is None or a number that a run may have written."""
    whole = isinstance(value, int)
    return value is None or (abs(value) <= LARGEST if whole else is_real(value))


def is_real(value: Any) -> bool:
    """Whether it is a number that is finite in float32."""
    return isinstance(value, int | float) and abs(value) < BEYOND_FLOAT32


class Timing:
    """`timing.jsonl` of a run directory: a file of its own, so that metrics repeat bit for bit."""

    def __init__(self, folder: Path, steps: int, update: int) -> None:
        """Start the clock at an update; `steps` are those of each update, over all runs.

        Raises:
            OutputError: the file cannot be written.
        """
        self._path, self._steps = folder / TIMING, steps
        self._update, self._start = update, time.monotonic()
        self._before = self._start
        if os.path.exists(self._path):
            # A writer that was stopped may have left a part of a row.
            with writing(self._path), self._path.open("r+b") as file:
                file.truncate(file.read().rfind(b"\n") + 1)

    def write(self, update: int) -> None:
        """Append the seconds since this process began, and the rate since the last row."""
        now = time.monotonic()
        rate = (update - self._update) * self._steps / max(now - self._before, 1e-9)
        row = {"update": update, "seconds": round(now - self._start, 3)}
        append(self._path, json.dumps({**row, "steps_per_second": round(rate, 1)}) + "\n")
        self._update, self._before = update, now


def read_seconds(folder: Path, updates: int) -> np.ndarray:
    """float64[updates], the seconds of training until each update was done, compiling included.

    A clock that is lower than in the row before starts a new session of the training.

    Raises:
        SettingError: there are no rows, or they cannot be read.
    """
    path = folder / TIMING
    try:
        rows = [json.loads(line) for line in read_text(path, LONGEST).split("\n")[:-1]]
        done = {int(row["update"]): 0.0 for row in rows}
        before = total = 0.0
        for row in rows:
            now = float(row["seconds"])
            if not is_real(now):
                raise ValueError(f"{now} seconds")
            total += now - before if now >= before else now
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
    """Scalars for TensorBoard, one of its runs for each of ours; needs only tensorboard."""

    def __init__(self, folder: Path, names: Sequence[str]) -> None:
        """Open a writer for each run, named `names`.

        Raises:
            ImportError: neither tensorboard nor tensorboardX is installed.
        """
        try:
            from tensorboard.summary import Writer  # pyright: ignore[reportMissingImports]
        except ImportError:
            from tensorboardX import SummaryWriter as Writer  # type: ignore[import-not-found]

        self._writers = [Writer(str(folder / name)) for name in names]

    def write(self, rows: Sequence[Row]) -> None:
        """Send every number of every row, at its environment step."""
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
    """Scalars for Weights & Biases: one of its runs, with the means over ours and each by name."""

    def __init__(
        self, folder: Path, names: Sequence[str], project: str, config: dict[str, Any]
    ) -> None:
        """Begin or continue the run of a folder; a `SettingError` if wandb is not installed."""
        try:
            import wandb  # type: ignore[import-not-found]
        except ImportError as error:
            raise SettingError(
                f"Weights & Biases is not installed ({error}): pip install wandb"
            ) from error
        self._names = list(names)
        # Folders of several sweeps may have the same name.
        kept = folder / WANDB_ID
        if not os.path.exists(kept):
            with atomic(kept) as temporary:
                temporary.write_text(f"{folder.absolute().name}-{uuid.uuid4().hex[:8]}\n", "utf-8")
        self._run: Any = wandb.init(
            project=project,
            id=kept.read_text("utf-8").strip(),
            name=folder.absolute().name,
            dir=str(folder),
            config=config,
            resume="allow",
        )

    def write(self, rows: Sequence[Row]) -> None:
        """Send the rows of each update together, at its environment step.

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
    """The mean over runs of every number that all of them have."""
    scalars = [dict(_scalars(row)) for row in rows]
    names = scalars[0] if scalars else ()
    shared = [name for name in names if all(name in row for row in scalars)]
    return {name: float(np.mean([row[name] for row in scalars])) for name in shared}
