"""`jaxenstein train` and `jaxenstein plot`: flags, files, interruptions, messages."""

from __future__ import annotations

import importlib
import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("flax")

from jaxenstein.baselines.runs import training
from jaxenstein.baselines.runs.folder import RunFolder
from jaxenstein.baselines.runs.metrics import read_metrics
from jaxenstein.baselines.runs.options import resolve
from jaxenstein.cli import build_parser, main
from jaxenstein.cli.opening import given_training
from jaxenstein.cli.train import note_of
from tests.baselines.tiny import OPTIONS, UPDATES, tiny

pytestmark = pytest.mark.usefixtures("plain_frames")

FLAGS = [
    "--height=12", "--width=16", "--horizon=10", "--total-steps=192", "--num-envs=4",
    "--rollout=8", "--minibatches=2", "--epochs=2", "--features=8", "--hidden=8", "--head=8",
    "--convolutions=4x4x4", "--seeds=2",
]  # fmt: skip


@pytest.fixture
def flags(tmp_path: Path) -> list[str]:
    """The flags of the experiment `tiny()`."""
    (tmp_path / "map.txt").write_text(OPTIONS["map"])
    return [*FLAGS, f"--map-file={tmp_path / 'map.txt'}", "--no-tensorboard"]


def parse(*arguments: str) -> dict[str, Any]:
    return given_training(build_parser().parse_args(["train", "--out", "x", *arguments]))


def test_trains_resumes_and_plots(
    flags: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    assert main(["train", *flags, "--out", str(out)]) == 0
    captured = capsys.readouterr()
    assert captured.out.startswith(f"{out}: {UPDATES} of {UPDATES} updates  return ")
    assert "run [########################] 100%" in captured.err
    assert "success" in captured.err
    assert len(read_metrics(out)) == 2 * UPDATES
    before = (out / "metrics.jsonl").read_bytes()
    # Nothing is left to do, and the same options may be repeated.
    assert main(["train", *flags, "--out", str(out), "--resume"]) == 0
    assert (out / "metrics.jsonl").read_bytes() == before
    capsys.readouterr()
    assert main(["train", *flags, "--out", str(out)]) == 2
    assert "already has a run" in capsys.readouterr().err
    assert main(["train", "--out", str(out), "--resume", "--epochs=3", "--gamma=.5"]) == 2
    assert "config.epochs (3, not 2); hparams.gamma (0.5, not null)" in capsys.readouterr().err
    assert main(["train", "--out", str(out), "--resume", "--env=simple"]) == 2
    assert 'environment.id ("simple", not null)' in capsys.readouterr().err
    pytest.importorskip("matplotlib")
    pictures = [str(tmp_path / name) for name in ("a.png", "a.svg")]
    assert main(["plot", str(out), "--out", pictures[0], "--out", pictures[1]]) == 0
    assert capsys.readouterr().out == f"wrote {pictures[0]} and {pictures[1]}\n"
    # Two folders of one name are two lines.
    shutil.copytree(out, tmp_path / "other" / "run")
    both = [str(out), str(tmp_path / "other" / "run")]
    assert main(["plot", *both, "--out", pictures[1]]) == 0
    shown = Path(pictures[1]).read_text()
    assert all(folder in shown for folder in both)


def test_flags_and_files_give_the_same_experiment(flags: list[str], tmp_path: Path) -> None:
    file = tmp_path / "tiny.toml"
    lines = [f"{name} = {json.dumps(value)}" for name, value in OPTIONS.items() if name != "map"]
    file.write_text("\n".join([*lines, 'map_file = "map.txt"']))
    given = parse(*flags)
    assert given == parse("--config", str(file))
    assert given.pop("name") == "map"
    assert resolve(given).differences(tiny()) == []
    assert parse("--config", str(file), "--seeds", "3")["seeds"] == 3


def test_flags_of_recipes() -> None:
    given = parse("--recipe", "tuned", "--network=tiny", "--no-anneal")
    assert given == {"recipe": "tuned", "network": "tiny", "anneal": False}


def test_flags_of_tables_and_numbers() -> None:
    given = parse(
        "--set", "field_of_view=90", "--param", "discount=0.9", "--param", "goal-reward=2",
        "--grid", "clip=0.1,0.2", "--total-steps", "3e6", "--no-anneal", "--heading=-45,45",
    )  # fmt: skip
    assert given == {
        "settings": {"field_of_view": 90},
        "params": {"discount": 0.9, "goal_reward": 2},
        "grid": {"clip": [0.1, 0.2]},
        "total_steps": 3_000_000,
        "anneal": False,
        "heading": (-45, 45),
    }


def test_ctrl_c_leaves_checkpoint_and_names_resume(
    flags: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    out, timing = tmp_path / "run", training.Timing.write
    # A background job of a shell ignores the signal.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)

    def interrupt(self: training.Timing, update: int) -> None:
        timing(self, update)
        if update == 2:
            os.kill(os.getpid(), signal.SIGINT)

    with monkeypatch.context() as patch:
        patch.setattr(training.Timing, "write", interrupt)
        assert main(["train", *flags, "--out", str(out)]) == 130
    captured = capsys.readouterr()
    assert f"stopped; to continue: jaxenstein train --out {out} --resume" in captured.err
    assert RunFolder.open(out).checkpoints.updates()[-1] == 2
    # The old signal handlers are restored.
    assert signal.signal(signal.SIGINT, before) is signal.default_int_handler
    assert main(["train", "--out", str(out), "--resume", "--no-tensorboard"]) == 0
    assert len(read_metrics(out)) == 2 * UPDATES


def test_diverged_training_warns_and_keeps_finite_parameters(
    flags: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, told = tmp_path / "run", "diverged at update 1: its "
    command = ["train", *flags, "--out", str(out), "--learning-rate", "1e38"]
    assert main(command) == 3
    err = capsys.readouterr().err
    assert [f"seed-{seed} {told}" in err for seed in (0, 1)] == [True, True]
    assert "It stops learning; try a lower --learning-rate" in err
    assert "all 2 runs diverged" in err
    assert "to continue" not in err
    before = (out / "metrics.jsonl").read_bytes()
    assert main(["train", "--out", str(out), "--resume", "--no-tensorboard"]) == 3
    assert f"seed-1 {told}" in capsys.readouterr().err
    assert (out / "metrics.jsonl").read_bytes() == before
    assert main(["evaluate", str(out), "--episodes", "2"]) == 0
    captured = capsys.readouterr()
    assert f"jaxenstein: warning: run: seed-0 {told}" in captured.err
    assert f"jaxenstein: warning: run: seed-1 {told}" in captured.err
    assert "greedy" in captured.out
    agent = str(tmp_path / "agent.npz")
    assert main(["export", str(out), "--run=1", "--out", agent, "--episodes=2"]) == 0
    assert f"run: seed-1 {told}" in capsys.readouterr().err
    assert main(["record", "--policy", str(out), "--out", str(tmp_path / "a.gif")]) == 0
    assert f"run: seed-0 {told}" in capsys.readouterr().err


def test_training_continues_if_one_run_diverges(
    flags: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    varied = ["--grid", "learning_rate=1e38,1e-3", "--seeds=1"]
    assert main(["train", *flags, *varied, "--out", str(out)]) == 0
    captured = capsys.readouterr()
    assert f"{UPDATES} of {UPDATES} updates  return " in captured.out
    assert captured.err.count("learning_rate-1e+38-seed-0 diverged at update 1") == 1
    assert "0.001-seed-0 diverged" not in captured.err


def test_on_divergence_continue_trains_on(
    flags: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    how = ["--learning-rate=1e38", "--on-divergence=continue"]
    assert main(["train", *flags, *how, "--out", str(out)]) == 3
    assert len(read_metrics(out)) == 2 * UPDATES
    err = capsys.readouterr().err
    assert err.count("warning: the parameters of seed-0, seed-1 are not finite; try a lower") == 1
    assert err.endswith("all 2 runs diverged\n")
    assert main(["evaluate", str(out), "--episodes", "2"]) == 0
    assert "run: the parameters of seed-1 are not finite" in capsys.readouterr().err


def test_each_command_names_the_missing_extra(tmp_path: Path) -> None:
    """In a process without flax, which other commands do not need."""
    code = """
import sys
sys.modules["flax"] = None
from jaxenstein.cli import main
import jaxenstein
commands = "train --out x", "plot x --out x.png", "evaluate x", "record --policy . --out x.gif"
for command in commands:
    assert main(command.split()) == 2, command
assert main(["list"]) == 0
"""
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("pip install 'jaxenstein[baselines]'") == 4
    assert done.stderr.count("\n") == 4


def test_top_level_help_imports_no_extra() -> None:
    code = (
        "import sys; from jaxenstein.cli import build_parser; build_parser().format_help(); "
        "assert not {'flax', 'optax', 'matplotlib'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_demo_config_resolves() -> None:
    experiment = resolve(parse("--config", "demo"))
    assert (experiment.config.updates, len(experiment.runs)) == (30, 2)
    assert experiment.environment.settings["frame_skip"] == 6


def test_note_averages_over_all_episodes() -> None:
    rows = [
        {"episodes": 1, "return_sum": 1.0, "successes": 1},
        {"episodes": 3, "return_sum": 0.5, "successes": 0},
    ]
    assert note_of(rows) == "return 0.375  success 25%"
    assert note_of([{"episodes": 0, "return_sum": 0.0, "successes": 0}]) == ""
    assert note_of([]) == ""


def test_tensorboard_files_hold_the_numbers(
    flags: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    for module in ("tensorboard.summary", "tensorboardX"):
        monkeypatch.setitem(sys.modules, module, None)
    flags = [flag for flag in flags if flag != "--no-tensorboard"]
    assert main(["train", *flags, "--tensorboard", "--out", str(tmp_path / "no")]) == 2
    assert "pip install tensorboard" in capsys.readouterr().err
    monkeypatch.undo()
    pytest.importorskip("tensorboard")
    accumulator = importlib.import_module("tensorboard.backend.event_processing.event_accumulator")
    EventAccumulator = accumulator.EventAccumulator

    out = tmp_path / "run"
    assert main(["train", *flags, "--tensorboard", "--out", str(out)]) == 0
    events = EventAccumulator(str(out / "tensorboard" / "seed-1"))
    events.Reload()
    rows = [row for row in read_metrics(out) if row["seed"] == 1]
    for name in ("entropy", "return"):
        wanted = [(row["steps"], row[name]) for row in rows if row[name] is not None]
        found = [
            (event.step, float(event.tensor_proto.float_val[0])) for event in events.Tensors(name)
        ]
        assert found == [(step, pytest.approx(value)) for step, value in wanted]
