"""The tests with each Python, the oldest and the newest JAX, with and without extras.

    python -m reliability.lanes                      every lane that this machine can run
    python -m reliability.lanes --list               the table
    python -m reliability.lanes 3.13-newest wheel    some of them
    python -m reliability.lanes --quick -k maps      only some tests of each

Each lane has a virtual environment of its own below `.venv-lanes`, made once and again where its
requirements change or with `--fresh`. Pythons are looked for on the path and below pyenv's folder.
The lane `wheel` builds the package, unpacks its source archive elsewhere, removes the sources from
it, and runs its tests on the installed wheel. Partners of the adapters that exclude each other have
environments of their own: `make partners`.
"""

from __future__ import annotations

import argparse
import dataclasses
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import tomllib
from collections.abc import Sequence
from pathlib import Path

from reliability import environments
from reliability.environments import ROOT, TOOLS, Outcome, find_python

FOLDER = ROOT / ".venv-lanes"
PYTHONS = ("3.11", "3.12", "3.13")
# Extras that install beside each other with any Python; torch is with the partners.
EXTRAS = ("baselines", "gymnasium", "minigrid", "play", "video", "dev")
MODULES = ("flax", "gymnasium", "matplotlib", "orbax", "minigrid")
# What is worth running where 64-bit numbers are on, and where there is little time.
RULES = ("tests/contract", "tests/engine", "tests/tasks")
QUICK = ("tests/maps", "tests/contract/test_golden.py", "tests/test_packaging.py")


@dataclasses.dataclass(frozen=True)
class Lane:
    """One environment and what is tested in it.

    Attributes:
        python: its version.
        oldest: whether the versions are the lower bounds of pyproject.toml, else the newest.
        extras: which of the package's extras are installed.
        tests: files and folders.
        variables: of the process's environment.
        wheel: whether the built wheel is tested, outside of the source tree.
    """

    python: str
    oldest: bool = False
    extras: tuple[str, ...] = ()
    tests: tuple[str, ...] = ("tests",)
    variables: tuple[tuple[str, str], ...] = ()
    wheel: bool = False

    def requirements(self) -> list[str]:
        """What pip installs beside the package."""
        floors = lower_bounds()
        if not self.oldest:
            return list(TOOLS)
        # Of the oldest numpy there are wheels for the oldest Python alone.
        names = floors if self.python == PYTHONS[0] else ["jax"]
        return [*TOOLS, *(f"{name} == {floors[name]}" for name in names)]


def lanes() -> dict[str, Lane]:
    """All lanes by name."""
    found = {}
    for python in PYTHONS:
        found[f"{python}-oldest"] = Lane(python, oldest=True)
        found[f"{python}-newest"] = Lane(python)
        found[f"{python}-extras"] = Lane(python, extras=EXTRAS)
    wide = (("JAX_ENABLE_X64", "1"),)
    found["x64"] = Lane(PYTHONS[-1], tests=RULES, variables=wide)
    found["wheel"] = Lane(PYTHONS[-1], wheel=True)
    return found


def lower_bounds() -> dict[str, str]:
    """The lower bounds of what the package depends on, by name."""
    table = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    bounds = {}
    for line in table["project"]["dependencies"]:
        match = re.fullmatch(r"([\w.-]+)\s*>=\s*([\d.]+)", line)
        if match is None:
            raise LookupError(f"pyproject.toml: {line!r} has no lower bound that is read here")
        bounds[match[1]] = match[2]
    return bounds


def attempt(name: str, lane: Lane, options: argparse.Namespace) -> Outcome:
    """Make the environment of a lane if need be, and run its tests."""
    print(f"== {name}", flush=True)
    base = find_python(lane.python)
    if base is None:
        return Outcome(problem=f"no python{lane.python} here: not tried", tried=False)
    folder, fresh = options.folder.resolve() / name, options.fresh
    extras = f".[{','.join(lane.extras)}]" if lane.extras else "."
    try:
        with tempfile.TemporaryDirectory(prefix="lane-") as scratch:
            where, package = ROOT, ("--editable", extras)
            if lane.wheel:
                where, wheel = built(base, folder, Path(scratch))
                package = (wheel,)
            needed = lane.requirements()
            python, new = environments.make(base, folder, package, needed, fresh=fresh)
            if lane.wheel and not new:
                environments.pip_install(python, "--no-deps", "--force-reinstall", *package)
            return _run(lane, python, where, folder / "report.xml", options)
    except (subprocess.CalledProcessError, OSError, LookupError) as error:
        return Outcome(problem=f"cannot be installed: {error}")


def built(base: str, folder: Path, scratch: Path) -> tuple[Path, str]:
    """The tests of the source archive without its sources, and the wheel that was built of it."""
    tools = folder.with_name(f"{folder.name}-build")
    python = str(tools / "bin" / "python")
    if not Path(python).exists():
        environments.call([base, "-m", "venv", str(tools)])
        environments.pip_install(python, "build")
    target = str(scratch / "dist")
    environments.call([python, "-m", "build", "--outdir", target, str(ROOT)], quiet=True)
    (archive,) = (scratch / "dist").glob("*.tar.gz")
    (wheel,) = (scratch / "dist").glob("*.whl")
    with tarfile.open(archive) as file:
        file.extractall(scratch, filter="data")
    (tree,) = (path.parent for path in scratch.glob("*/pyproject.toml"))
    shutil.rmtree(tree / "src")
    return tree, str(wheel)


def _run(
    lane: Lane, python: str, where: Path, report: Path, options: argparse.Namespace
) -> Outcome:
    tests = [test for test in QUICK if (where / test).exists()] if options.quick else lane.tests
    arguments = ["-m", "not slow", "-p", "no:cacheprovider", *tests]
    arguments += ["-n", str(options.workers), "--dist", "loadfile"] if options.workers else []
    arguments += ["-k", options.k] if options.k else []
    return environments.run_tests(
        python,
        arguments,
        report,
        where=where,
        # What is missing without extras may be skipped; with them all modules must be there.
        modules=MODULES if lane.extras else (),
        shown=("numpy", *(("flax",) if "baselines" in lane.extras else ())),
        more={**dict(lane.variables), "PYTHONDONTWRITEBYTECODE": "1"},
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what the command line names; 1 if anything failed."""
    summary, known = (__doc__ or "").split("\n\n"), lanes()
    parser = argparse.ArgumentParser(
        prog="python -m reliability.lanes", description=summary[0], epilog=summary[2]
    )
    parser.add_argument("names", nargs="*", metavar="LANE", help="which ones (default: all)")
    parser.add_argument("--list", action="store_true", help="print the lanes")
    parser.add_argument("--fresh", action="store_true", help="make the environments anew")
    parser.add_argument("--folder", type=Path, default=FOLDER, help="of the environments")
    parser.add_argument("--quick", action="store_true", help=f"only {', '.join(QUICK)}")
    parser.add_argument("--workers", type=int, default=0, help="processes of pytest (1 without)")
    parser.add_argument("-k", metavar="EXPRESSION", help="only the tests that pytest -k picks")
    options = parser.parse_args(arguments)
    unknown = [name for name in options.names if name not in known]
    if unknown:
        print(f"unknown: {', '.join(unknown)}; known: {', '.join(known)}", file=sys.stderr)
        return 2
    chosen = {name: known[name] for name in options.names or known}
    if options.list:
        for name, lane in chosen.items():
            print(f"{name:14} {_described(lane)}")
        return 0
    outcomes = {name: attempt(name, lane, options) for name, lane in chosen.items()}
    print(environments.table("lane", outcomes))
    return int(any(outcome.problem and outcome.tried for outcome in outcomes.values()))


def _described(lane: Lane) -> str:
    parts = [f"Python {lane.python} ({find_python(lane.python) or 'not found'})"]
    parts.append("oldest JAX" if lane.oldest else "newest JAX")
    parts += [f"extras {', '.join(lane.extras)}"] if lane.extras else []
    parts += [f"{name}={value}" for name, value in lane.variables]
    parts += ["the wheel, outside of the source tree"] if lane.wheel else []
    return "; ".join(parts)


if __name__ == "__main__":
    sys.exit(main())
