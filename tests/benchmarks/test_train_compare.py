"""Training beside ViZDoom, with a stand-in for both programs: rows, failures, going on."""

import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

from benchmarks import plots, report_training, train_compare, train_limits, train_processes
from benchmarks.peers import PEERS, Found, _usual
from benchmarks.report_others import other_sections
from benchmarks.report_training import OURS, PART, THEIRS, claim, read_comparison
from benchmarks.train_limits import limits, misfit
from jaxenstein.errors import SettingError
from jaxenstein.files import OutputError

FAKE = Path(__file__).with_name("fake_trainer.py")
LINUX = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
SETTINGS = {"rollout": 128, "seconds": 1.0, "limit": 30.0, "vector": "auto"}


@pytest.fixture
def fake(monkeypatch, tmp_path):
    """Both sides are the stand-in; ours always makes 10 steps a second an environment."""
    monkeypatch.setattr(train_compare, "SCRIPT", FAKE)
    monkeypatch.setattr(train_compare, "find", lambda *_: Found(sys.executable))
    ours = dict(os.environ) | {"FAKE_TRAINER": "rate-10"}
    monkeypatch.setattr(
        train_compare, "_own", lambda number, settings: train_compare.run(
            [sys.executable, str(FAKE)], ours, number, settings)
    )  # fmt: skip
    monkeypatch.setenv("FAKE_CHILD", str(tmp_path / "child"))
    monkeypatch.setenv("FAKE_TRAINER", "rate-5")


def measured(tmp_path, *words):
    file = tmp_path / "training-compare.json"
    train_compare.main(["--json", str(file), *words])
    return json.loads(file.read_text())


def theirs(tmp_path, monkeypatch, what, *words):
    monkeypatch.setenv("FAKE_TRAINER", what)
    return measured(tmp_path, "--envs", "8", *words)["rows"][0]["sides"][THEIRS]


def test_both_sides_and_the_table(fake, tmp_path, capsys):
    report = measured(tmp_path, "--envs", "4", "2", "--seconds", "1")
    assert [row["envs"] for row in report["rows"]] == [2, 4]
    for row in report["rows"]:
        for side, rate in ((OURS, 20), (THEIRS, 10)):
            found = row["sides"][side]
            assert found["envs"] == row["envs"]
            assert found["steps_per_second"]["median"] == rate * row["envs"]
            assert set(row["limits"][side]) == set(limits())
    out = capsys.readouterr().out
    assert "| 4 | 80 | 40 | 2.00 | 1.50 | 0.50 | 1,028 | 1,028 |" in out


@pytest.mark.parametrize(
    ("what", "reason"),
    [
        ("fails", r"EOFError: no message, while training \(it said last: the engine crashed\)"),
        ("dies", r"exit status 1 \(it said last: no such scenario\)"),
        ("silent", "exit status 3$"),
        ("killed", "ended by SIGKILL"),
        ("odd", "it told no rates"),
    ],
)
def test_a_failure_is_a_row_with_its_reason(fake, tmp_path, monkeypatch, capsys, what, reason):
    found = theirs(tmp_path, monkeypatch, what)
    assert "steps_per_second" not in found
    assert re.search(reason, found["failed"])
    out = capsys.readouterr().out
    assert "| 8 | 160 | failed |" in out
    assert "- RecurrentPPO, ViZDoom, 8: " in out


@LINUX
def test_what_hangs_is_ended_with_its_children(fake, tmp_path, monkeypatch):
    began = time.monotonic()
    found = theirs(tmp_path, monkeypatch, "hangs", "--limit", "2")
    assert found["failed"].startswith("no result within 2 s")
    assert time.monotonic() - began < 30
    child = int((tmp_path / "child").read_text())
    assert not train_processes._runs(child)


def test_a_failure_is_not_the_end(fake, tmp_path, monkeypatch):
    monkeypatch.setenv("FAKE_TRAINER", "4:rate-5,8:dies,16:rate-5")
    rows = measured(tmp_path, "--envs", "4", "8", "16")["rows"]
    assert ["failed" in row["sides"][THEIRS] for row in rows] == [False, True, False]
    assert not any("failed" in row["sides"][OURS] for row in rows)


def test_the_same_command_goes_on(fake, tmp_path, monkeypatch):
    before = measured(tmp_path, "--envs", "4", "8")["rows"]
    monkeypatch.setenv("FAKE_TRAINER", "rate-7")
    after = measured(tmp_path, "--envs", "4", "8", "12")["rows"]
    assert after[:2] == before
    assert after[2]["sides"][THEIRS]["rates"][0] == 84
    with pytest.raises(OutputError, match=r"measured with rollout 128, not 16; .*--again"):
        measured(tmp_path, "--envs", "4", "--rollout", "16")
    again = measured(tmp_path, "--envs", "4", "--again")["rows"]
    assert [row["sides"][THEIRS]["rates"][0] for row in again] == [28]
    (tmp_path / "training-compare.json").write_text("{}")
    with pytest.raises(OutputError, match="no result of this command"):
        measured(tmp_path, "--envs", "4")


def test_a_missing_peer_is_looked_for_again(fake, tmp_path, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(train_compare, "find", lambda *_: Found(problem="not installed"))
        row = measured(tmp_path, "--envs", "4")["rows"][0]
    assert row["sides"][THEIRS]["failed"] == "not installed"
    assert "rates" in measured(tmp_path, "--envs", "4")["rows"][0]["sides"][THEIRS]


def test_a_program_that_cannot_be_run(tmp_path):
    found = train_compare.run([str(tmp_path / "python")], {}, 2, SETTINGS)
    assert found == {"envs": 2, "failed": "python does not run: No such file or directory"}


@pytest.mark.parametrize(
    "words",
    [["--envs", "0"], ["--envs", "6"], ["--seconds", "nan"], ["--rollout", "0"], ["--limit", "-1"]],
)
def test_bad_arguments(tmp_path, words, capsys):
    with pytest.raises(SystemExit, match="2"):
        train_compare.main(["--json", str(tmp_path / "f.json"), *words])
    assert f"error: {words[0]}: " in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_an_unwritable_file_is_told_before_the_work(fake, tmp_path):
    with pytest.raises(OutputError, match="no folder"):
        train_compare.main(["--json", str(tmp_path / "none" / "f.json")])


def test_what_cannot_fit_is_not_tried(fake, tmp_path, monkeypatch):
    free = dict.fromkeys(limits()) | {"memory_free_bytes": 2**30 + 7 * 2**20}
    monkeypatch.setattr(train_compare, "limits", lambda: free)
    rows = measured(tmp_path, "--envs", "4", "8")["rows"]
    for side in (OURS, THEIRS):
        assert "rates" in rows[0]["sides"][side]
        assert rows[1]["sides"][side]["failed"].startswith("not tried: going by 4 environments")


def test_memory_grows_with_the_number_above_what_was_there():
    last = {"envs": 4, "rates": [1.0], "base_bytes": 1000, "memory_bytes": 1400}
    last["shared_memory_bytes"] = 40
    free = {"memory_free_bytes": 1800, "shared_memory_free_bytes": 80}
    assert not misfit(8, [last], free)
    assert "of memory" in misfit(8, [last], free | {"memory_free_bytes": 1799})
    assert "of shared memory" in misfit(8, [last], free | {"shared_memory_free_bytes": 79})
    # Nothing is known: it is tried.
    assert not misfit(8, [], free)
    assert not misfit(8, [{"envs": 4, "failed": "it crashed"}], free)
    assert not misfit(8, [last], dict.fromkeys(free))


def test_the_least_of_machine_and_container_is_free(tmp_path, monkeypatch):
    monkeypatch.setattr(train_limits, "GROUP", tmp_path)
    everything = train_limits.memory_free()
    (tmp_path / "memory.max").write_text("5000\n")
    (tmp_path / "memory.current").write_text("4000\n")
    (tmp_path / "memory.stat").write_text("anon 100\ninactive_file 500\n")
    assert train_limits.memory_free() == 1500
    (tmp_path / "memory.max").write_text("max\n")
    assert (train_limits.memory_free() is None) == (everything is None)


@LINUX
def test_an_engine_leaves_no_segments(tmp_path, monkeypatch):
    monkeypatch.setattr(train_processes, "SHARED_MEMORY", tmp_path)
    for name in ("ViZDoomSMabc", "ViZDoomMQCtrabc", "ViZDoomSMother"):
        (tmp_path / name).touch()
    engine = subprocess.Popen(
        [sys.executable, "-c", "import time; time.sleep(60)", "+viz_instance_id", "abc"],
        cwd=tmp_path,
    )
    try:
        while not train_processes.engine_of(engine.pid):
            time.sleep(0.01)
        assert train_processes.inside(tmp_path) == [engine.pid]
        assert engine.pid in train_processes.family(os.getpid())
        assert (train_processes.memory([engine.pid])["memory_bytes"] or 0) > 2**20
        train_processes.end([engine.pid])
    finally:
        engine.kill()
        engine.wait()
    assert not train_processes._runs(engine.pid)
    assert [path.name for path in tmp_path.iterdir()] == ["ViZDoomSMother"]


def test_the_page_and_the_plot(fake, tmp_path, monkeypatch):
    monkeypatch.setenv("FAKE_TRAINER", "64:rate-5,128:fails,256:rate-5")
    measured(tmp_path, "--envs", "64", "128", "256")
    others = read_comparison(tmp_path)
    text = "\n\n".join(other_sections(others, "results", ["images/training.png"]))
    assert "| 64 | 1,280 | 640 | 2.00 |" in text
    assert "| 128 | 2,560 | failed |  |" in text
    assert "here it trained with 256; it failed with 128 environments." in text
    assert "ViZDoom](images/training.png)" in text
    assert "--envs 64 128 256 --json results/training-compare.json" in text
    assert "123 parameters, on cpu, 1 thread" in text
    pytest.importorskip("matplotlib")
    (name,) = plots.save_training_plot(others[PART]["rows"], tmp_path)
    assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")
    failed = [{"envs": 1, "sides": {side: {"failed": "no"} for side in (OURS, THEIRS)}}]
    assert plots.save_training_plot(failed, tmp_path) == []


def test_the_claim_is_told_as_it_was_found():
    def row(number, **found):
        return {"envs": number, "sides": {THEIRS: found}}

    assert claim([row(64)]).endswith("here that was not tried.")
    rows = [row(128, rates=[1]), row(192, failed="x"), row(256, failed="y", skipped=True)]
    told = "here it trained with 128; it failed with 192; it was not tried with 256 environments."
    assert claim(rows).endswith(told)


def test_files_of_something_else(tmp_path):
    assert read_comparison(tmp_path) == {}
    file = tmp_path / "training-compare.json"
    for text, said in (("{", "cannot be read"), ('{"part": "x", "format": 1, "rows": []}', "no")):
        file.write_text(text)
        with pytest.raises(SettingError, match=said):
            read_comparison(tmp_path)


def test_the_peer_is_installed_only_where_it_is_named():
    assert "training" in PEERS
    for quick in (False, True):
        assert "training" not in _usual(quick)
    assert SETTINGS["rollout"] == report_training.FULL_ROLLOUT
