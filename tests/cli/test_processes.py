"""`jaxenstein train` in several processes, as on several machines."""

from __future__ import annotations

import json
import math
import shutil
import subprocess
from pathlib import Path

import pytest

pytest.importorskip("flax")

from jaxenstein.baselines.runs import processes
from jaxenstein.baselines.runs.folder import RunFolder
from jaxenstein.cli import main
from tests.baselines.tiny import UPDATES, same_checkpoints
from tests.cli.test_train import FLAGS
from tests.devices import free_port, started
from tests.docs.samples import ROOT, commands

# The command of the page, whose flags the tests then repeat with other values.
PAGE = commands(ROOT / "docs" / "devices.md")
(COMMAND,) = [words[1:] for words in PAGE if "--coordinator" in words]
RUN = "import sys; from jaxenstein.cli import main; sys.exit(main({}))"
# Process 1 gets a signal after some updates.
SIGNAL = """
import os, signal
from jaxenstein.baselines.runs import training
agree, calls = training.any_process, iter(range(9))
training.any_process = lambda *flags: (
    next(calls) == {} and os.kill(os.getpid(), signal.{}), agree(*flags)
)[1]
"""


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--coordinator 127.0.0.1:1 --processes 2", "together"),
        ("--processes 2 --process 0", "together"),
        ("--coordinator auto --processes 2 --process 0", "or --coordinator auto alone"),
        ("--coordinator 127.0.0.1:1 --processes 2 --process 2", "counts from 0 to 1"),
        ("--coordinator 127.0.0.1 --processes 2 --process 1", "must be HOST:PORT"),
        ("--coordinator auto --suite", "--suite trains in one process"),
        (
            "--coordinator 127.0.0.1:1 --processes 2 --process 1",
            "no process listens at 127.0.0.1:1",
        ),
    ],
)
def test_invalid_process_flags_are_refused(
    words: str,
    message: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(processes, "WAIT", 0)
    assert main(["train", "--out", str(tmp_path / "run"), *words.split()]) == 2
    assert message in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def train(
    out: Path, flags: list[str], number: int, devices: int, before: str = ""
) -> list[subprocess.CompletedProcess[str]]:
    """Train in several processes with several devices each; process 1 runs `before` first."""
    port, begun = free_port(), []
    for process in range(number):
        page = COMMAND[: None if number > 1 else COMMAND.index("--coordinator")]
        words = [*page, f"--out={out}", "--no-tensorboard", *flags]
        if number > 1:
            words += ["--coordinator", f"127.0.0.1:{port}"]
            words += [f"--processes={number}", f"--process={process}"]
        code = (before if process == 1 else "") + RUN.format(words)
        begun.append(started(code, devices))
    ended = []
    for one in begun:
        out_text, err = one.communicate(timeout=400)
        ended.append(subprocess.CompletedProcess(one.args, one.returncode, out_text, err))
    return ended


def rows(folder: Path) -> list[dict[str, float]]:
    return [json.loads(line) for line in (folder / "metrics.jsonl").read_text().splitlines()]


def known(row: dict[str, float]) -> dict[str, float]:
    """A row with NaN in place of null, as `pytest.approx` needs it."""
    return {name: math.nan if value is None else value for name, value in row.items()}


# The experiment `tiny()` in another world, with one seed.
ONE = [*FLAGS[:-1], "--seeds=1"]


# Starts up to five processes: only processes with their own devices show what works across them.
@pytest.mark.slow
@pytest.mark.parametrize("share", ["--seeds=2", "--shards=2"])
def test_two_processes_give_the_training_of_one(share: str, tmp_path: Path) -> None:
    one, two = tmp_path / "one", tmp_path / "two"
    (alone,) = train(one, [*ONE, share], 1, 2)
    both = train(two, [*ONE, share], 2, 1)
    assert [done.returncode for done in (alone, *both)] == [0, 0, 0], both
    assert f"two: {UPDATES} of {UPDATES} updates" in both[0].stdout
    assert "updates" not in both[1].stdout
    # Bit for bit.
    assert rows(one) == rows(two)
    assert same_checkpoints(RunFolder.open(one), RunFolder.open(two), UPDATES)
    if share == "--shards=2":
        return
    # The error of process 0 ends the other process.
    first, second = train(two, [*ONE, share], 2, 1)
    assert "already has a run" in first.stderr
    assert 0 not in (first.returncode, second.returncode)
    assert "another" in second.stderr


# Starts ten processes: only a killed process shows how the others react.
@pytest.mark.slow
def test_killed_training_resumes_with_other_process_counts(tmp_path: Path) -> None:
    flags = [*ONE, "--num-envs=8", f"--total-steps={UPDATES * 8 * 8}", "--shards=4"]
    (alone,) = train(tmp_path / "alone", flags, 1, 4)
    assert alone.returncode == 0, alone.stderr
    # A signal to any process stops all, with a checkpoint.
    ended = train(tmp_path / "four", flags, 2, 2, SIGNAL.format(1, "SIGTERM"))
    assert [done.returncode for done in ended] == [130, 130], ended
    again = [*flags, "--resume", "--save-every=0"]
    first, second = train(tmp_path / "four", again, 2, 2, SIGNAL.format(3, "SIGKILL"))
    assert second.returncode == -9
    assert first.returncode != 0
    assert "another" in first.stderr
    shutil.copytree(tmp_path / "four", tmp_path / "one")
    assert RunFolder.open(tmp_path / "one").checkpoints.updates() == [3, 4]
    for name, number, devices in (("four", 4, 1), ("one", 1, 2)):
        ended = train(tmp_path / name, [*flags, "--resume"], number, devices)
        assert not any(done.returncode for done in ended), ended
        # Rounding only: four devices add their sums in another order.
        both = zip(rows(tmp_path / "alone"), rows(tmp_path / name), strict=True)
        for expected, row in ([known(each) for each in pair] for pair in both):
            assert row == pytest.approx(expected, rel=2e-4, abs=2e-5, nan_ok=True)
