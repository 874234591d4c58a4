"""The tests beside other versions, each in a virtual environment of its own below `.nox`.

    make lanes       each Python with the oldest and newest JAX and with extras, and the wheel
    make partners    the tests of adapters and examples beside the packages that they are for

`ARGS="-p 3.12"` or `ARGS="-k gymnax"` runs some of them, `ARGS="-- -k maps"` some tests of each,
`ARGS=--list` tells all. An interpreter that is not there is left out. Environments are kept: `-R`
does not even look for new requirements in them, and removing `.nox` begins again. Where pyenv has
the interpreters, `PYENV_VERSION=3.11.7:3.12.1:3.13.0` (what `pyenv versions` lists) shows them.
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
TOOLS = ("pytest >= 8.3", "hypothesis >= 6.130", "pytest-xdist >= 3.6")
# Extras that install beside each other with any Python, and what they must make importable.
EXTRAS = ".[baselines,gymnasium,minigrid,play,video,dev]"
MODULES = ("flax", "gymnasium", "matplotlib", "minigrid")
# What is worth running where 64-bit numbers are on.
RULES = ("tests/contract", "tests/engine", "tests/tasks")


def lower_bounds(python: str) -> list[str]:
    """The oldest versions that the package takes, for pip."""
    project = nox.project.load_toml(Path(__file__).with_name("pyproject.toml"))["project"]
    oldest = [line.replace(">=", "==") for line in project["dependencies"]]
    # Of the oldest numpy there are wheels for the oldest Python alone.
    return [line for line in oldest if python == PYTHONS[0] or line.startswith("jax ")]


def run_tests(
    session: nox.Session, *tests: str, modules: tuple[str, ...] = (), trainings: bool = False
) -> None:
    """Run some tests, after making sure that none is skipped for want of a module."""
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
    """The tests with the oldest or the newest JAX, or with everything that is optional."""
    oldest = lower_bounds(str(session.python)) if versions == "oldest" else []
    extras = versions == "extras"
    session.install("--editable", EXTRAS if extras else ".", *TOOLS, *oldest)
    run_tests(session, modules=MODULES if extras else ())


@nox.session(python=PYTHONS[-1], tags=["lanes"])
def x64(session: nox.Session) -> None:
    """Engine, rules and contract where JAX has 64-bit numbers switched on."""
    session.install("--editable", ".", *TOOLS)
    session.env["JAX_ENABLE_X64"] = "1"
    run_tests(session, *RULES)


@nox.session(python=PYTHONS[-1], tags=["lanes"])
def wheel(session: nox.Session) -> None:
    """The tests of the source archive, without its sources, on the wheel built of it."""
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
    """The tests of adapters and examples beside a package, its trainings among them."""
    chosen = PARTNERS[partner]
    session.install("--editable", ".", *TOOLS, *chosen.requirements)
    tests = (f"{TESTS}/{test}" for test in chosen.tests)
    run_tests(session, *tests, modules=chosen.modules, trainings=True)
