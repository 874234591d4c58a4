"""Processes measured in turn, with stand-ins for the subjects."""

import tempfile
import time
from pathlib import Path

import pytest

from benchmarks.suites import worker as workers_of
from benchmarks.suites.measure import Settings, Subject, measure_group
from benchmarks.suites.peers import Found
from benchmarks.suites.worker import SubjectError, Worker, run_rounds

SETTINGS = Settings(core=None, rounds=3, seconds=0.01)


def worker(name, python=""):
    return Worker(name, python, None, flags=None)


def test_rates_of_each_round_but_the_first(fake_subjects):
    workers = {name: worker(name) for name in ("steady-100", "steady-300")}
    try:
        rates = run_rounds(workers, 3, 0.01, {})
    finally:
        for each in workers.values():
            each.close()
    assert rates["steady-100"] == pytest.approx([100] * 3)
    assert rates["steady-300"] == pytest.approx([300] * 3)
    for each in workers.values():
        assert each._process.poll() is not None
        assert not Path(each._folder.name).exists()


def test_a_subject_that_does_not_start_says_why(fake_subjects, tmp_path):
    with pytest.raises(SubjectError, match=r"No module named 'nothing'.*exit status 1"):
        worker("broken")
    with pytest.raises(SubjectError, match="python does not run"):
        worker("steady-1", str(tmp_path / "python"))


def test_a_subject_that_hangs_is_given_up(fake_subjects, monkeypatch):
    monkeypatch.setattr(workers_of, "START_LIMIT", 0.3)
    began = time.monotonic()
    with pytest.raises(SubjectError, match=r"no answer within 0\.3 s"):
        worker("hangs")
    assert time.monotonic() - began < 10
    monkeypatch.setattr(workers_of, "START_LIMIT", 60.0)
    monkeypatch.setattr(workers_of, "CHUNK_LIMIT", 0.3)
    stuck = worker("stuck")
    with pytest.raises(SubjectError, match="no answer"):
        stuck.measure(0.001)
    assert stuck._process.poll() is not None
    stuck.close()


def test_what_fails_is_noted_and_stops_no_other(fake_subjects):
    subjects = [
        Subject("steady-50", "steady", references={"x": "steady-50"}),
        Subject("broken", "not started", flags=None),
        Subject("dies", "ends"),
        Subject("never", "not installed", peer="nobody"),
        Subject("steady-70", "steady too", axes={"batch": 70}),
    ]
    rows = {
        row["name"]: row
        for row in measure_group(subjects, SETTINGS, lambda name: Found(problem="no wheel"))
    }
    assert list(rows) == [subject.name for subject in subjects]
    assert rows["steady-50"]["steps_per_second"]["repeats"] == pytest.approx([50] * 3)
    assert rows["steady-70"]["steps_per_second"]["median"] == pytest.approx(70)
    assert rows["steady-70"]["axes"] == {"batch": 70}
    assert "No module named 'nothing'" in rows["broken"]["failed"]
    assert "the game crashed" in rows["dies"]["failed"]
    assert rows["never"]["failed"] == "no wheel"
    assert all("failed" not in rows[name] for name in ("steady-50", "steady-70"))


def test_reasons_name_no_folder_of_this_machine(fake_subjects, tmp_path, monkeypatch):
    script = tmp_path / "script.py"
    script.write_text("import os\nraise RuntimeError('in ' + os.getcwd() + '/x')")
    monkeypatch.setattr(workers_of, "PROGRAM", (str(script),))
    with pytest.raises(SubjectError, match="RuntimeError: in /x") as caught:
        worker("any")
    assert tempfile.gettempdir() not in str(caught.value)
