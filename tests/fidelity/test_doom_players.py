"""Significant differences, and games played in parallel."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("gymnasium")

from fidelity import doom_players


def test_distance_in_standard_errors() -> None:
    assert doom_players.apart((3.0, 0.3), (4.0, 0.4)) == pytest.approx(2)
    assert doom_players.apart((3.0, 0.0), (3.0001, 0.0)) == 0
    assert doom_players.apart((3.0, 0.0), (4.0, 0.0)) == math.inf


class Counting:
    """A game whose episode of seed n takes n + 1 steps; each step rewards with the action."""

    begun = 0

    def __init__(self, env: Any, params: Any, seed: int) -> None:
        type(self).begun += 1
        self.reset(seed)

    def reset(self, seed: int) -> None:
        self.seed, self.actions = seed, []
        self.info = {"success": seed % 2 == 1}

    @property
    def told(self) -> np.ndarray:
        return np.array(self.seed)

    @property
    def over(self) -> bool:
        return len(self.actions) > self.seed

    @property
    def episode_return(self) -> float:
        return float(sum(self.actions))

    def step(self, action: int) -> None:
        self.actions.append(action)

    def close(self) -> None:
        type(self).begun -= 1


def test_an_unknown_player_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        doom_players.main(["doom-basic", "--only", "nosuch"])
    assert "--only: 'nosuch' should be one of idle, random, " in capsys.readouterr().err


def test_parallel_games_equal_episodes_in_seed_order(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doom_players, "GameSession", Counting)
    monkeypatch.setattr(
        doom_players, "_chooser", lambda *_: lambda key, told: [int(t) for t in told]
    )
    watched: list[tuple[int, int]] = []

    def watch(number: int, session: Any) -> None:
        watched.append((number, len(session.actions)))

    none: Any = SimpleNamespace()
    games = doom_players.play_games(none, None, "idle", episodes=5, games=3, watch=watch)
    assert games.lengths.tolist() == [1, 2, 3, 4, 5]
    assert games.returns.tolist() == [0, 2, 6, 12, 20]
    assert games.successes.tolist() == [False, True, False, True, False]
    assert sorted(watched) == [(n, step) for n in range(5) for step in range(n + 1)]
    assert Counting.begun == 0
