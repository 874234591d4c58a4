"""Run directories: exact resuming, refused configs, metrics files."""

from __future__ import annotations

import errno
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest

pytest.importorskip("flax")

from jaxenstein import SettingError
from jaxenstein.baselines.runs import checkpoints
from jaxenstein.baselines.runs.checkpoints import Checkpoints
from jaxenstein.baselines.runs.experiment import Experiment
from jaxenstein.baselines.runs.folder import CHECKPOINTS, CONFIG, RunFolder, run_names
from jaxenstein.baselines.runs.metrics import METRICS, MetricsFile, read_metrics
from jaxenstein.baselines.runs.training import train
from jaxenstein.files import OutputError
from tests.baselines.tiny import OPTIONS, UPDATES, same_checkpoints, tiny

pytestmark = pytest.mark.usefixtures("plain_frames")

ROOT = Path(__file__).parents[3]
TRAIN = """
import sys
from jaxenstein.baselines.runs.folder import RunFolder
from jaxenstein.baselines.runs.training import train
train(RunFolder.open(sys.argv[1]), save_every=0.0)
"""


def assert_same_result(folder: RunFolder, other: RunFolder) -> None:
    assert (folder.path / METRICS).read_bytes() == (other.path / METRICS).read_bytes()
    assert same_checkpoints(folder, other, folder.experiment.config.updates)


def test_run_writes_config_and_metrics(whole: RunFolder) -> None:
    opened = RunFolder.open(whole.path)
    assert opened.experiment.differences(whole.experiment) == []
    rows = read_metrics(whole.path)
    assert [(row["update"], row["seed"]) for row in rows] == [
        (update, seed) for update in range(1, UPDATES + 1) for seed in (0, 1)
    ]
    assert rows[-1]["steps"] == OPTIONS["total_steps"]
    entropies = [[row["entropy"] for row in rows if row["seed"] == seed] for seed in (0, 1)]
    assert entropies[0] != entropies[1]
    # Horizon 10, rollout 8, four environments: every one of them has ended by the second update.
    assert (rows[2]["episodes"] or 0) >= 4
    ended = [row for row in rows if row["episodes"]]
    assert all(0 < (row["length"] or 0) <= 10 for row in ended)
    assert whole.checkpoints.updates()[-1] == UPDATES
    assert len(whole.checkpoints.updates()) <= checkpoints.KEEP


@pytest.mark.parametrize("stop_after", [1, 4])
def test_stopped_and_resumed_run_is_identical(
    whole: RunFolder, experiment: Experiment, tmp_path: Path, stop_after: int
) -> None:
    folder = RunFolder.create(tmp_path / "run", experiment)
    done: list[int] = []
    train(
        folder,
        notify=lambda update, rows: done.append(update),
        stop=lambda: bool(done) and done[-1] >= stop_after,
    )
    assert done == list(range(stop_after + 1))
    # Rows after the checkpoint are cut off: whole rows, and half of one.
    with (folder.path / METRICS).open("a") as file:
        file.write('{"update": 8}\n{"upd')
    assert train(RunFolder.open(folder.path)) == UPDATES
    assert_same_result(folder, whole)
    assert train(folder) == UPDATES
    assert_same_result(folder, whole)


@pytest.mark.slow
def test_run_killed_at_random_and_resumed_is_identical(
    experiment: Experiment, tmp_path: Path
) -> None:
    """Processes are killed while they train or write, until one completes.

    They save after every update, and so does the one that nobody kills: a chunk of another length
    is another program, which may round differently.
    """
    folder, undisturbed = (RunFolder.create(tmp_path / n, experiment) for n in ("run", "whole"))
    rng = random.Random(0)
    # A killed process may leave an incomplete program, so no other test uses this cache.
    environment = os.environ | {
        "JAX_COMPILATION_CACHE_DIR": str(tmp_path / "compiled"),
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
    }
    command = [sys.executable, "-c", TRAIN]
    subprocess.run([*command, str(undisturbed.path)], env=environment, check=True)
    killed, process = 0, None
    for _ in range(8):
        process = subprocess.Popen(
            [*command, str(folder.path)],
            env=environment,
            stderr=subprocess.PIPE,
            text=True,
        )
        rows, limit = count_rows(folder), time.monotonic() + 120
        while process.poll() is None and count_rows(folder) <= rows and time.monotonic() < limit:
            time.sleep(0.005)
        time.sleep(rng.uniform(0, 0.3))
        if killed < 2:
            process.kill()
        stderr = process.communicate(timeout=120)[1]
        if process.returncode == 0:
            break
        assert process.returncode == -signal.SIGKILL, stderr
        killed += 1
    assert killed >= 1
    assert process is not None
    assert process.returncode == 0
    assert_same_result(folder, undisturbed)


def count_rows(folder: RunFolder) -> int:
    path = folder.path / METRICS
    return path.read_bytes().count(b"\n") if path.exists() else 0


def test_damaged_checkpoint_costs_only_time(whole: RunFolder, tmp_path: Path) -> None:
    shutil.copytree(whole.path, tmp_path / "run")
    folder = RunFolder.open(tmp_path / "run")
    (folder.path / CHECKPOINTS / f"{UPDATES}.npz").write_text("{")
    with pytest.warns(UserWarning, match="skipped a damaged checkpoint: .*npz"):
        assert folder.networks()[0] < UPDATES
    with pytest.warns(UserWarning, match="skipped a damaged checkpoint"):
        assert train(folder) == UPDATES
    assert_same_result(folder, whole)


def test_error_names_fields_of_differing_config(whole: RunFolder) -> None:
    other = tiny(learning_rate=1e-3, epochs=3, horizon=11, seeds=3)
    with pytest.raises(SettingError) as caught:
        whole.check_same(other)
    for part in (
        "config.epochs (3, not 2)",
        "hparams.learning_rate (0.001, not 0.00025)",
        "environment.params.max_steps_in_episode (11, not 10)",
        "seeds ([0, 1, 2], not [0, 1])",
    ):
        assert part in str(caught.value)
    whole.check_same(tiny())


def test_run_can_train_longer(whole: RunFolder, tmp_path: Path) -> None:
    steady = {"anneal": False}
    folder = RunFolder.create(tmp_path / "short", tiny(**steady))
    train(folder)
    longer = tiny(**steady, total_steps=2 * OPTIONS["total_steps"])
    folder.continue_as(longer)
    assert train(folder) == 2 * UPDATES
    alone = RunFolder.create(tmp_path / "long", longer)
    train(alone)
    assert_same_result(RunFolder.open(folder.path), alone)
    folder.continue_as(longer)
    for steps, reason in (
        (OPTIONS["total_steps"], "total_steps is already 384"),
        (10_000, "another config"),
    ):
        other = tiny(**steady, total_steps=steps, epochs=2 + (steps == 10_000))
        with pytest.raises(SettingError, match=reason):
            folder.continue_as(other)
    with pytest.raises(SettingError, match="cannot continue to 384 steps: its learning rate is"):
        whole.continue_as(tiny(total_steps=384))


def test_changed_rules_end_a_run_and_other_versions_warn(whole: RunFolder, tmp_path: Path) -> None:
    shutil.copytree(whole.path, tmp_path / "run")
    plain = json.loads((whole.path / CONFIG).read_text())
    plain["made_with"]["jax"] = "0.0.1"
    (tmp_path / "run" / CONFIG).write_text(json.dumps(plain))
    with pytest.warns(UserWarning, match="was started with jax 0.0.1, not"):
        train(RunFolder.open(tmp_path / "run"))
    plain["environment"]["version"] = 9
    (tmp_path / "run" / CONFIG).write_text(json.dumps(plain))
    with pytest.warns(UserWarning, match="trained on version 9 of its map, which is now version 0"):
        folder = RunFolder.open(tmp_path / "run")
    with pytest.raises(SettingError, match="cannot be resumed: it was trained on version 9"):
        train(folder)


def test_error_names_folder_with_runs(whole: RunFolder) -> None:
    with pytest.raises(SettingError, match=r"there are runs in .*run"):
        RunFolder.open(whole.path.parent)
    with pytest.raises(SettingError, match="is a file, not a run directory"):
        RunFolder.open(whole.path / CONFIG)


def test_folder_holds_one_run_of_one_process(whole: RunFolder) -> None:
    with pytest.raises(SettingError, match=r"already has a run: --resume continues it"):
        RunFolder.create(whole.path, whole.experiment)
    with whole.locked(), pytest.raises(SettingError, match="another process is training"):
        train(RunFolder.open(whole.path))


def test_checkpoints_of_another_run_are_not_adopted(whole: RunFolder, tmp_path: Path) -> None:
    shutil.copytree(whole.path, tmp_path / "run")
    (tmp_path / "run" / CONFIG).unlink()
    with pytest.raises(SettingError, match=r"has checkpoints of a run without its config\.json"):
        RunFolder.create(tmp_path / "run", whole.experiment)


def test_file_systems_without_locks_can_hold_runs(
    whole: RunFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    fcntl = pytest.importorskip("fcntl")

    def fail(*given: Any) -> None:
        raise OSError(errno.ENOSYS, "not implemented")

    monkeypatch.setattr(fcntl, "flock", fail)
    with whole.locked():
        pass


def test_error_says_why_folder_is_no_run(whole: RunFolder, tmp_path: Path) -> None:
    with pytest.raises(SettingError, match=r"there is no run in .*: it has no config.json"):
        RunFolder.open(tmp_path)
    plain = json.loads((whole.path / CONFIG).read_text())
    misspelt = plain | {"config": plain["config"] | {"epohcs": 1}}
    for text, reason in (
        ("{", "config.json: not the config of a run, or only a part of it: line 1, column 2"),
        ('{"format": 1, "format": 1}', "config.json: two entries have the name 'format'"),
        ("[]", "not the config of a run"),
        ('{"format": 99}', "format 99, not 1"),
        ('{"format": true}', "format True, not 1"),
        ('{"format": 1}', "not the config of a run"),
        (json.dumps(plain | {"seeds": [0, 3]}), r"'seeds' must be consecutive, not \[0, 3\]"),
        (json.dumps(misspelt), "unknown setting 'epohcs', did you mean 'epochs'"),
    ):
        (tmp_path / CONFIG).write_text(text)
        with pytest.raises(SettingError, match=reason):
            RunFolder.open(tmp_path)


@pytest.mark.parametrize(
    ("part", "name", "value", "reason"),
    [
        ("hparams", "learning_rate", True, "learning_rate must be a finite number >= 0"),
        ("hparams", "gae_lambda", [], "gae_lambda must be a number or an array of them, not []"),
        ("hparams", "clip", [0.1, 0.2], "clip must be a number or an array of them, not [0.1"),
        ("hparams", "clip", None, "clip must be a number or an array of them, not None"),
        ("hparams", "value", 1e308, "value must be .*, not 1e+308, which is inf in float32"),
        ("hparams", "entropy", "0.1", "entropy must be a number or an array of them, not '0.1'"),
        ("config", "contrast", 1e308, "contrast must be .*, not 1e+308, which is inf in float32"),
        ("config", "contrast", True, "contrast must be a finite number >= 0, not True"),
        ("config", "epochs", 2**31, "epochs must be .*2147483648, which does not fit into int32"),
        ("config", "num_envs", [4], "num_envs must be a whole number >= 1, not (4,)"),
        ("config", "anneal", 1, "anneal must be True or False, not 1"),
        ("config", "on_divergence", "stp", "on_divergence must be one of 'stop', 'continue'"),
        ("grid", "clip", [0.1, 1e308], "clip must be .*, not 1e+308, which is inf in float32"),
        ("grid", "clip", [0.1, True], "grid.clip must be a list of different numbers"),
        ("environment", "version", True, "environment.version must be a whole number >= 0"),
    ],
)
def test_error_names_file_and_entry_of_wrong_value(
    whole: RunFolder, tmp_path: Path, part: str, name: str, value: Any, reason: str
) -> None:
    plain = json.loads((whole.path / CONFIG).read_text())
    plain[part][name] = value
    (tmp_path / CONFIG).write_text(json.dumps(plain))
    with pytest.raises(SettingError) as caught:
        RunFolder.open(tmp_path)
    said = str(caught.value)
    assert said.startswith(f"{tmp_path / CONFIG}: ")
    assert re.search(re.escape(reason).replace(r"\.\*", ".*"), said)


def test_unwritable_folder_is_reported_first(
    experiment: Experiment, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match=r"not a directory|is not a folder"):
        RunFolder.create(tmp_path / "file" / "run", experiment)
    # Root may write everywhere, so the refusal is simulated.
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(OutputError, match="no permission"):
        RunFolder.create(tmp_path / "run", experiment)
    assert not (tmp_path / "run" / CONFIG).exists()


@pytest.mark.parametrize("room", [6, 10])
def test_full_disk_stops_the_run_and_harms_nothing(
    whole: RunFolder,
    experiment: Experiment,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    room: int,
) -> None:
    """Every file is synced as it is written; the disk has room for this many."""
    folder = RunFolder.create(tmp_path / "run", experiment)
    calls: list[int] = []
    real = os.fsync

    def full(file: int) -> None:
        calls.append(1)
        if len(calls) > room:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        real(file)

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        with pytest.raises(OutputError, match="no space left on device"):
            train(folder, save_every=0.0)
    restored = folder.restore()
    assert restored is not None
    assert 0 < restored.update < UPDATES
    assert restored.damaged == ()
    assert list((folder.path / CHECKPOINTS).glob(".*")) == []
    assert train(folder) == UPDATES
    assert_same_result(folder, whole)


FULL = """
import resource, sys
from unittest import mock
from jaxenstein.cli import main
from tests.reference.frames import plain_frame
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, resource.RLIM_INFINITY))
with mock.patch("jaxenstein.tasks.first_person.render", plain_frame):
    sys.exit(main(sys.argv[1:]))
"""


def test_no_room_for_a_checkpoint_leaves_nothing(tmp_path: Path) -> None:
    lines = [f"{name} = {json.dumps(value)}" for name, value in OPTIONS.items()]
    (tmp_path / "tiny.toml").write_text("\n".join(lines))
    command = ["train", "--config", "tiny.toml", "--out", "a/run", "--no-tensorboard"]
    done = subprocess.run(
        [sys.executable, "-c", FULL, *command],
        cwd=tmp_path,
        env=os.environ | {"JAX_COMPILATION_CACHE_DIR": "", "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    told = [line for line in done.stderr.splitlines() if not line.startswith("run [")]
    assert told == ["jaxenstein: cannot write a/run/checkpoints/0.npz: file too large"]
    assert not (tmp_path / "a").exists()


def test_training_that_never_began_leaves_folder_unchanged(
    experiment: Experiment, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "notes.txt").write_text("mine")

    def full(*_: Any) -> None:
        raise OutputError("x", "no space left on device")

    def interrupted(*_: Any) -> None:
        raise KeyboardInterrupt

    for save, error in (full, OutputError), (interrupted, KeyboardInterrupt):
        folder = RunFolder.create(tmp_path / "run", experiment)
        with monkeypatch.context() as patch:
            patch.setattr(Checkpoints, "save", save)
            with pytest.raises(error):
                train(folder)
        assert [path.name for path in folder.path.iterdir()] == ["notes.txt"]
    # An existing run is never removed.
    RunFolder.create(tmp_path / "run", experiment)
    with monkeypatch.context() as patch:
        patch.setattr(Checkpoints, "save", full)
        with pytest.raises(OutputError):
            train(RunFolder.open(tmp_path / "run"))
    assert RunFolder.open(tmp_path / "run").experiment == experiment


def test_metrics_from_another_run_are_refused(experiment: Experiment, tmp_path: Path) -> None:
    rows = [{"update": n, "steps": 8 * n, "episodes": 0, "a": None} for n in (1, 2, 5)]
    lines = [json.dumps(row) + "\n" for row in rows]
    with pytest.raises(OutputError, match=r"metrics.jsonl: no such file"):
        MetricsFile(tmp_path, rows=1)
    assert list(tmp_path.iterdir()) == []
    file = MetricsFile(tmp_path)
    file.write(rows[:2])
    assert (tmp_path / METRICS).read_text() == "".join(lines[:2])
    with pytest.raises(SettingError, match=r"metrics.jsonl has 2 complete rows, but .* needs 3"):
        MetricsFile(tmp_path, rows=3)
    MetricsFile(tmp_path, rows=1).write(rows[2:])
    assert read_metrics(tmp_path) == [rows[0], rows[2]]
    with pytest.raises(SettingError, match="has metrics but no checkpoint"):
        train(RunFolder.create(tmp_path, experiment))
    assert len(read_metrics(tmp_path)) == 2


RACE = """
import sys, time
from pathlib import Path
from jaxenstein.baselines.runs.folder import RunFolder
from jaxenstein.errors import JAXensteinError
from tests.baselines.tiny import tiny
experiment = tiny()
Path(sys.argv[1], sys.argv[2]).touch()
while not Path(sys.argv[1], "go").exists():
    pass
for number in range(40):
    try:
        RunFolder.create(Path(sys.argv[1], str(number)), experiment)
        print(number)
    except JAXensteinError as error:
        assert "already has a run" in str(error) or "another process" in str(error), error
"""


def test_only_one_of_two_processes_gets_the_folder(tmp_path: Path) -> None:
    both = [
        subprocess.Popen(
            [sys.executable, "-c", RACE, str(tmp_path), name], stdout=subprocess.PIPE, text=True
        )
        for name in ("a", "b")
    ]
    while not ((tmp_path / "a").exists() and (tmp_path / "b").exists()):
        assert all(process.poll() is None for process in both)
        time.sleep(0.05)
    (tmp_path / "go").touch()
    won = [process.communicate(timeout=300)[0].split() for process in both]
    assert [process.returncode for process in both] == [0, 0]
    assert sorted(map(int, won[0] + won[1])) == list(range(40))


def test_run_names_are_exact_and_unique() -> None:
    assert run_names(tiny(seed=20240601)) == ["seed-20240601", "seed-20240602"]
    assert run_names(tiny(seed=1_000_000, seeds=1)) == ["seed-1000000"]
    close = [0.1, 0.1 + 1e-9, 1e-5, 1.00000001e-5]
    names = run_names(tiny(grid={"learning_rate": close, "clip": [0.2]}, seeds=1))
    assert [float(name.split("-clip-0.2-seed-0")[0][14:]) for name in names] == close


def test_a_grid_trains_every_point_with_every_seed(tmp_path: Path) -> None:
    # Two runs again, so that the same compiled program trains them.
    experiment = tiny(grid={"learning_rate": [0, 0.01]}, seeds=1)
    folder = RunFolder.create(tmp_path / "run", experiment)
    train(folder)
    rows = read_metrics(folder.path)
    rates = [row["learning_rate"] for row in rows]
    assert rates == pytest.approx([x for left in range(6, 0, -1) for x in (0, 0.01 * left / 6)])
    before = experiment.learner.many.init(experiment.keys())
    restored = folder.restore()
    assert restored is not None
    still = jax.tree.map(lambda a, b: a == b, restored.state.params, before.params)
    assert [all(np.all(leaf[run]) for leaf in jax.tree.leaves(still)) for run in (0, 1)] == [
        True,
        False,
    ]
