"""The parts of the suite, and the command that runs them."""

import json
import sys
from dataclasses import replace

import pytest

import benchmarks.__main__ as suite
from benchmarks.suites import measure
from benchmarks.suites.measure import Subject
from benchmarks.suites.parts import PARTS
from benchmarks.suites.peers import PEERS
from benchmarks.suites.plan import QUICK, Plan
from jaxenstein.catalogue import MAIN_IDS
from jaxenstein.files import OutputError

FULL = Plan(cores=2)


@pytest.mark.parametrize("plan", [FULL, replace(QUICK, cores=2)], ids=["full", "quick"])
@pytest.mark.parametrize("name", PARTS)
def test_groups_are_complete(name, plan):
    groups = PARTS[name](plan)
    assert groups
    for group in groups:
        names = [subject.name for subject in group]
        assert len(set(names)) == len(names)
        for subject in group:
            assert set(subject.references.values()) <= set(names)
            assert subject.peer in ("", *PEERS)
            # What does without this project runs under the interpreter of a peer.
            assert subject.flags is not None or subject.peer


def test_every_environment_size_and_kind_is_measured():
    names = {s.name for part in PARTS.values() for group in part(FULL) for s in group}
    assert {f"scan-256 id={name}" for name in MAIN_IDS} <= names
    for batch in (1, 8, 64, 256, 1024, 4096):
        assert f"scan-{batch} id=my-way-home" in names
    for size in ("64x64", "84x84", "160x120", "320x240"):
        assert any(f"size={size}" in name and name.startswith("scan") for name in names)
    for kind in ("rgb", "gray", "depth", "labels", "dict"):
        assert f"scan-256 id=my-way-home observation={kind}" in names
    for skip in (1, 4):
        assert f"vizdoom-raw scenario=my-way-home frame_skip={skip}" in names
        assert f"scan-256 id=my-way-home frame_skip={skip}" in names


@pytest.fixture
def small(fake_subjects, monkeypatch):
    """A suite of two parts, whose subjects are stand-ins."""
    parts = {
        "first": lambda plan: [[Subject("steady-5", "five")]],
        "second": lambda plan: [[Subject("broken", "none"), Subject("steady-7", "seven")]],
    }
    monkeypatch.setattr(suite, "PARTS", parts)


def run(folder, *words):
    suite.main([*words, "--json", str(folder), "--rounds", "1", "--seconds", "0.01"])


def test_a_file_a_part_and_going_on(small, tmp_path, capsys):
    folder = tmp_path / "deep" / "results"
    run(folder, "first")
    report = json.loads((folder / "first.json").read_text())
    assert report["part"] == "first"
    assert report["settings"]["seconds"] == 0.01
    assert {"python", "jax", "jaxenstein"} <= set(report["versions"])
    assert report["hardware"]["cpu"]
    before = (folder / "first.json").stat().st_mtime_ns
    run(folder)
    assert (folder / "first.json").stat().st_mtime_ns == before
    assert "first.json is there already" in (told := capsys.readouterr().out)
    assert "none: ImportError: No module named 'nothing'" in told
    rows = json.loads((folder / "second.json").read_text())["groups"][0]
    assert rows[1]["steps_per_second"]["median"] == pytest.approx(7)
    run(folder, "first", "--again")
    assert (folder / "first.json").stat().st_mtime_ns != before


def test_other_settings_are_not_mixed_in(small, tmp_path):
    run(tmp_path, "first")
    with pytest.raises(OutputError, match=r"seconds 0\.01, not 0\.5"):
        suite.main(["--json", str(tmp_path), "--rounds", "1", "--seconds", "0.5"])
    assert not (tmp_path / "second.json").exists()
    (tmp_path / "first.json").write_text("{}")
    with pytest.raises(OutputError, match="no result of this command"):
        run(tmp_path)


def test_nothing_is_measured_that_cannot_be_written(small, tmp_path, monkeypatch):
    monkeypatch.setattr(measure, "measure_group", lambda *_: pytest.fail("measured"))
    (tmp_path / "second.json").mkdir()
    with pytest.raises(OutputError):
        run(tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError):
        run(tmp_path / "file")


def test_without_a_folder_it_is_only_shown(small, capsys):
    suite.main(["second", "--rounds", "1", "--seconds", "0.01"])
    assert "| seven | 7 |" in capsys.readouterr().out


def test_some_subjects_and_a_second_interpreter(small, capsys):
    words = ["--rounds", "1", "--seconds", "0.01", "--also-python", sys.executable]
    suite.main(["first", "second", "--only", "steady", *words])
    out = capsys.readouterr().out
    assert out.count("| seven, Python 3.") == out.count("| seven |") == 1
    assert "none" not in out


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["thirst"], "unknown part: thirst; known: first, second"),
        (["first", "--rounds", "0"], "above 0"),
        (["first", "--seconds", "x"], "above 0"),
        (["first", "--core", "9999"], "no core 9999"),
        (["first", "--also-python", "nowhere/python"], "nowhere/python does not run"),
    ],
)
def test_wrong_words(small, tmp_path, capsys, words, told):
    with pytest.raises(SystemExit):
        suite.main([*words, "--json", str(tmp_path)])
    assert told in capsys.readouterr().err
