"""Numbers from traced episodes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

pytest.importorskip("gymnasium")

from fidelity.doom_fights import (
    Measure,
    Seen,
    differs,
    distances,
    likeness,
    main,
    shots,
    thrown,
)


def trace(tics: int, **fields: Any) -> Seen:
    """A player in the middle who faces north, and a monster 100 units to the east."""
    nothing = {
        "health": np.full(tics, 100),
        "ammo": np.full(tics, 9),
        "player": np.zeros((tics, 2)),
        "angle": np.full(tics, 1 << 30, np.uint32),
        "places": np.full((tics, 1, 2), (100.0, 0.0)),
        "living": np.ones((tics, 1), bool),
        "balls": np.zeros((tics, 0, 2)),
        "flies": np.zeros((tics, 0), bool),
    }
    return Seen(**nothing | fields)


def test_fireball_counts_in_the_tic_it_appears() -> None:
    places = [[(50.0, 0), (0, 0)], [(40, 0), (63, 5)], [(34, 8), (53, 5)], [(9, 9), (0, 0)]]
    flies = np.array([[True, False], [True, True], [True, True], [False, False]])
    assert thrown(trace(4, balls=np.array(places), flies=flies)).tolist() == [1, 0, 0]


def test_shot_is_aimed_where_the_player_looks() -> None:
    places = np.tile([[(100.0, 0.0), (0.0, 30.0), (0.0, 20.0)]], (4, 1, 1))
    living = np.ones((4, 3), bool)
    living[:, 2] = False
    living[3, 1] = False
    ammo = np.array([9, 8, 8, 7])
    watched = trace(4, places=places, living=living, ammo=ammo)
    np.testing.assert_array_equal(shots(watched), [[30, 0], [30, 1]])
    assert distances(watched)[0].tolist() == [100, 30, math.inf]


def test_likeness_of_equal_and_different_distributions() -> None:
    dice = np.random.default_rng(0).integers(1, 7, (2, 600))
    assert likeness(dice[0].tolist(), dice[1].tolist()) > 0.001
    assert likeness(dice[0].tolist(), (dice[1] % 5).tolist()) < 1e-6
    assert likeness([1.0] * 20, [1.0] * 30) == 1


def test_differences_are_distant_or_unlikely() -> None:
    row = Measure("id", "idle", "what", (3.0, 0.3), (3.5, 0.4))
    assert not differs(row)
    assert differs(row._replace(chance=0.01))
    assert differs(row._replace(there=(5.0, 0.4)))


def test_a_scenario_without_fights_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["simple"])
    assert "'simple' should be one of doom-defend-the-center, " in capsys.readouterr().err
