"""Virtual environments in which the tests run beside other versions, and what came of them.

What `reliability.lanes` and `reliability.partners` share.
"""

from __future__ import annotations

import dataclasses
import json
import os
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TOOLS = ("pytest >= 8.3", "hypothesis >= 6.130", "pytest-xdist >= 3.6")


@dataclasses.dataclass(frozen=True)
class Outcome:
    """What came of the tests in one environment.

    Attributes:
        versions: of Python, JAX and others, as a text.
        passed: how many tests.
        skipped: how many tests.
        seconds: that the tests took.
        problem: what went wrong; "" where all is well.
        tried: whether the tests could run at all.
    """

    versions: str = ""
    passed: int = 0
    skipped: int = 0
    seconds: float = 0.0
    problem: str = ""
    tried: bool = True


def find_python(version: str | None = None) -> str | None:
    """An interpreter of a version that runs and can make virtual environments; None if none does.

    This one, or one on the path, or one in pyenv's folder.

    Args:
        version: such as "3.11"; None for any.
    """
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    known = sorted(map(str, pyenv.glob(f"{version}*/bin/python")), reverse=True)
    wanted = "import ensurepip, sys, venv"
    if version is not None:
        wanted += f"; sys.exit('%d.%d' % sys.version_info[:2] != {version!r})"
    for candidate in (sys.executable, shutil.which(f"python{version or 3}"), *known):
        # A shim on the path need not run anything.
        if candidate:
            done = subprocess.run([candidate, "-c", wanted], capture_output=True)
            if done.returncode == 0:
                return candidate
    return None


def make(
    base: str, folder: Path, package: Sequence[str], requirements: Sequence[str], *, fresh: bool
) -> tuple[str, bool]:
    """Make a virtual environment, unless it is there with the same requirements.

    Args:
        base: the interpreter to make it with.
        folder: where it is, or is to be.
        package: arguments of pip that install the package under test.
        requirements: what pip installs beside it.
        fresh: whether to make it anew in any case.

    Returns:
        Its interpreter, and whether it is new.

    Raises:
        subprocess.CalledProcessError: something cannot be installed.
    """
    stamp, python = folder / "requirements.txt", str(folder / "bin" / "python")
    # A wheel's name has a folder that differs each time; what it needs does not.
    wanted = "\n".join((*(part for part in package if os.sep not in part), *requirements)) + "\n"
    if not fresh and stamp.is_file() and stamp.read_text(encoding="utf-8") == wanted:
        return python, False
    shutil.rmtree(folder, ignore_errors=True)
    call([base, "-m", "venv", str(folder)])
    pip_install(python, *package, *requirements)
    # Last, so that an interrupted one is made again.
    stamp.write_text(wanted, encoding="utf-8")
    return python, True


def pip_install(python: str, *arguments: str) -> None:
    """Install into an environment, quietly."""
    pip = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    call([*pip, *arguments])


def call(command: Sequence[str], *, quiet: bool = False) -> None:
    """Run a command in the project's folder; `subprocess.CalledProcessError` if it fails."""
    subprocess.run(command, cwd=ROOT, check=True, env=variables(), capture_output=quiet)


def variables(**more: str) -> dict[str, str]:
    """The process's environment without what would lead another interpreter to our packages."""
    kept = {key: value for key, value in os.environ.items()
            if key not in ("PYTHONPATH", "VIRTUAL_ENV")}  # fmt: skip
    return {**kept, **more}


def run_tests(
    python: str,
    arguments: Sequence[str],
    report: Path,
    *,
    where: Path = ROOT,
    modules: Sequence[str] = (),
    shown: Sequence[str] = (),
    more: Mapping[str, str] | None = None,
) -> Outcome:
    """Run pytest in an environment.

    Args:
        python: the interpreter.
        arguments: of pytest.
        report: a file for what pytest reports; it is written anew.
        where: the folder to run in.
        modules: what must be importable; a test skipped for want of one of them is a failure.
        shown: distributions whose versions the outcome tells, beside JAX's.
        more: variables of the process's environment.
    """
    report.unlink(missing_ok=True)
    command = [python, "-m", "pytest", "-q", "-rs", f"--junit-xml={report}", *arguments]
    status = subprocess.run(command, cwd=where, env=variables(**(more or {}))).returncode
    return judge(modules, _versions(python, ("jax", *shown)), report, status)


def _versions(python: str, distributions: Sequence[str]) -> str:
    code = (
        "import sys, json, platform, importlib.metadata as m\n"
        "print(json.dumps([platform.python_version(), *map(m.version, sys.argv[1:])]))"
    )
    done = subprocess.run([python, "-c", code, *distributions], capture_output=True, text=True)
    if done.returncode:
        return "?"
    found = zip(("Python", *distributions), json.loads(done.stdout), strict=True)
    return ", ".join(f"{name} {version}" for name, version in found)


def judge(modules: Sequence[str], versions: str, report: Path, status: int) -> Outcome:
    """Read pytest's report.

    Args:
        modules: what must be importable.
        versions: for the outcome.
        report: the file; it need not be there.
        status: pytest's exit status.
    """
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
        for module in modules
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


def table(kind: str, outcomes: Mapping[str, Outcome]) -> str:
    """The outcomes as a table of Markdown.

    Args:
        kind: what the outcomes are of, such as "lane".
        outcomes: by name.
    """
    lines = [f"| {kind} | versions | passed | skipped | s | |", "|---|---|---:|---:|---:|---|"]
    for name, out in outcomes.items():
        cells = name, out.versions, out.passed, out.skipped, f"{out.seconds:.0f}"
        lines.append(f"| {' | '.join(map(str, cells))} | {out.problem or 'ok'} |")
    return "\n".join(lines)
