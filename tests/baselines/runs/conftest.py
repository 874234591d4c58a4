"""Runs that the tests of several files share, so that their programs are compiled once."""

from __future__ import annotations

import pytest

pytest.importorskip("flax")

from jaxenstein.baselines import Experiment, RunFolder, train
from tests.baselines.tiny import UPDATES, tiny, untrained_run


@pytest.fixture(scope="session")
def experiment() -> Experiment:
    return tiny()


@pytest.fixture(scope="module")
def whole(
    plain_frames: None, experiment: Experiment, tmp_path_factory: pytest.TempPathFactory
) -> RunFolder:
    """A run without interruption."""
    folder = RunFolder.create(tmp_path_factory.mktemp("whole") / "run", experiment)
    assert train(folder) == UPDATES
    return folder


@pytest.fixture(scope="session")
def folder(experiment: Experiment, tmp_path_factory: pytest.TempPathFactory) -> RunFolder:
    """A run before its first update."""
    return untrained_run(tmp_path_factory.mktemp("runs") / "tiny", experiment)
