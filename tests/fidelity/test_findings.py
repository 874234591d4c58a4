"""The statistics of measured rules, and what is noted of medkits."""

from __future__ import annotations

import importlib
import importlib.util

import pytest

from fidelity import vizdoom_rules, vizdoom_view
from fidelity.findings import Findings, chi_square, mean_and_error, shown
from fidelity.vizdoom_game import single_buttons
from fidelity.vizdoom_health import Contacts, Snapshot, note, towards_nearest


def test_chances_of_chi_square_as_in_tables() -> None:
    # The 95 and 99 in 100 points of 10 degrees of freedom are 18.307 and 23.209.
    for target, chance in ((18.307, 0.05), (23.209, 0.01)):
        # Eleven counts of mean 100, two of them off by d, have the statistic 2 d^2 / 100.
        off = (target * 50) ** 0.5
        statistic, found = chi_square([100 + off, 100 - off] + [100] * 9)
        assert statistic == pytest.approx(target)
        assert found == pytest.approx(chance, rel=0.02)
    assert chi_square([7.0] * 20) == (0.0, pytest.approx(1.0))


def test_mean_and_its_error() -> None:
    assert mean_and_error([1.0, 2.0, 3.0, 4.0]) == (2.5, pytest.approx((5 / 12) ** 0.5))


def test_findings_are_printed(capsys) -> None:
    findings = Findings("Title")
    findings.add("a", (1, 2.5), 3, "b")
    assert capsys.readouterr().out.splitlines()[-1] == "| a | 1 2.5 | 3 | b |"
    assert shown({"x": 2, "y": 1}) == "x: 2, y: 1"


def test_actions_of_one_button() -> None:
    assert single_buttons(2, idle=True) == [[0, 0], [1, 0], [0, 1]]
    assert single_buttons(2, idle=False) == [[1, 0], [0, 1]]


@pytest.mark.parametrize(
    ("angle", "button"),
    [(0, 2), (7, 2), (-7 % 360, 2), (90, 1), (270, 0), (179, 1), (181, 0), (350, 0), (10, 1)],
)
def test_the_greedy_player_turns_the_short_way(angle: float, button: int) -> None:
    state = Snapshot(50, 100, 100, angle, {1: (200.0, 100.0), 2: (400.0, 100.0)})
    assert towards_nearest(state).index(1) == button
    assert towards_nearest(Snapshot(50, 0, 0, 0, {})) == [0, 0, 0]


def state(health: float, x: float, **medkits: float) -> Snapshot:
    """A player at (x, 0), facing east, and medkits on the same line."""
    places = {ord(name): (place, 0.0) for name, place in medkits.items()}
    return Snapshot(health, x, 0.0, 0.0, places)


def test_what_a_step_did_with_medkits() -> None:
    contacts = Contacts()
    note(contacts, state(60, 0, a=40), state(85, 8), damage=False)
    note(contacts, state(85, 8, b=43), state(85, 8, b=43), damage=False)
    note(contacts, state(85, 8, b=46), state(85, 12, b=46), damage=False)
    note(contacts, state(100, 12, b=46), state(100, 14, b=46), damage=False)
    note(contacts, state(100, 14, b=46), state(100, 16), damage=True)
    # One that appears within reach during the step counts nowhere.
    note(contacts, state(60, 16), state(60, 18, c=20), damage=False)
    assert contacts.taken_at == [32.0, 30.0]
    assert contacts.heals == {(60, 85): 1}
    assert contacts.on_damage == {(100, 100): 1}
    assert (contacts.still_in_reach, contacts.still_taken) == (1, 0)
    assert contacts.left_in_reach == 1
    assert (contacts.full_in_reach, contacts.full_taken) == (1, 0)


@pytest.mark.parametrize("script", [vizdoom_rules, vizdoom_view])
def test_without_vizdoom_a_script_says_what_to_install(script, monkeypatch, capsys) -> None:
    real = importlib.import_module

    def missing(name: str, package: str | None = None):
        if name == "vizdoom":
            raise ImportError(f"No module named {name!r}")
        return real(name, package)

    monkeypatch.setattr(importlib, "import_module", missing)
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert script.main([]) == 2
    assert "pip install '.[bench]'" in capsys.readouterr().err
