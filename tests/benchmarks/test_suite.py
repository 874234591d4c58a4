"""The parts of the suite, and the command that measures them, with stand-ins for the subjects."""

import importlib
import json
import re
from pathlib import Path

import pytest

import benchmarks.__main__ as suite
from benchmarks import measure
from benchmarks.install import PEERS
from benchmarks.measure import Settings, Subject, SubjectError, Worker, measure_group
from benchmarks.parts import PARTS, QUICK, Plan
from benchmarks.subjects.__main__ import MODULES
from jaxenstein.catalogue import MAIN_IDS
from jaxenstein.files import OutputError

PARTLY = [Subject("broken", "none", flags=None), Subject("steady-7", "seven")]


@pytest.fixture
def small(monkeypatch):
    """A suite of two parts, whose subjects are stand-ins."""
    program = (str(Path(__file__).with_name("fake_subject.py")),)
    monkeypatch.setattr(measure, "PROGRAM", program)
    parts = {"first": lambda plan: [[Subject("steady-5", "five")]], "second": lambda plan: [PARTLY]}
    monkeypatch.setattr(suite, "PARTS", parts)
    monkeypatch.setattr(suite, "table_of", lambda name, rows: name)


@pytest.mark.parametrize("plan", [Plan(), QUICK], ids=["full", "quick"])
def test_groups_are_complete(plan):
    kinds = set()
    for group in (group for part in PARTS.values() for group in part(plan)):
        names = [subject.name for subject in group]
        assert len(set(names)) == len(names)
        for subject in group:
            assert set(subject.references.values()) <= set(names)
            assert subject.peer in ("", *PEERS)
            # A subject that does not need this project runs under the interpreter of a peer.
            assert subject.flags is not None or subject.peer
        kinds |= {re.sub(r"-\d+$", "", name.split()[0]) for name in names}
    assert len(kinds) > 6
    for kind in kinds:
        module = MODULES.get(kind.partition("-")[0], "own")
        assert kind in importlib.import_module(f"benchmarks.subjects.{module}").SUBJECTS


def test_every_environment_is_measured():
    names = {row.name for group in PARTS["environments"](Plan()) for row in group}
    assert {f"scan-256 id={name}" for name in MAIN_IDS} <= names


def test_failure_is_recorded_and_others_still_run(small):
    subjects = [
        Subject("steady-50", "steady"),
        *PARTLY,
        Subject("dies", "ends"),
        Subject("never", "not installed", peer="training"),
    ]
    rows = {row["name"]: row for row in measure_group(subjects, Settings(None, 3, 0.01))}
    assert rows["steady-50"]["steps_per_second"]["repeats"] == pytest.approx([50] * 3)
    assert rows["steady-7"]["steps_per_second"]["median"] == pytest.approx(7)
    assert "No module named 'nothing' (exit status 1)" in rows["broken"]["failed"]
    assert "the game crashed" in rows["dies"]["failed"]
    assert "failed" in rows["never"]


def test_subjects_do_not_use_the_cache_of_the_caller(small, monkeypatch):
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", "somewhere")
    monkeypatch.setenv("JAX_PLATFORMS", "cuda")
    worker = Worker(Subject("steady-5", ""), None)
    worker.close()
    assert worker.description["notes"] == {"JAX_PLATFORMS": "cpu"}


def test_hanging_subject_times_out(small, monkeypatch):
    monkeypatch.setattr(measure, "LIMIT", 0.5)
    with pytest.raises(SubjectError, match=r"no answer within 0\.5 s"):
        Worker(Subject("hangs", ""), None)


def test_subject_stuck_in_a_chunk_times_out(small, monkeypatch):
    worker = Worker(Subject("stuck", ""), None)
    monkeypatch.setattr(measure, "LIMIT", 0.5)
    try:
        with pytest.raises(SubjectError, match=r"no answer within 0\.5 s"):
            worker.measure(1)
    finally:
        worker.close()


def run(folder, *words):
    suite.main([*words, "--json", str(folder), "--rounds", "1", "--seconds", "0.01"])


def test_each_part_has_a_file_and_can_resume(small, tmp_path, capsys):
    folder = tmp_path / "deep" / "results"
    run(folder, "first")
    report = json.loads((folder / "first.json").read_text())
    assert report["part"] == "first"
    before = (folder / "first.json").stat().st_mtime_ns
    run(folder)
    assert (folder / "first.json").stat().st_mtime_ns == before
    assert "first.json already exists" in (told := capsys.readouterr().out)
    assert "none: ImportError: No module named 'nothing'" in told
    with pytest.raises(OutputError, match=r"settings .*choose another folder"):
        suite.main(["first", "--json", str(folder), "--rounds", "2"])
    (folder / "first.json").write_text("{}")
    with pytest.raises(OutputError, match="is not a result of this command"):
        run(folder)


def test_parts_without_a_chosen_subject_have_no_file(small, tmp_path):
    run(tmp_path, "--only", "steady-7")
    assert [path.name for path in tmp_path.iterdir()] == ["second.json"]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["thirst"], "unknown part: thirst"),
        (["first", "--core", "9999"], "not 9999"),
        (["first", "--only", "steady", "swift"], "starts with 'swift'; there are 'steady-5'"),
        (["first", "--seconds", "0"], "must be a finite number above 0, not 0"),
    ],
)
def test_wrong_arguments(small, capsys, words, told):
    with pytest.raises(SystemExit):
        suite.main(words)
    assert told in capsys.readouterr().err
