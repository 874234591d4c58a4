"""The lanes: what they are made of. Running one takes minutes and is not tested here."""

from __future__ import annotations

import pytest

from reliability import lanes


def test_lower_bounds_are_those_of_the_project() -> None:
    bounds = lanes.lower_bounds()
    assert set(bounds) == {"jax", "numpy", "pillow"}
    assert all(part.isdecimal() for bound in bounds.values() for part in bound.split("."))


def test_there_is_a_lane_for_each_python_and_end() -> None:
    known = lanes.lanes()
    for python in lanes.PYTHONS:
        oldest, newest = known[f"{python}-oldest"], known[f"{python}-newest"]
        assert any(line.startswith("jax ==") for line in oldest.requirements())
        assert not any(line.startswith("jax") for line in newest.requirements())
        assert not oldest.extras
        assert known[f"{python}-extras"].extras
    assert dict(known["x64"].variables) == {"JAX_ENABLE_X64": "1"}
    assert known["wheel"].wheel


def test_a_lane_without_its_python_is_not_tried(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(lanes, "find_python", lambda version: None)
    assert lanes.main(["3.12-newest"]) == 0
    assert "no python3.12 here: not tried" in capsys.readouterr().out


def test_unknown_lanes_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert lanes.main(["2.7-newest"]) == 2
    assert "unknown: 2.7-newest" in capsys.readouterr().err


def test_the_table_lists_all(capsys: pytest.CaptureFixture[str]) -> None:
    assert lanes.main(["--list"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == len(lanes.lanes())
