"""The environments of lanes and partners: how they are found and made, and how a run is judged."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from reliability import environments, partners
from reliability.environments import Outcome

PASSED = '<testcase name="a"/>'
FAILED = '<testcase name="b"><failure message="no"/></testcase>'
GYMNAX = '<testcase name="c"><skipped message="could not import \'gymnax\': No module"/></testcase>'
REJAX = '<testcase name="d"><skipped message="could not import \'rejax\': No module"/></testcase>'


def judge(folder: Path, *cases: str, modules: tuple[str, ...] = ("gymnax",)) -> Outcome:
    report = folder / "report.xml"
    counts = {
        "tests": len(cases),
        "failures": sum("<failure" in case for case in cases),
        "errors": 0,
        "skipped": sum("<skipped" in case for case in cases),
    }
    attributes = " ".join(f'{name}="{count}"' for name, count in counts.items())
    report.write_text(
        f'<testsuites><testsuite {attributes} time="1.5">{"".join(cases)}</testsuite></testsuites>'
    )
    return environments.judge(modules, "gymnax 1", report, int(counts["failures"] > 0))


def test_outcomes(tmp_path: Path) -> None:
    good = judge(tmp_path, PASSED, PASSED)
    assert good == Outcome("gymnax 1", 2, 0, 1.5, "")
    # Skipped for want of what this environment is not about.
    assert judge(tmp_path, PASSED, REJAX).problem == ""
    assert "gymnax" in judge(tmp_path, PASSED, GYMNAX).problem
    assert "rejax" in judge(tmp_path, PASSED, REJAX, modules=("gymnax", "rejax")).problem
    assert judge(tmp_path, PASSED, FAILED).problem.startswith("1 failed")
    assert judge(tmp_path, REJAX).problem == "no test ran"
    assert judge(tmp_path).problem == "no test ran"
    nothing = environments.judge(("stoa",), "", tmp_path / "none.xml", 4)
    assert "no report" in nothing.problem
    table = environments.table("partner", {"stoa": good, "brax": nothing})
    assert "| stoa | gymnax 1 | 2 | 0 | 2 | ok |" in table


def test_the_table_of_partners_names_files_that_exist() -> None:
    folder = environments.ROOT / partners.TESTS
    for partner in partners.PARTNERS.values():
        assert partner.requirements
        assert all((folder / test).is_file() for test in partner.tests)


def test_unknown_names_and_versions(capsys: pytest.CaptureFixture[str]) -> None:
    assert partners.main(["gymnsium"]) == 2
    assert "gymnsium" in capsys.readouterr().err
    assert partners.main(["--list"]) == 0
    assert "gymnax==0.0.9" in capsys.readouterr().out


def test_this_python_is_found() -> None:
    version = "{}.{}".format(*sys.version_info)
    found = environments.find_python(version)
    assert found is not None
    code = "import sys; print('%d.%d' % sys.version_info[:2])"
    done = subprocess.run([found, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == version
    assert environments.find_python("2.7") is None
    assert environments.find_python() == sys.executable


def test_a_partner_without_its_python_is_a_problem(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr(environments, "find_python", lambda version: None)
    assert partners.main(["torch", "--folder", str(tmp_path)]) == 1
    assert "it needs python3.11" in capsys.readouterr().out
    assert not list(tmp_path.iterdir())


def test_an_environment_is_made_once_and_again_where_its_requirements_change(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    calls: list[list[str]] = []

    def called(command: list[str], *, quiet: bool = False) -> None:
        assert not quiet
        calls.append(command)
        if "venv" in command:
            Path(command[-1]).mkdir(parents=True)

    monkeypatch.setattr(environments, "call", called)
    folder = tmp_path / "lane"

    def make(*requirements: str, wheel: str = "a", fresh: bool = False) -> bool:
        package = (str(tmp_path / wheel / "jaxenstein.whl"),)
        python, new = environments.make("python", folder, package, requirements, fresh=fresh)
        assert python == str(folder / "bin" / "python")
        return new

    assert make("jax == 0.7")
    assert calls[0][:3] == ["python", "-m", "venv"]
    assert calls[1][-2:] == [str(tmp_path / "a" / "jaxenstein.whl"), "jax == 0.7"]
    # Where the wheel lies is no requirement.
    assert not make("jax == 0.7", wheel="b")
    assert len(calls) == 2
    assert make("jax == 0.8")
    assert make("jax == 0.8", fresh=True)

    def failing(command: list[str], *, quiet: bool = False) -> None:
        raise subprocess.CalledProcessError(1, command)

    monkeypatch.setattr(environments, "call", failing)
    for _ in range(2):  # What was not finished is not taken for done.
        with pytest.raises(subprocess.CalledProcessError):
            make("jax == 0.9")
