"""Recordings are written as they are read."""

from __future__ import annotations

from dataclasses import astuple
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fidelity import doom_motion
from fidelity.doom_recording import load

RECORDINGS = Path(__file__).parents[1] / "tasks" / "doom" / "recordings"


def test_recordings_are_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: dict[str, Any] = {}

    def record(scenario: str, episodes: int, *, seed: int, things: Any) -> Any:
        asked[scenario] = episodes, seed, tuple(things)
        return load(RECORDINGS / f"{scenario.replace('_', '-')}.npz")

    monkeypatch.setattr(doom_motion, "record", record)
    words = ["--record", str(tmp_path / "new"), "--episodes", "2", "--seed", "5"]
    assert doom_motion.main(words) == 0
    assert asked == {
        "my_way_home": (2, 5, ()),
        "health_gathering": (2, 5, ("Medikit",)),
        "health_gathering_supreme": (2, 5, ("CustomMedikit", "Poison")),
    }
    for path in RECORDINGS.glob("*.npz"):
        for old, new in zip(load(path), load(tmp_path / "new" / path.name), strict=True):
            for one, other in zip(astuple(old), astuple(new), strict=True):
                np.testing.assert_array_equal(one, other)
