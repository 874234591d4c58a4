"""What needs no partner: the error for a missing one, and how the script of partners judges."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import pytest

from tests.adapters import partners

PASSED = '<testcase name="a"/>'
FAILED = '<testcase name="b"><failure message="no"/></testcase>'
GYMNAX = '<testcase name="c"><skipped message="could not import \'gymnax\': No module"/></testcase>'
REJAX = '<testcase name="d"><skipped message="could not import \'rejax\': No module"/></testcase>'


@pytest.mark.parametrize(
    ("name", "partner", "needed"),
    [
        ("gymnax", "gymnax.environments", "gymnax"),
        ("stoa", "stoa", "stoa-env"),
        ("brax", "brax.envs", "brax"),
    ],
)
def test_a_missing_partner_is_named_with_its_extra(
    monkeypatch: pytest.MonkeyPatch, name: str, partner: str, needed: str
) -> None:
    monkeypatch.setitem(sys.modules, partner, None)
    monkeypatch.setitem(sys.modules, partner.split(".")[0], None)
    monkeypatch.delitem(sys.modules, f"jaxenstein.adapters.{name}", raising=False)
    with pytest.raises(ImportError, match=rf"needs {needed} .*pip install 'jaxenstein\[{name}\]'"):
        importlib.import_module(f"jaxenstein.adapters.{name}")


def judge(folder: Path, *cases: str, modules: tuple[str, ...] = ("gymnax",)) -> partners.Outcome:
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
    partner = partners.Partner((), (), modules, ())
    return partners._judge(partner, "gymnax 1", report, int(counts["failures"] > 0))


def test_outcomes(tmp_path: Path) -> None:
    good = judge(tmp_path, PASSED, PASSED)
    assert good == partners.Outcome("gymnax 1", 2, 0, 1.5, "")
    # Skipped for want of what this environment is not about.
    assert judge(tmp_path, PASSED, REJAX).problem == ""
    assert "gymnax" in judge(tmp_path, PASSED, GYMNAX).problem
    assert "rejax" in judge(tmp_path, PASSED, REJAX, modules=("gymnax", "rejax")).problem
    assert judge(tmp_path, PASSED, FAILED).problem.startswith("1 failed")
    assert judge(tmp_path, REJAX).problem == "no test ran"
    assert judge(tmp_path).problem == "no test ran"
    nothing = partners._judge(partners.PARTNERS["stoa"], "", tmp_path / "none.xml", 4)
    assert "no report" in nothing.problem
    table = partners._table({"stoa": good, "brax": nothing})
    assert "| stoa | gymnax 1 | 2 | 0 | 2 | ok |" in table


def test_the_table_of_partners_names_files_that_exist() -> None:
    folder = Path(partners.__file__).parent
    for partner in partners.PARTNERS.values():
        assert partner.requirements
        assert all((folder / test).is_file() for test in partner.tests)


def test_unknown_names_and_versions(capsys: pytest.CaptureFixture[str]) -> None:
    assert partners.main(["gymnsium"]) == 2
    assert "gymnsium" in capsys.readouterr().err
    assert partners.main(["--list"]) == 0
    assert "gymnax==0.0.9" in capsys.readouterr().out
    with pytest.raises(LookupError, match=r"python9\.9"):
        partners._base_python("9.9")
