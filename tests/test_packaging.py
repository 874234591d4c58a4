"""Importing and installing the package, and their side effects."""

from __future__ import annotations

import importlib.metadata
import importlib.resources
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import jaxenstein
from jaxenstein.version import __version__

SOURCE = Path(jaxenstein.__file__).parent.parent
LIST_MODULES = "import json, sys; print(json.dumps(sorted(sys.modules)))"
INITIALISED = "from jax._src import xla_bridge; print(xla_bridge.backends_are_initialized())"


def run_python(code: str, home: Path) -> str:
    """Run `code` in a fresh interpreter whose home and working directory is `home`."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("XDG_")}
    environment |= {"HOME": str(home), "PYTHONPATH": str(SOURCE), "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=home, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert not done.stderr
    return done.stdout


def loaded_modules(statement: str, home: Path) -> set[str]:
    return set(json.loads(run_python(f"{statement}\n{LIST_MODULES}", home)))


def test_import_loads_nothing_heavy_beyond_jax(tmp_path: Path) -> None:
    """Importing costs little more than importing jax, measured in modules instead of time."""
    before = loaded_modules("import jax, jax.numpy, numpy", tmp_path)
    after = loaded_modules("import jaxenstein", tmp_path)
    assert "jaxenstein" in after
    extra = {name.partition(".")[0] for name in after - before} - {"jaxenstein"}
    assert extra <= set(sys.stdlib_module_names) | {"jax"}
    assert not extra & {"PIL", "scipy", "argparse", "asyncio", "multiprocessing", "unittest"}
    assert len(after - before) < 40, sorted(after - before)
    late = ("cli", "view", "tasks", "engine", "maps")
    assert not [name for name in after if name.startswith(tuple(f"jaxenstein.{x}" for x in late))]


def test_import_touches_no_device(tmp_path: Path) -> None:
    assert run_python(f"import jaxenstein\n{INITIALISED}", tmp_path).strip() == "False"
    # The probe is worth something only if it sees a backend that has been started.
    started = run_python(f"import jax\njax.devices()\n{INITIALISED}", tmp_path)
    assert started.strip() == "True"


def test_import_writes_no_file(tmp_path: Path) -> None:
    home = tmp_path / "home"
    home.mkdir()
    before = sorted(SOURCE.rglob("*"))
    run_python("import jaxenstein", home)
    assert list(home.iterdir()) == []
    assert sorted(SOURCE.rglob("*")) == before


def test_version_is_the_installed_one() -> None:
    try:
        installed = importlib.metadata.version("jaxenstein")
    except importlib.metadata.PackageNotFoundError:
        pytest.skip("runs from the source tree, not installed")
    assert installed == __version__


def test_data_files_are_in_the_package() -> None:
    package = importlib.resources.files("jaxenstein")
    assert package.joinpath("py.typed").is_file()
    for folder in ("maps/layouts", "engine/art"):
        names = [item.name for item in package.joinpath(folder).iterdir()]
        assert any(name.endswith(".txt") for name in names), folder
