"""The environments for tests with other packages. Running one takes minutes."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from reliability.partners import PARTNERS, TESTS

ROOT = Path(__file__).resolve().parents[2]
# Modules of partners that `make test` installs itself.
INSTALLED = {"flax", "gymnasium", "gymnax", "matplotlib"}


def test_partners_have_tests_that_exist() -> None:
    for partner in PARTNERS.values():
        assert partner.requirements
        assert partner.modules
        assert all((ROOT / TESTS / test).is_file() for test in partner.tests)


def test_each_test_of_a_partner_runs_in_its_environment() -> None:
    """All files that skip tests without a package that `make test` does not install."""
    skips = re.compile(r'(?:importorskip|find_spec)\("(\w+)')
    modules = {name for partner in PARTNERS.values() for name in partner.modules} - INSTALLED
    checked = 0
    for file in (ROOT / TESTS).rglob("test_*.py"):
        name = file.relative_to(ROOT / TESTS).as_posix()
        for module in modules.intersection(skips.findall(file.read_text("utf-8"))):
            users = [partner for partner in PARTNERS.values() if module in partner.modules]
            assert any(name in partner.tests for partner in users), (name, module)
            checked += 1
    assert checked > 20


def test_every_lane_and_partner_has_a_session() -> None:
    pytest.importorskip("nox")
    command = [sys.executable, "-m", "nox", "--list", "-f", str(ROOT / "noxfile.py")]
    listed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    lanes = [f"lane-{python}({end})" for python in ("3.11", "3.12", "3.13")
             for end in ("oldest", "newest", "extras")]  # fmt: skip
    for name in (*lanes, "x64", "wheel", *(f"partners({name})" for name in PARTNERS)):
        assert f"* {name} [" in listed
