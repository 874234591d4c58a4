"""The thing of the documentation: the player reaches it, and the frames show it."""

from __future__ import annotations

import runpy
from pathlib import Path

import jax
import numpy as np
import pytest

from examples import custom_thing
from examples.custom_thing import MUSHROOM, MushroomHunt
from jaxenstein.maps import label_name


def test_frames_show_the_thing() -> None:
    env = MushroomHunt(height=24, width=32, observation="labels")
    labels = np.asarray(env.reset(jax.random.key(0))[0])
    assert label_name(MUSHROOM.label) == "mushroom"
    # Four tiles ahead, 0.6 wide: in a view of 60 degrees that is 4.16 of the 32 columns.
    assert (labels == MUSHROOM.label).any(axis=0).sum() in (3, 4, 5)


def test_program_runs(capsys: pytest.CaptureFixture[str]) -> None:
    runpy.run_path(str(Path(custom_thing.__file__)), run_name="__main__")
    out = capsys.readouterr().out
    assert "return 1" in out
    assert "0.0% of the first frame" not in out
