"""Trainings in the game on the clock: rows pooled into spans of time."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("flax")

from experiments.beside import in_the_game


def test_rows_are_pooled_by_time(tmp_path: Path) -> None:
    clocks = {"a": [30, 60, 90, 120], "b": [50, 110, 170]}
    wins = {"a": [(0, 2), (1, 2), (3, 3), (1, 1)], "b": [(0, 0), (2, 4), (4, 4)]}
    for name, seconds in clocks.items():
        rows = [
            {"seconds": at, "successes": won, "episodes": of}
            for at, (won, of) in zip(seconds, wins[name], strict=True)
        ]
        (tmp_path / name).write_text("".join(json.dumps(row) + "\n" for row in rows))
    curve = in_the_game([tmp_path / "a", tmp_path / "b"], "game", points=2)
    np.testing.assert_allclose(curve.at, [1, 2])
    # Of the second no episode ended in the first minute; its last row is after the other's end.
    np.testing.assert_allclose(curve.values, [[0.25, 1], [np.nan, 0.5]])
    assert (curve.label, curve.over) == ("game", "minutes")
