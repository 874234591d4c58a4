"""Maps of visits: what is counted, and that it goes on where it stopped."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("flax")

from experiments import visits

CONFIG = (
    'map = """\n#####\n#S..#\n###G#\n#####\n"""\nheading = 0\nheight = 8\nwidth = 8\nhorizon = 8\n'
    'recipe = "tuned"\nnum_envs = 8\nrollout = 8\nseeds = 2\ntotal_steps = 256\n'
)


def size_of(path: Path) -> tuple[int, int]:
    with Image.open(path) as picture:
        return picture.size


def test_visits_are_counted_at_each_stage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "config.toml").write_text(CONFIG)
    command = [str(tmp_path / "config.toml"), "--algo", "ppo", "--stages", "3"]
    visits.main([*command, "--out", str(tmp_path / "runs")])
    file = tmp_path / "runs" / "ppo" / "visits.json"
    kept = json.loads(file.read_text())
    assert list(kept) == ["0", "2", "4"]
    for counts in map(np.array, kept.values()):
        # Two seeds, each for as many steps as an episode can have; nobody stands in a wall.
        assert counts.sum() == 2 * visits.EPISODES * 8
        free = np.zeros((4, 5), bool)
        free[1, 1:4] = free[2, 3] = True
        assert not counts[~free].any()
        assert counts[1, 1] > 0
    rows = (tmp_path / "runs" / "ppo" / "metrics.jsonl").read_text()
    assert len(rows.splitlines()) == 4 * 2
    size = size_of(tmp_path / "runs" / "visits.png")
    # Again: nothing is trained or counted anew; what is missing is.
    monkeypatch.setattr(visits, "visits", lambda folder: np.zeros((4, 5), int))
    file.write_text(json.dumps({name: kept[name] for name in ("0", "2")}))
    visits.main([*command, "--out", str(tmp_path / "runs")])
    again = json.loads(file.read_text())
    assert again["2"] == kept["2"]
    assert not np.any(again["4"])
    assert (tmp_path / "runs" / "ppo" / "metrics.jsonl").read_text() == rows
    assert size_of(tmp_path / "runs" / "visits.png") == size
