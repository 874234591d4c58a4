"""The learning experiments: what their configurations say."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("flax")

from jaxenstein.baselines.runs.options import resolve
from jaxenstein.cli import build_parser
from jaxenstein.cli.opening import given_training

FILES = (Path(__file__).parents[2] / "experiments").rglob("*.toml")
CONFIGS = sorted(path for path in FILES if path.parent.name != "studies")


@pytest.mark.parametrize("algo", ["ppo", "rnd", "icm"])
@pytest.mark.parametrize("config", CONFIGS, ids=lambda path: path.stem)
def test_the_files_are_experiments(config: Path, algo: str) -> None:
    flags = ["train", "--out", "x", "--config", str(config), "--algo", algo]
    experiment = resolve(given_training(build_parser().parse_args(flags)))
    assert experiment.config.algo == algo
    if config.parent.name == "figure3":
        # What the paper says.
        found = experiment.config
        assert len(experiment.runs) == 5
        assert experiment.environment.settings == {"height": 64, "width": 64}
        assert (found.rollout, found.epochs, found.hidden, found.features) == (128, 4, 256, 256)
