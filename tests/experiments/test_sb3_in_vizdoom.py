"""An agent of Stable-Baselines3 that plays in two places, on a toy in place of Doom."""

from __future__ import annotations

import itertools
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")
pytest.importorskip("stable_baselines3")

from experiments import sb3_in_vizdoom  # noqa: E402


class Toy(gymnasium.Env):
    """Three steps with a reward of `worth` each; it ends or, after an even seed, is cut off."""

    action_space = gymnasium.spaces.Discrete(2)
    observation_space = gymnasium.spaces.Box(0, 255, (60, 80, 3), np.uint8)

    def __init__(self, worth: float) -> None:
        self.worth = worth

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        self.left, self.cut = 3, (seed or 0) % 2 == 0
        return self.observation_space.low, {}

    def step(self, action: int) -> Any:
        self.left -= 1
        over = self.left == 0
        return self.observation_space.low, self.worth, over and not self.cut, over and self.cut, {}


@pytest.mark.filterwarnings("default")
def test_agent_is_trained_in_the_game_and_acts_in_both(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    made: list[str] = []

    def seen(scenario: str, module: str) -> Any:
        made.append(module)
        return Toy({"jaxenstein": 2.0}.get(module, 100.0))

    monkeypatch.setattr(sb3_in_vizdoom, "seen", seen)
    monkeypatch.setattr(sb3_in_vizdoom, "SETTINGS", {"n_steps": 8, "batch_size": 8, "n_epochs": 1})
    monkeypatch.setattr(sb3_in_vizdoom, "GAMES", 2)
    # A second passes between two looks at the clock.
    monkeypatch.setitem(sb3_in_vizdoom.CLOCKS, "wall", itertools.count().__next__)
    game, model, rows = "vizdoom.gymnasium_wrapper", tmp_path / "model.zip", tmp_path / "rows"
    arguments = ["--minutes", "0.25", "--episodes", "4", "--model", str(model), "--rows", str(rows)]
    sb3_in_vizdoom.main(arguments)
    assert made == [game, game, game, "jaxenstein"]
    told = capsys.readouterr().out
    # Learned from a hundredth of the rewards.
    assert "| 3 " in " ".join(told.split())
    assert told.endswith("in ViZDoom: 300 (300 to 300)\nhere: 6 (6 to 6)\n")
    # Two games of eight steps hold four whole episodes of three.
    first, *_ = map(json.loads, rows.read_text("utf-8").splitlines())
    assert first == {
        "seed": 0, "steps": 16, "seconds": 9, "episodes": 4, "return_sum": pytest.approx(1200),
        "successes": 4,
    }  # fmt: skip
    rows.unlink()
    sb3_in_vizdoom.main(arguments)
    assert made[4:] == [game, "jaxenstein"]
    assert not rows.exists()
