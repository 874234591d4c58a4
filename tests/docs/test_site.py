"""The site is built by one command without warnings."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def test_docs_extra_includes_trainer_requirements() -> None:
    """The site shows the trainer's flags and classes, so its scripts import the trainer."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    extras = project["optional-dependencies"]
    assert "jaxenstein[baselines]" in extras["docs"]


@pytest.mark.slow
def test_site_builds_without_warnings(tmp_path: Path) -> None:
    for package in ("sphinx", "furo", "myst_parser"):
        pytest.importorskip(package)
    options = ("-W", "--keep-going", "-q", "-d", str(tmp_path / "cache"))
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", *options, "docs", str(tmp_path / "html")],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT / "src")},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    for page in ("index", "environments/my-way-home", "reference", "contributing"):
        assert (tmp_path / "html" / f"{page}.html").is_file()
