"""The actor-critic in PyTorch runs."""

import math

import pytest

pytest.importorskip("torch")

from examples import torch_loop


def test_short_training(capsys):
    curve = torch_loop.main(["--updates", "10", "--envs", "3", "--steps", "6"])
    assert len(curve) == 10
    # Episodes end after 50 of the 60 steps at the latest.
    assert 0 <= curve[-1] <= 1
    assert math.isnan(curve[0]) or 0 <= curve[0] <= 1
    assert "update 10: mean return" in capsys.readouterr().out


@pytest.mark.slow
def test_agent_learns():
    curve = torch_loop.main(["--seed", "1"])
    assert curve[-1] > 0.8
