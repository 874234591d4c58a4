"""The environments for tests with other packages. Running one takes minutes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from reliability.partners import PARTNERS, TESTS

ROOT = Path(__file__).resolve().parents[2]


def test_partners_have_tests_that_exist() -> None:
    for partner in PARTNERS.values():
        assert partner.requirements
        assert partner.modules
        assert all((ROOT / TESTS / test).is_file() for test in partner.tests)


def test_every_lane_and_partner_has_a_session() -> None:
    pytest.importorskip("nox")
    command = [sys.executable, "-m", "nox", "--list", "-f", str(ROOT / "noxfile.py")]
    listed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    lanes = [f"lane-{python}({end})" for python in ("3.11", "3.12", "3.13")
             for end in ("oldest", "newest", "extras")]  # fmt: skip
    for name in (*lanes, "x64", "wheel", *(f"partners({name})" for name in PARTNERS)):
        assert f"* {name} [" in listed
