"""The statistics of ViZDoom's rules."""

from __future__ import annotations

import pytest

from fidelity.vizdoom_rules import Snapshot, towards_nearest, uniform


def test_chi_square_p_values_match_tables(capsys: pytest.CaptureFixture[str]) -> None:
    # The 95 in 100 point of 10 degrees of freedom is 18.307. Eleven counts of mean 100, two of
    # them off by d, have the statistic 2 d^2 / 100.
    off = (18.307 * 50) ** 0.5
    uniform("even", [100 + off, 100 - off] + [100] * 9)
    assert capsys.readouterr().out == (
        "| even, chi-square | 18.3 | 1100 | 10 degrees, chance of more: 0.05 |\n"
    )


@pytest.mark.parametrize(
    ("angle", "button"),
    [(0, 2), (7, 2), (-7 % 360, 2), (90, 1), (270, 0), (179, 1), (181, 0), (350, 0), (10, 1)],
)
def test_the_greedy_player_turns_the_short_way(angle: float, button: int) -> None:
    state = Snapshot(50, 100, 100, angle, {1: (200.0, 100.0), 2: (400.0, 100.0)})
    assert towards_nearest(state).index(1) == button
    assert towards_nearest(Snapshot(50, 0, 0, 0, {})) == [0, 0, 0]
