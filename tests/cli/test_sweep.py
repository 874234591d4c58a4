"""`jaxenstein sweep`: grids of the paper, parts, and the table at the end."""

from __future__ import annotations

import json
import signal
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("flax")

from jaxenstein.baselines.runs import training
from jaxenstein.baselines.runs.experiment import Experiment
from jaxenstein.baselines.runs.folder import RunFolder
from jaxenstein.baselines.runs.metrics import means
from jaxenstein.baselines.runs.sweeps import plan, summary, swept
from jaxenstein.cli import main
from jaxenstein.cli.sweep import table
from jaxenstein.errors import SettingError
from tests.baselines.tiny import OPTIONS, tiny

pytestmark = pytest.mark.usefixtures("plain_frames")

WITHOUT_SEEDS = {name: value for name, value in OPTIONS.items() if name != "seeds"}


def write_metrics(folder: RunFolder, returns: list[float | None]) -> None:
    """Ten updates in which each run has its own return; None means no episode."""
    rows = []
    for update in range(1, 11):
        for run, value in zip(folder.experiment.runs, returns, strict=True):
            sums = {
                "episodes": 0 if value is None else 4,
                "return_sum": 4 * (value or 0.0),
                "length_sum": 12,
                "successes": int(4 * (value or 0.0)),
            }
            rows.append({"update": update, "steps": 32 * update, **run, **means(sums), **sums})
    text = "".join(json.dumps(row) + "\n" for row in rows)
    (folder.path / "metrics.jsonl").write_text(text)


def test_paper_grids_have_65_runs() -> None:
    planned = plan(WITHOUT_SEEDS, swept())
    assert {name: len(e.runs) for name, e in planned.items()} == {"ppo": 5, "rnd": 30, "icm": 30}
    numbers = planned["rnd"].numbers()
    losses = numbers.bonus["rnd_loss"]
    pairs = set(zip(numbers.bonus_reward.tolist(), losses.tolist(), strict=True))
    assert len(pairs) == 6
    assert planned["icm"].config.algo == "icm"


def test_without_a_grid_every_algorithm_has_one_point() -> None:
    planned = plan(WITHOUT_SEEDS, swept(), paper=False)
    assert {name: len(e.runs) for name, e in planned.items()} == {"ppo": 5, "rnd": 5, "icm": 5}
    given = plan({**WITHOUT_SEEDS, "grid": {"clip": [0.1, 0.2]}}, ["rnd"], paper=False)
    assert len(given["rnd"].runs) == 10


def test_parts_of_a_grid_cover_the_whole_grid() -> None:
    whole = plan(WITHOUT_SEEDS, ["rnd"])["rnd"]
    parts = plan(WITHOUT_SEEDS, ["rnd"], at_once=10)
    assert list(parts) == [f"rnd-bonus_reward-{value}" for value in ("0.1", "1", "10")]

    def runs(experiment: Experiment) -> set[tuple[float, ...]]:
        numbers = experiment.numbers()
        columns = np.broadcast_arrays(numbers.bonus_reward, numbers.bonus["rnd_loss"])
        seeds = [run["seed"] for run in experiment.runs]
        rows = np.array([*columns, seeds], np.float32).T
        return set(map(tuple, rows.tolist()))

    assert set.union(*map(runs, parts.values())) == runs(whole)
    first = next(iter(plan(WITHOUT_SEEDS, ["rnd"], at_once=1)))
    assert first == "rnd-bonus_reward-0.1-rnd_loss-0.01"


def test_given_number_is_not_varied() -> None:
    planned = plan(WITHOUT_SEEDS | {"bonus_reward": 0.5}, ["rnd"])["rnd"]
    assert [name for name, _ in planned.grid] == ["rnd_loss"]
    assert planned.hparams["bonus_reward"] == 0.5
    with pytest.raises(SettingError, match="clip is given and also in the grid"):
        plan(WITHOUT_SEEDS | {"clip": 0.1, "grid": {"clip": [0.1, 0.2]}}, ["ppo"])


def test_summary_lists_the_best_point_first(tmp_path: Path) -> None:
    grid = RunFolder.create(tmp_path / "a", tiny(grid={"clip": [0.1, 0.2]}))
    write_metrics(grid, [0.25, 0.75, 1.0, None])
    lone = RunFolder.create(tmp_path / "b", tiny(seeds=1))
    write_metrics(lone, [None])
    points = summary([lone.path, grid.path])
    assert [point.label for point in points] == ["a, clip 0.2", "a, clip 0.1", "b"]
    assert (points[1].earned.mean, points[1].earned.low, points[1].earned.high) == (0.5, 0.25, 0.75)
    assert points[0].earned.mean == 1
    assert np.isnan(points[2].earned.mean)
    rows = [json.loads(line) for line in (grid.path / "metrics.jsonl").read_text().splitlines()]
    # The last update of the second seed.
    rows[-3]["diverged"] = 1
    (grid.path / "metrics.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    (point,) = [point for point in summary([grid.path]) if point.label == "a, clip 0.1"]
    assert (point.runs, point.diverged, point.earned.mean, point.earned.low) == (2, 1, 0.25, 0.25)
    lines = table(points).splitlines()
    assert lines[2].split() == ["a,", "clip", "0.1", "2", "0.5", "0.25", "to", "0.75", "50.0%",
                                "25.0%", "to", "75.0%"]  # fmt: skip


@pytest.fixture
def common(tmp_path: Path) -> list[str]:
    (tmp_path / "map.txt").write_text(OPTIONS["map"])
    return [
        "--height=12", "--width=16", "--horizon=10", "--total-steps=192", "--num-envs=4",
        "--rollout=8", "--minibatches=2", "--epochs=2", "--features=8", "--hidden=8", "--head=8",
        "--convolutions=4x4x4", "--seeds=2", f"--map-file={tmp_path / 'map.txt'}",
        "--no-tensorboard", "--algo", "ppo", "--out", str(tmp_path / "s"),
    ]  # fmt: skip


def test_diverged_grid_does_not_end_the_sweep(
    common: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flags = [*common, "--grid", "learning_rate=1e38,1e-3", "--at-once=2"]
    assert main(["sweep", *flags]) == 0
    captured = capsys.readouterr()
    assert captured.err.count("all 2 runs diverged") == 1
    parts = [f"ppo-learning_rate-{rate}" for rate in ("1e+38", "0.001")]
    for part, updates in zip(parts, (1, 6), strict=True):
        assert f"{tmp_path / 's' / part}: {updates} of 6 updates" in captured.out
        assert f"\n{part} " in captured.out
    assert captured.out.count("2, 2 diverged") == 1
    assert main(["sweep", *flags[:-2], "learning_rate=1e38", "--resume", "--at-once=1"]) == 3


def test_command_trains_skips_and_lists(
    common: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flags = [*common, "--grid", "clip=0.1,0.2"]
    # The time is over at once; then the sweep continues.
    assert main(["sweep", *flags, "--minutes=0"]) == 130
    assert "0 of 6 updates" in capsys.readouterr().out
    assert main(["sweep", *flags, "--no-grid"]) == 2
    assert "--no-grid or --grid, not both" in capsys.readouterr().err
    assert main(["sweep", *flags, "--resume"]) == 0
    shown = capsys.readouterr().out
    assert "ppo, clip 0.1" in shown
    assert "ppo, clip 0.2" in shown
    before = (tmp_path / "s" / "ppo" / "metrics.jsonl").read_bytes()
    assert main(["sweep", *flags]) == 2
    assert "already has a run" in capsys.readouterr().err
    assert main(["sweep", *flags, "--resume"]) == 0
    assert (tmp_path / "s" / "ppo" / "metrics.jsonl").read_bytes() == before
    capsys.readouterr()
    assert main(["sweep", *flags, "--resume", "--epochs=3"]) == 2
    assert "config.epochs (3, not 2)" in capsys.readouterr().err


def test_refused_sweeps_make_no_folders(
    common: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    there = RunFolder.create(tmp_path / "s" / "rnd", tiny(seeds=1))
    words = [word for word in common if word not in ("--algo", "ppo")]
    assert main(["sweep", *words, "--no-grid", "--algo", "ppo", "rnd"]) == 2
    assert f"{there.path} already has a run" in capsys.readouterr().err
    assert [path.name for path in (tmp_path / "s").iterdir()] == ["rnd"]


def test_signal_in_last_update_of_a_part_ends_the_sweep(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    begun: list[str] = []

    def train(folder: RunFolder, **_: object) -> int:
        begun.append(folder.path.name)
        signal.raise_signal(signal.SIGTERM)
        return folder.experiment.config.updates

    monkeypatch.setattr(training, "train", train)
    monkeypatch.chdir(tmp_path)
    given = "\n".join(f"{name} = {json.dumps(value)}" for name, value in WITHOUT_SEEDS.items())
    Path("tiny.toml").write_text(given)
    words = ["sweep", "--config", "tiny.toml", "--no-tensorboard", "--no-grid", "--out", "new"]
    assert main([*words, "--algo", "ppo", "rnd"]) == 130
    assert begun == ["ppo"]
    assert "to continue: the same command with --resume\n" in capsys.readouterr().err
