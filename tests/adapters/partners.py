"""Run the adapters' tests beside the real partner packages, each set in an environment of its own.

    python tests/adapters/partners.py                 all of them
    python tests/adapters/partners.py gymnax rejax    some of them
    python tests/adapters/partners.py --list          the table

Partners exclude each other: gymnax 1.x sets upper limits on JAX and Gymnasium, and rejax needs
gymnax 0.0.9. So each name of `PARTNERS` gets a virtual environment, made once in a folder that git
ignores and brought up to date with `--fresh`. A test that is skipped because its partner cannot
be imported there counts as a failure; so does a partner whose tests all are skipped.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / ".venv-partners"


@dataclass(frozen=True)
class Partner:
    """One environment.

    Attributes:
        requirements: what pip installs beside this package and pytest.
        tests: files in this folder.
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


@dataclass(frozen=True)
class Outcome:
    """What came of one partner; `problem` is "" where all is well."""

    versions: str = ""
    passed: int = 0
    skipped: int = 0
    seconds: float = 0.0
    problem: str = ""


def main(arguments: list[str] | None = None) -> int:
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
    outcomes = {name: _try(name, options) for name in names}
    print(_table(outcomes))
    return int(any(outcome.problem for outcome in outcomes.values()))


def _parser() -> argparse.ArgumentParser:
    summary = (__doc__ or "").split("\n\n")
    parser = argparse.ArgumentParser(description=summary[0], epilog=summary[2])
    parser.add_argument("names", nargs="*", metavar="NAME", help="which ones (default: all)")
    parser.add_argument("--list", action="store_true", help="print the names and requirements")
    parser.add_argument("--fresh", action="store_true", help="make the environments anew")
    parser.add_argument(
        "--folder", type=Path, default=FOLDER, help="where they are (default: .venv-partners)"
    )
    parser.add_argument("-k", metavar="EXPRESSION", help="run only the tests that pytest -k picks")
    return parser


def _try(name: str, options: argparse.Namespace) -> Outcome:
    """Make the environment of a partner if need be and run its tests there."""
    partner = PARTNERS[name]
    folder = options.folder.resolve() / name
    print(f"== {name}", flush=True)
    try:
        python = _environment(partner, folder, fresh=options.fresh)
    except (subprocess.CalledProcessError, OSError, LookupError) as error:
        return Outcome(problem=f"cannot be installed: {error}")
    report = folder / "report.xml"
    report.unlink(missing_ok=True)
    command = [python, "-m", "pytest", "-q", "-rs", f"--junit-xml={report}"]
    command += [f"tests/adapters/{test}" for test in partner.tests]
    command += ["-k", options.k] if options.k else []
    status = subprocess.run(command, cwd=ROOT, env=_clean_environment()).returncode
    return _judge(partner, _versions(python, partner), report, status)


def _environment(partner: Partner, folder: Path, *, fresh: bool) -> str:
    """The interpreter of an environment that has all requirements."""
    stamp = folder / "requirements.txt"
    # The file doubles as the record of what was installed, so changed requirements make it anew.
    wanted = "\n".join(("pytest>=8.3", "hypothesis>=6.130", *partner.requirements)) + "\n"
    python = str(folder / "bin" / "python")
    if not fresh and stamp.is_file() and stamp.read_text() == wanted:
        return python
    shutil.rmtree(folder, ignore_errors=True)
    subprocess.run([_base_python(partner.python), "-m", "venv", str(folder)], check=True)
    pip = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    subprocess.run(
        [*pip, "--editable", ".", *wanted.split()], cwd=ROOT, check=True, env=_clean_environment()
    )
    stamp.write_text(wanted)
    return python


def _base_python(version: str | None) -> str:
    """This interpreter, or one of the version asked for."""
    if version in (None, f"{sys.version_info.major}.{sys.version_info.minor}"):
        return sys.executable
    found = shutil.which(f"python{version}")
    # A shim on the path need not run anything.
    if found and subprocess.run([found, "-c", ""], capture_output=True).returncode == 0:
        return found
    raise LookupError(f"it needs python{version} on the path, or to be run with it")


def _clean_environment() -> dict[str, str]:
    return {
        key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "VIRTUAL_ENV")
    }


def _versions(python: str, partner: Partner) -> str:
    """Python's version and those of JAX and the partner."""
    code = (
        "import sys, json, platform, importlib.metadata as m\n"
        "print(json.dumps([platform.python_version(), *map(m.version, sys.argv[1:])]))"
    )
    shown = ("jax", *partner.shown)
    done = subprocess.run([python, "-c", code, *shown], capture_output=True, text=True)
    if done.returncode:
        return "?"
    return ", ".join(
        f"{name} {version}"
        for name, version in zip(("Python", *shown), json.loads(done.stdout), strict=True)
    )


def _judge(partner: Partner, versions: str, report: Path, status: int) -> Outcome:
    """Read pytest's report."""
    if not report.is_file():
        return Outcome(versions, problem=f"pytest made no report (exit status {status})")
    suites = list(ElementTree.parse(report).getroot().iter("testsuite"))
    total, wrong, skipped = (
        sum(sum(int(suite.get(name, 0)) for name in names) for suite in suites)
        for names in (("tests",), ("failures", "errors"), ("skipped",))
    )
    reasons = [skip.get("message", "") for suite in suites for skip in suite.iter("skipped")]
    missing = [
        module
        for module in partner.modules
        if any(f"could not import '{module}" in reason for reason in reasons)
    ]
    passed = total - wrong - skipped
    problem = ""
    if missing:
        problem = f"cannot be imported: {', '.join(missing)}"
    elif wrong or status:
        problem = f"{wrong} failed (pytest's exit status {status})"
    elif not passed:
        problem = "no test ran"
    seconds = sum(float(suite.get("time", 0)) for suite in suites)
    return Outcome(versions, passed, skipped, seconds, problem)


def _table(outcomes: dict[str, Outcome]) -> str:
    """The outcomes as a table of Markdown."""
    lines = ["| partner | versions | passed | skipped | s | |", "|---|---|---:|---:|---:|---|"]
    for name, out in outcomes.items():
        cells = name, out.versions, out.passed, out.skipped, f"{out.seconds:.0f}"
        lines.append(f"| {' | '.join(map(str, cells))} | {out.problem or 'ok'} |")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
