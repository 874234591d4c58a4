"""Run the adapters' tests beside the real partner packages, each set in an environment of its own.

    python -m reliability.partners                 all of them
    python -m reliability.partners gymnax rejax    some of them
    python -m reliability.partners --list          the table

Partners exclude each other: gymnax 1.x sets upper limits on JAX and Gymnasium, and rejax needs
gymnax 0.0.9. So each name of `PARTNERS` gets a virtual environment, made once in a folder that git
ignores and brought up to date with `--fresh`. A test that is skipped because its partner cannot
be imported there counts as a failure; so does a partner whose tests all are skipped.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from reliability import environments
from reliability.environments import ROOT, TOOLS, Outcome

FOLDER = ROOT / ".venv-partners"
TESTS = "tests/adapters"


@dataclass(frozen=True)
class Partner:
    """One environment.

    Attributes:
        requirements: what pip installs beside this package and pytest.
        tests: files in the folder `TESTS`.
        modules: what must be importable; a test skipped for want of one of them is a failure.
        shown: distributions whose versions the table shows.
        python: the only Python version that will do, such as "3.11"; None for any.
    """

    requirements: tuple[str, ...]
    tests: tuple[str, ...]
    modules: tuple[str, ...]
    shown: tuple[str, ...]
    python: str | None = None


# gymnax imports six without requiring it, and what once brought it along no longer does.
_TORCH = "torch==2.13.0"
_GYMNASIUM = ("test_gymnasium.py", "test_gymnasium_vector.py")
PARTNERS: dict[str, Partner] = {
    "gymnasium-1.1": Partner(("gymnasium==1.1.1",), _GYMNASIUM, ("gymnasium",), ("gymnasium",)),
    "gymnasium": Partner(("gymnasium>=1.4",), _GYMNASIUM, ("gymnasium",), ("gymnasium",)),
    "gymnax-0.0.9": Partner(
        ("gymnax==0.0.9", "six"), ("test_gymnax.py",), ("gymnax",), ("gymnax",)
    ),
    "gymnax": Partner(("gymnax>=1.0.1", "six"), ("test_gymnax.py",), ("gymnax",), ("gymnax",)),
    "rejax": Partner(
        ("rejax>=0.1.3", "gymnax==0.0.9", "six"),
        ("test_gymnax.py",),
        ("gymnax", "rejax"),
        ("rejax", "gymnax", "flax"),
    ),
    "stoa": Partner(("stoa-env>=0.1.2",), ("test_stoa.py",), ("stoa",), ("stoa-env",)),
    "brax": Partner(("brax>=0.14", "jax<0.10"), ("test_brax.py",), ("brax",), ("brax", "flax")),
    "torch": Partner((_TORCH,), ("test_torch.py",), ("torch",), ("torch",), "3.11"),
    "sb3": Partner(
        (_TORCH, "stable-baselines3>=2.4"),
        ("test_sb3.py",),
        ("torch", "stable_baselines3"),
        ("stable-baselines3", "torch", "gymnasium"),
        "3.11",
    ),
}


def attempt(name: str, options: argparse.Namespace) -> Outcome:
    """Make the environment of a partner if need be, and run its tests there."""
    partner = PARTNERS[name]
    folder = options.folder.resolve() / name
    print(f"== {name}", flush=True)
    base = environments.find_python(partner.python)
    if base is None:
        wanted = f"python{partner.python or 3}"
        return Outcome(problem=f"it needs {wanted} with its venv module, which is not found here")
    requirements = (*TOOLS, *partner.requirements)
    package = ("--editable", ".")
    try:
        python, _ = environments.make(base, folder, package, requirements, fresh=options.fresh)
    except (subprocess.CalledProcessError, OSError) as error:
        return Outcome(problem=f"cannot be installed: {error}")
    arguments = [f"{TESTS}/{test}" for test in partner.tests]
    arguments += ["-k", options.k] if options.k else []
    report, modules, shown = folder / "report.xml", partner.modules, partner.shown
    return environments.run_tests(python, arguments, report, modules=modules, shown=shown)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what the command line names; 1 if anything failed."""
    options = _parser().parse_args(arguments)
    names = options.names or list(PARTNERS)
    unknown = [name for name in names if name not in PARTNERS]
    if unknown:
        print(f"unknown: {', '.join(unknown)}; known: {', '.join(PARTNERS)}", file=sys.stderr)
        return 2
    if options.list:
        for name in names:
            print(f"{name:14} {' '.join(PARTNERS[name].requirements)}")
        return 0
    outcomes = {name: attempt(name, options) for name in names}
    print(environments.table("partner", outcomes))
    return int(any(outcome.problem for outcome in outcomes.values()))


def _parser() -> argparse.ArgumentParser:
    summary = (__doc__ or "").split("\n\n")
    parser = argparse.ArgumentParser(
        prog="python -m reliability.partners", description=summary[0], epilog=summary[2]
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="which ones (default: all)")
    parser.add_argument("--list", action="store_true", help="print the names and requirements")
    parser.add_argument("--fresh", action="store_true", help="make the environments anew")
    parser.add_argument(
        "--folder", type=Path, default=FOLDER, help="where they are (default: .venv-partners)"
    )
    parser.add_argument("-k", metavar="EXPRESSION", help="run only the tests that pytest -k picks")
    return parser


if __name__ == "__main__":
    sys.exit(main())
