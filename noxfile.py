"""Run the tests with other versions, each in its own virtual environment in `.nox`.

    make lanes       every Python with the oldest and newest JAX and with extras, and the wheel
    make partners    the tests of adapters and examples with their packages

`ARGS="-p 3.12"` or `ARGS="-k gymnax"` runs some sessions, `ARGS="-- -k maps"` some tests of each,
and `ARGS=--list` lists the sessions. Missing interpreters are skipped. Environments are kept; `-R`
also skips the installation, and removing `.nox` starts from scratch. For interpreters of pyenv, set
`PYENV_VERSION=3.11.7:3.12.1:3.13.0` to versions from `pyenv versions`.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import nox

sys.path.insert(0, str(Path(__file__).parent))

from reliability.partners import PARTNERS, TESTS

nox.needs_version = ">= 2024.10"
nox.options.default_venv_backend = "virtualenv"
nox.options.reuse_venv = "yes"
nox.options.error_on_missing_interpreters = False

PYTHONS = ("3.11", "3.12", "3.13")
HERE = f"{sys.version_info.major}.{sys.version_info.minor}"
TOOLS = ("pytest >= 8.3", "hypothesis >= 6.130", "pytest-xdist >= 3.7")
# Extras that install together with any Python, and modules that must then be importable.
EXTRAS = ".[baselines,gymnasium,minigrid,play,video,dev]"
MODULES = ("flax", "gymnasium", "matplotlib", "minigrid")
# The tests to run with 64-bit numbers.
RULES = ("tests/contract", "tests/engine", "tests/tasks")


def lower_bounds(python: str) -> list[str]:
    """The oldest supported versions, as requirements for pip."""
    project = nox.project.load_toml(Path(__file__).with_name("pyproject.toml"))["project"]
    oldest = [line.replace(">=", "==") for line in project["dependencies"]]
    # The oldest numpy has wheels only for the oldest Python.
    return [line for line in oldest if python == PYTHONS[0] or line.startswith("jax ")]


def run_tests(
    session: nox.Session, *tests: str, modules: tuple[str, ...] = (), trainings: bool = False
) -> None:
    """Run some tests; fail first if a module is missing, since its tests would be skipped."""
    chosen = () if trainings else ("-m", "not (slow or variant or training)")
    session.run("python", "-c", f"import {', '.join(('jax', *modules))}; print(jax.__version__)")
    session.run(
        *("python", "-m", "pytest", "-q", *chosen, "-p", "no:cacheprovider"),
        *("-n", "auto", "--dist", "loadfile", *tests, *session.posargs),
        env={"PYTHONDONTWRITEBYTECODE": "1", "PYTHONPATH": None},
    )


@nox.session(python=PYTHONS, tags=["lanes"])
@nox.parametrize("versions", ["oldest", "newest", "extras"], ids=["oldest", "newest", "extras"])
def lane(session: nox.Session, versions: str) -> None:
    """The tests with the oldest or newest JAX, or with `EXTRAS`."""
    oldest = lower_bounds(str(session.python)) if versions == "oldest" else []
    extras = versions == "extras"
    session.install("--editable", EXTRAS if extras else ".", *TOOLS, *oldest)
    run_tests(session, modules=MODULES if extras else ())


@nox.session(python=PYTHONS[-1], tags=["lanes"])
def x64(session: nox.Session) -> None:
    """Engine, rules and contract with 64-bit numbers enabled in JAX."""
    session.install("--editable", ".", *TOOLS)
    session.env["JAX_ENABLE_X64"] = "1"
    run_tests(session, *RULES)


@nox.session(python=PYTHONS[-1], tags=["lanes"])
def wheel(session: nox.Session) -> None:
    """The tests from the source archive, without its sources, on the wheel."""
    session.install("build", *TOOLS)
    folder = Path(session.create_tmp())
    shutil.rmtree(folder / "tree", ignore_errors=True)
    session.run("python", "-m", "build", "--outdir", f"{folder}/tree", ".", silent=True)
    (archive,), (built,) = (tuple((folder / "tree").glob(end)) for end in ("*.tar.gz", "*.whl"))
    session.install(f"{built}")
    session.install("--force-reinstall", "--no-deps", f"{built}")
    shutil.unpack_archive(archive, folder / "tree", filter="data")
    (project,) = (folder / "tree").glob("*/pyproject.toml")
    shutil.rmtree(project.parent / "src")
    session.chdir(project.parent)
    run_tests(session)


@nox.session(tags=["partners"])
@nox.parametrize(
    "python,partner",
    [(partner.python or HERE, name) for name, partner in PARTNERS.items()],
    ids=list(PARTNERS),
)
def partners(session: nox.Session, partner: str) -> None:
    """The tests of adapters and examples with a package, including trainings."""
    chosen = PARTNERS[partner]
    session.install("--editable", ".", *TOOLS, *chosen.requirements)
    tests = (f"{TESTS}/{test}" for test in chosen.tests)
    run_tests(session, *tests, modules=chosen.modules, trainings=True)
