"""A small world and an episode in it, for all tests of episodes; they need no rays."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import jaxenstein
from jaxenstein.episodes.recorder import record
from jaxenstein.trajectory import Trajectory
from tests.episodes.world import FACES, MAP, World


@pytest.fixture(scope="module", autouse=True)
def _plain_frames(plain_frames: None) -> None:
    """Replaces rendering by cheap frames, which still differ between states."""


@pytest.fixture(scope="module")
def world() -> World:
    env, params = jaxenstein.from_ascii(
        MAP, faces=FACES, height=12, width=16, heading=(-20, 20), name="Ünder"
    )
    return env, params.replace(living_reward=-0.1, max_steps_in_episode=70)


@pytest.fixture(scope="module")
def walk(world: World) -> Trajectory:
    """Past the key and through the door."""
    episode = record(*world, "shortest_path", seed=4)
    assert episode.ending == "terminated"
    assert episode.trajectory is not None
    return episode.trajectory


@pytest.fixture
def table(walk: Trajectory, tmp_path: Path) -> dict[str, Any]:
    """The content of the walk's file."""
    walk.save(tmp_path / "walk.json")
    return json.loads((tmp_path / "walk.json").read_text())
