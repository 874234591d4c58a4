"""How long a run took: `timing.jsonl`, apart from the metrics, which can be compared bit by bit."""

from __future__ import annotations

import json
import time
from pathlib import Path

import numpy as np

from ...errors import SettingError
from ...files import append, reason_of
from .experiment import Experiment

TIMING = "timing.jsonl"


class Timing:
    """Writes the file."""

    def __init__(self, folder: Path, experiment: Experiment, update: int) -> None:
        """Start the clock at an update."""
        self._path = folder / TIMING
        self._steps = experiment.config.steps_per_update * len(experiment.runs)
        self._update, self._start = update, time.monotonic()
        self._before = self._start

    def write(self, update: int) -> None:
        """Append the seconds since this process began, and the rate since the last row."""
        now = time.monotonic()
        rate = (update - self._update) * self._steps / max(now - self._before, 1e-9)
        row = {"update": update, "seconds": round(now - self._start, 3)}
        append(self._path, json.dumps({**row, "steps_per_second": round(rate, 1)}) + "\n")
        self._update, self._before = update, now


def read_seconds(folder: Path, updates: int) -> np.ndarray:
    """float64[updates], the seconds of training until each update was done, compiling included.

    Sessions follow each other; one is known by a clock that stands lower than the row before.

    Raises:
        SettingError: there are none, or they cannot be read.
    """
    path = folder / TIMING
    try:
        rows = [json.loads(line) for line in path.read_text("utf-8").split("\n")[:-1]]
        done = {int(row["update"]): 0.0 for row in rows}
        before = total = 0.0
        for row in rows:
            now = float(row["seconds"])
            total += now - before if now >= before else now
            done[int(row["update"])], before = total, now
    except OSError as error:
        raise SettingError(f"cannot read {path}: {reason_of(error)}") from error
    except (ValueError, TypeError, KeyError) as error:
        raise SettingError(f"{path} is damaged: {error!r}") from error
    if not done:
        raise SettingError(f"{path} has no rows yet")
    known = sorted(done)
    return np.interp(np.arange(1, updates + 1), known, [done[update] for update in known])
