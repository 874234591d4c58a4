"""`jaxenstein record`: one episode beside its map."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import jaxenstein
from jaxenstein.cli import main, record
from jaxenstein.cli.policies import Forward, RandomPolicy, Script, parse_actions
from jaxenstein.view.recording import Episode

NAMES = ("turn left", "turn right", "forward", "backward", "interact")
# One tile takes seven steps of 0.15: a key, its door, and the goal in a row.
MAP = "########\n#S.rR.G#\n########\n"


World = tuple[jaxenstein.Environment, Any]


@pytest.fixture(scope="module")
def world() -> World:
    """One environment for all tests, so that it is compiled once."""
    return jaxenstein.from_ascii(MAP, height=8, width=8, autoreset=None, heading=0.0)


@pytest.fixture(scope="module")
def episode(world: World) -> Episode:
    script = [2] * 17 + [4] + [2] * 40
    return record.play(*world, Script(script), len(script), seed=0)


def test_episode_tells_what_happened(episode: Episode) -> None:
    played = episode
    happened = [event for event in played.events if event]
    assert happened == ["picked up a key", "opened a door", "reached the goal"]
    assert played.steps < 57
    assert played.frames.shape == (played.steps + 1, 8, 8, 3)
    np.testing.assert_allclose(played.positions[0], (1.5, 1.5))
    np.testing.assert_allclose(played.positions[1], (1.65, 1.5), rtol=1e-6)
    assert played.rewards[-1] == played.returns[-1] == 1
    assert played.opened[-1].all()
    assert not played.opened[0].any()
    assert played.taken[-1].all()
    assert (played.headings == 0).all()


def test_pictures_show_view_and_path(world: World, episode: Episode) -> None:
    env, played = world[0], episode
    pictures = list(record.compose(env, played, with_map=True, scale=10))
    assert len(pictures) == played.steps + 1
    assert len({picture.shape for picture in pictures}) == 1
    assert (pictures[0] != pictures[-1]).any()
    plain = next(iter(record.compose(env, played, with_map=False, scale=10)))
    assert plain.shape[1] < pictures[0].shape[1]
    np.testing.assert_array_equal(
        plain[6:86, 6:86], np.kron(played.frames[0], np.ones((10, 10, 1)))
    )


def test_files(
    world: World,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(record, "open_environment", lambda *_, **__: (*world, "map"))
    gif, sheet = tmp_path / "a.gif", tmp_path / "a.png"
    outputs = ["--out", str(gif), "--sheet", str(sheet), "--fps", "10"]
    assert main(["record", "simple", "--actions", "turn left*3, 2*4", *outputs]) == 0
    out, err = capsys.readouterr()
    assert "7 steps" in out
    assert "100%" in err
    with Image.open(gif) as image:
        assert getattr(image, "n_frames", 1) == 8
        assert image.info["duration"] == 100
    with Image.open(sheet) as image:
        assert image.width == 8 * (112 + 2) + 2
    assert len(list(tmp_path.iterdir())) == 2


def test_full_disk_leaves_nothing(
    world: World,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def no_space(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(record, "open_environment", lambda *_, **__: (*world, "map"))
    monkeypatch.setattr("os.replace", no_space)
    target = tmp_path / "a.gif"
    assert main(["record", "simple", "--steps", "1", "--out", str(target)]) == 1
    last = capsys.readouterr().err.splitlines()[-1]
    assert last == f"jaxenstein: cannot write {target}: no space left on device"
    assert list(tmp_path.iterdir()) == []


def test_actions_by_number_name_and_count() -> None:
    assert parse_actions("2,2, forward*3 ,interact,0 * 2", NAMES) == [2, 2, 2, 2, 2, 4, 0, 0]


def test_forward_policy_walks_then_tries_the_door_then_turns() -> None:
    policy = Forward(NAMES, np.random.default_rng(0))
    policy.DRIFT = 0.0
    moving = [policy.choose(np.array([i, 0.0])) for i in range(5)]
    assert moving == [2] * 5
    wall = np.array([4.0, 0.0])
    stuck = [policy.choose(wall) for _ in range(12)]
    assert stuck[:2] == [4, 2]
    assert stuck[2] in (0, 1)
    assert stuck.count(2) >= 2


def test_random_policy_takes_every_action() -> None:
    policy = RandomPolicy(5, np.random.default_rng(0))
    assert {policy.choose(np.zeros(2)) for _ in range(100)} == set(range(5))
