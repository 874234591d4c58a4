"""Training beside ViZDoom, with stand-ins for both programs: rows, failures, going on, the page."""

import json
import os
import re
import sys
import time
from pathlib import Path

import pytest

from benchmarks.report.pages import Pages
from benchmarks.report.results import read_results
from benchmarks.suites.peers import PEERS, Found, _usual
from benchmarks.suites.processes import family, memory
from benchmarks.training import OURS, THEIRS, compare
from jaxenstein.files import OutputError
from tests.benchmarks.test_report import results

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")


@pytest.fixture
def fake(monkeypatch, tmp_path):
    """Both sides are the stand-in; ours always makes 10 steps a second an environment."""
    theirs = f"import runpy; runpy.run_path({str(Path(__file__).with_name('fake_trainer.py'))!r})"
    ours = "import os; os.environ['FAKE_TRAINER'] = 'rate-10'; " + theirs
    for side, code in ((OURS, ours), (THEIRS, theirs)):
        module = tmp_path / "fake_programs" / f"{side}_fake.py"
        module.parent.mkdir(exist_ok=True)
        module.write_text(code)
        monkeypatch.setitem(compare.PROGRAMS, side, [module.stem])
    monkeypatch.setattr(compare, "ROOT", module.parent)
    monkeypatch.setattr(compare, "find", lambda *_: Found(sys.executable))
    monkeypatch.setenv("FAKE_CHILD", str(tmp_path / "child"))
    monkeypatch.setenv("FAKE_TRAINER", "rate-5")


def measured(tmp_path, *words):
    file = tmp_path / "training-compare.json"
    compare.main(["--json", str(file), *words])
    return json.loads(file.read_text())


def test_both_sides_and_the_table(fake, tmp_path, capsys):
    report = measured(tmp_path, "--envs", "4", "2", "--seconds", "1")
    assert [row["envs"] for row in report["rows"]] == [2, 4]
    for row in report["rows"]:
        for side, rate in ((OURS, 20), (THEIRS, 10)):
            assert row["sides"][side]["steps_per_second"]["median"] == rate * row["envs"]
    assert "| 4 | 80 | 40 | 2.00 | 1.50 | 0.50 | 4 | 4 |" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("what", "reason"),
    [
        ("dies", r"exit status 1 \(it said last: no such scenario\)"),
        ("silent", "exit status 3$"),
        ("killed", "ended by SIGKILL"),
        ("odd", "it told no rates|exit status 0"),
    ],
)
def test_a_failure_is_a_row_with_its_reason(fake, tmp_path, monkeypatch, capsys, what, reason):
    monkeypatch.setenv("FAKE_TRAINER", f"4:rate-5,8:{what},16:rate-5")
    rows = measured(tmp_path, "--envs", "4", "8", "16")["rows"]
    assert ["failed" in row["sides"][THEIRS] for row in rows] == [False, True, False]
    assert not any("failed" in row["sides"][OURS] for row in rows)
    assert re.search(reason, rows[1]["sides"][THEIRS]["failed"])
    assert "| 8 | 160 | failed |" in capsys.readouterr().out


@LINUX
def test_what_hangs_is_ended_with_its_children_and_segments(fake, tmp_path, monkeypatch):
    monkeypatch.setattr(compare, "SEGMENTS", tmp_path)
    for name in ("ViZDoomSMabc", "ViZDoomMQCtrabc", "ViZDoomSMother"):
        (tmp_path / name).touch()
    monkeypatch.setenv("FAKE_TRAINER", "hangs")
    began = time.monotonic()
    found = measured(tmp_path, "--envs", "8", "--limit", "3")["rows"][0]["sides"][THEIRS]
    assert found["failed"].startswith("no result within 3 s")
    assert time.monotonic() - began < 30
    child = Path("/proc") / (tmp_path / "child").read_text() / "stat"
    # A zombie that nobody has asked for its status yet has ended too.
    assert not child.exists() or child.read_text().rpartition(")")[2].split()[0] in "ZX"
    assert [path.name for path in tmp_path.glob("ViZDoom*")] == ["ViZDoomSMother"]


def test_the_same_command_goes_on(fake, tmp_path, monkeypatch):
    before = measured(tmp_path, "--envs", "4", "8")["rows"]
    monkeypatch.setenv("FAKE_TRAINER", "rate-7")
    after = measured(tmp_path, "--envs", "4", "8", "12")["rows"]
    assert after[:2] == before
    assert after[2]["sides"][THEIRS]["rates"][0] == 84
    with pytest.raises(OutputError, match="measured with rollout 128, not 16"):
        measured(tmp_path, "--envs", "4", "--rollout", "16")
    again = measured(tmp_path, "--envs", "4", "--again")["rows"]
    assert [row["sides"][THEIRS]["rates"][0] for row in again] == [28]


def test_a_missing_peer_is_looked_for_again(fake, tmp_path, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(compare, "find", lambda *_: Found(problem="not installed"))
        row = measured(tmp_path, "--envs", "4")["rows"][0]
    assert row["sides"][THEIRS]["failed"] == "not installed"
    assert "rates" in measured(tmp_path, "--envs", "4")["rows"][0]["sides"][THEIRS]


@pytest.mark.parametrize(
    "words",
    [["--envs", "0"], ["--envs", "6"], ["--seconds", "nan"], ["--rollout", "0"], ["--limit", "-1"]],
)
def test_bad_arguments(tmp_path, words, capsys):
    with pytest.raises(SystemExit, match="2"):
        compare.main(["--json", str(tmp_path / "f.json"), *words])
    assert f"error: {words[0]}: " in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_an_unwritable_file_is_told_before_the_work(fake, tmp_path):
    with pytest.raises(OutputError, match="no folder"):
        compare.main(["--json", str(tmp_path / "none" / "f.json")])


@LINUX
def test_memory_of_a_family():
    assert os.getpid() in family(os.getpid())
    assert (memory([os.getpid()]) or 0) > 2**20
    assert memory([2**30]) is None


def test_the_page(fake, tmp_path, monkeypatch):
    monkeypatch.setenv("FAKE_TRAINER", "64:rate-5,128:dies,256:rate-5")
    measured(tmp_path, "--envs", "64", "128", "256")
    results(tmp_path, parts=["observations"])
    pages = Pages(read_results(tmp_path), tmp_path, ["training"]).write()
    text = pages["benchmarks/training.md"]
    assert "| 64 | 1,280 | 640 | 2.00 |" in text
    assert "| 128 | 2,560 | failed |  |" in text
    assert "- RecurrentPPO, ViZDoom, 128: exit status 1" in text
    assert "here it failed with 128; it trained with 256 environments." in text
    assert "](../images/benchmarks/training.png)" in text
    assert "training-compare.json --envs 64 128 256" in text
    assert "123 parameters, on cpu, python 3" in text


def test_the_peer_is_installed_only_where_it_is_named():
    assert "training" in PEERS
    for quick in (False, True):
        assert "training" not in _usual(quick)
