"""The learning experiments: what their configurations say, and the script on a tiny one."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("flax")
pytest.importorskip("matplotlib")

from experiments.compare import NUMBERS
from jaxenstein.baselines.runs.experiment import Experiment
from jaxenstein.baselines.runs.metrics import read_metrics
from jaxenstein.baselines.runs.options import resolve
from jaxenstein.cli import build_parser
from jaxenstein.cli.training import given_training

ROOT = Path(__file__).parents[2]
CONFIGS = sorted((ROOT / "experiments").rglob("*.toml"))
TINY = """
map = "####\\n#SG#\\n####"
height = 12
width = 16
horizon = 10
total_steps = 192
num_envs = 4
rollout = 8
minibatches = 2
epochs = 2
features = 8
hidden = 8
head = 8
convolutions = [[4, 4, 4]]
"""


def read(config: Path, algo: str) -> Experiment:
    flags = ["--config", str(config), "--algo", algo, *NUMBERS[algo]]
    return resolve(given_training(build_parser().parse_args(["train", "--out", "x", *flags])))


@pytest.mark.parametrize("algo", NUMBERS)
@pytest.mark.parametrize("config", CONFIGS, ids=lambda path: path.stem)
def test_the_files_are_experiments(config: Path, algo: str) -> None:
    experiment = read(config, algo)
    assert experiment.config.algo == algo
    if config.parent.name == "figure3":
        # What the paper says.
        found = experiment.config
        assert len(experiment.runs) == 5
        assert experiment.recipe.settings == {"height": 64, "width": 64}
        assert (found.rollout, found.epochs, found.hidden, found.features) == (128, 4, 256, 256)


def compare(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "experiments.compare", str(folder / "tiny.toml")]
    environment = os.environ | {"PYTHONPATH": f"{ROOT / 'src'}:{ROOT}"}
    return subprocess.run(
        [*command, "--out", str(folder / "out"), *arguments],
        capture_output=True,
        text=True,
        env=environment,
        check=False,
    )


@pytest.mark.slow
def test_trains_stops_goes_on_and_draws(tmp_path: Path) -> None:
    (tmp_path / "tiny.toml").write_text(TINY)
    done = compare(tmp_path, "--minutes", "0")
    assert done.returncode == 1
    assert "nothing is trained yet" in done.stderr
    out = tmp_path / "out"
    for _ in range(2):
        done = compare(tmp_path, "--algo", "ppo", "rnd", "--seeds", "2")
        assert done.returncode == 0, done.stderr
        assert "ppo" in done.stdout
        assert "rnd" in (out / "summary.md").read_text()
        for algo in ("ppo", "rnd"):
            assert len(read_metrics(out / algo)) == 2 * 6
        assert {path.name for path in out.glob("*.png")} == {"return.png", "success.png"}
    done = compare(tmp_path, "--algo", "ppo", "--seeds", "3")
    assert done.returncode != 0
    assert "seeds" in done.stderr
