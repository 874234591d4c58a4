"""Run directories of runs that diverge: rows, checkpoints, resumption, agents, plots."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import jax
import numpy as np
import pytest

pytest.importorskip("flax")

from jaxenstein import DivergenceWarning, SettingError
from jaxenstein.baselines.divergence import Divergence
from jaxenstein.baselines.runs.agents import best_run, export_policy, load_policy
from jaxenstein.baselines.runs.curves import curves_of
from jaxenstein.baselines.runs.folder import CHECKPOINTS, CONFIG, RunFolder
from jaxenstein.baselines.runs.metrics import METRICS, diverged_runs, read_metrics
from jaxenstein.baselines.runs.trained import load_trained
from jaxenstein.baselines.runs.training import train
from tests.baselines.tiny import UPDATES, same_checkpoints, tiny

pytestmark = pytest.mark.usefixtures("plain_frames")


def grid(*rates: float) -> dict[str, object]:
    return {"seeds": 1, "anneal": False, "grid": {"learning_rate": list(rates)}}


@pytest.fixture(scope="module")
def mixed(plain_frames: None, tmp_path_factory: pytest.TempPathFactory) -> RunFolder:
    """Two runs, the first of which diverges at once."""
    folder = RunFolder.create(tmp_path_factory.mktemp("mixed") / "run", tiny(**grid(1e38, 1e-3)))
    assert train(folder) == UPDATES
    return folder


def test_divergence_does_not_change_the_other_run(mixed: RunFolder, tmp_path: Path) -> None:
    beside = RunFolder.create(tmp_path / "run", tiny(**grid(1e-4, 1e-3)))
    train(beside)
    with (
        np.load(mixed.path / CHECKPOINTS / f"{UPDATES}.npz") as one,
        np.load(beside.path / CHECKPOINTS / f"{UPDATES}.npz") as other,
    ):
        assert one.files == other.files
        for name in one.files:
            assert one[name][1].tobytes() == other[name][1].tobytes(), name
            # Only finite numbers are written.
            if one[name].dtype.kind == "f":
                assert np.all(np.isfinite(one[name])), name
        assert one[".update"].tolist() == [0, UPDATES]
    rows, expected = read_metrics(mixed.path), read_metrics(beside.path)
    assert rows[1::2] == expected[1::2]
    assert [list(row) for row in rows] == [list(row) for row in expected]


def test_rows_after_divergence_hold_only_the_flag(mixed: RunFolder) -> None:
    lines = (mixed.path / METRICS).read_text().splitlines()
    rows = [json.loads(line, parse_constant=lambda word: pytest.fail(word)) for line in lines]
    assert len(rows) == 2 * UPDATES
    (code,) = {row["diverged"] for row in rows[::2]}
    assert 1 <= code <= 7
    own = {"update", "steps", "learning_rate", "grid_learning_rate", "seed", "diverged"}
    for update, row in enumerate(rows[::2], 1):
        assert (row["update"], row["seed"]) == (update, 0)
        assert not any(value for name, value in row.items() if name not in own)
        assert row["loss"] is row["return"] is row["learning_rate"] is None
    assert {row["diverged"] for row in rows[1::2]} == {0}
    assert diverged_runs(rows, 2) == {0: Divergence(1, code)}


@pytest.mark.parametrize("stop_after", [1, 3])
def test_resumed_run_stays_stopped(mixed: RunFolder, tmp_path: Path, stop_after: int) -> None:
    folder = RunFolder.create(tmp_path / "run", mixed.experiment)
    done: list[int] = []
    train(
        folder,
        notify=lambda update, rows: done.append(update),
        stop=lambda: bool(done) and done[-1] >= stop_after,
    )
    assert train(RunFolder.open(folder.path)) == UPDATES
    assert (folder.path / METRICS).read_bytes() == (mixed.path / METRICS).read_bytes()
    assert same_checkpoints(folder, mixed, UPDATES)


@pytest.mark.parametrize("chunk", [1, 4])
def test_training_ends_once_all_runs_have_diverged(tmp_path: Path, chunk: int) -> None:
    folder = RunFolder.create(tmp_path / "run", tiny(**grid(1e38, 2e38)))
    assert train(folder, chunk=chunk) == 1
    assert len(read_metrics(folder.path)) == 2
    assert folder.checkpoints.updates()[-1] == 1
    before = (folder.path / METRICS).read_bytes()
    assert train(RunFolder.open(folder.path)) == 1
    assert (folder.path / METRICS).read_bytes() == before
    assert [curve.values.shape for curve in curves_of(folder.path)] == [(1, 1)] * 2


def test_agent_keeps_last_finite_parameters_and_warns(mixed: RunFolder, tmp_path: Path) -> None:
    start = mixed.experiment.learner.many.init(mixed.experiment.keys())
    trained = load_trained(mixed.path)
    for one, other in zip(
        jax.tree.leaves(trained.params), jax.tree.leaves(start.params), strict=True
    ):
        np.testing.assert_array_equal(one[0], other[0])
    facts = (
        r"run: .*seed-0 diverged at update 1: its .* not finite. It keeps .* of update 0, the last"
    )
    with pytest.warns(DivergenceWarning, match=facts):
        load_policy(mixed.path, run=0)
    with pytest.warns(DivergenceWarning, match=facts):
        export_policy(mixed.path, tmp_path / "agent.npz", 0, episodes=1)
    assert load_trained(tmp_path / "agent.npz").update == 0
    # The run that did not diverge is the best one, and gives no warning.
    assert best_run(mixed) == 1
    assert load_policy(mixed.path).name.endswith("seed-0")
    export_policy(mixed.path, tmp_path / "agent.npz", episodes=1)
    assert load_trained(tmp_path / "agent.npz").update == UPDATES


def test_best_run_uses_updates_before_divergence(mixed: RunFolder, tmp_path: Path) -> None:
    shutil.copytree(mixed.path, tmp_path / "run")
    folder = RunFolder.open(tmp_path / "run")
    sums = {"episodes": 2, "length_sum": 9}
    rows = []
    for update in range(20):
        stopped = {"return_sum": 6.0, "diverged": 0} if update < 5 else {"diverged": 4}
        rows += [{**(sums if update < 5 else {}), **stopped}, {**sums, "return_sum": 4.0}]
    counts = {"update": 1, "steps": 8, "episodes": 0}
    text = "".join(json.dumps(counts | row) + "\n" for row in rows)
    (folder.path / METRICS).write_text(text)
    assert best_run(folder) == 0


def test_curves_of_diverged_runs_are_empty(mixed: RunFolder) -> None:
    for metric in ("return", "entropy", "diverged"):
        stopped, going = curves_of(mixed.path, metric)
        assert len(stopped.at) == len(going.at) == UPDATES
        assert np.all(np.isnan(stopped.values)) == (metric != "diverged")
    assert np.all(np.isfinite(curves_of(mixed.path, "entropy")[1].values))
    pytest.importorskip("matplotlib")
    from jaxenstein.baselines.runs.curves import plot

    axes = plot(curves_of(mixed.path, "entropy"), "entropy").axes[0]
    assert [len(np.atleast_1d(line.get_xdata())) for line in axes.lines] == [0, UPDATES]
    legend = axes.get_legend()
    assert legend is not None
    shown = [text.get_text() for text in legend.get_texts()]
    assert shown == ["run, learning_rate 1e+38 (diverged)", "run, learning_rate 0.001"]


def test_plot_leaves_out_diverged_seeds(tmp_path: Path) -> None:
    """The last of three seeds diverges at the fourth update; until then its returns are lower."""
    pytest.importorskip("matplotlib")
    from jaxenstein.baselines.runs.curves import plot

    folder = RunFolder.create(tmp_path / "run", tiny(seeds=3))
    rows = [
        {
            "update": update,
            "steps": 32 * update,
            "episodes": 1,
            "return": float(run < 2),
            "return_sum": float(run < 2),
            "diverged": (run == 2) * (update > 3),
        }
        for update in range(1, UPDATES + 1)
        for run in range(3)
    ]
    (folder.path / METRICS).write_text("".join(json.dumps(row) + "\n" for row in rows))
    (curve,) = curves_of(folder.path, "return")
    assert curve.diverged == (2,)
    (axes,) = plot([curve]).axes
    assert set(np.asarray(axes.lines[0].get_ydata())) == {1.0}
    legend = axes.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["run (3 runs, 1 diverged)"]


def test_run_without_on_divergence_resumes_unchanged(tmp_path: Path) -> None:
    folder = RunFolder.create(tmp_path / "run", tiny(**grid(1e38, 1e-3), on_divergence="continue"))
    done: list[int] = []
    train(folder, notify=lambda update, rows: done.append(update), stop=lambda: 2 in done)
    plain = json.loads((folder.path / CONFIG).read_text())
    del plain["config"]["on_divergence"]
    (folder.path / CONFIG).write_text(json.dumps(plain))
    folder = RunFolder.open(folder.path)
    assert train(folder) == UPDATES
    rows = read_metrics(folder.path)
    assert "diverged" not in rows[0]
    assert rows[-2]["loss"] is None
    assert rows[-1]["loss"] is not None
    with pytest.warns(DivergenceWarning, match="the parameters of .*seed-0 are not finite"):
        load_policy(folder.path, run=0)
    with (
        pytest.warns(DivergenceWarning),
        pytest.raises(
            SettingError,
            match=r"parameters of learning_rate-1e\+38-seed-0 are not finite in float16",
        ),
    ):
        export_policy(folder.path, tmp_path / "agent.npz", 0, episodes=1)
    assert not (tmp_path / "agent.npz").exists()
