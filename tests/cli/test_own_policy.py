"""Users' own policies on the command line: `--policy MODULE:FUNCTION`."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import jaxenstein
from jaxenstein.cli import main
from jaxenstein.cli.own_policy import load_own
from jaxenstein.episodes.session import Session
from jaxenstein.results import read_results

pytestmark = pytest.mark.usefixtures("plain_frames")

# Forward, except for a left turn in every third step; and invalid agents.
MODULE = '''
"""Agents of a user."""
import jax.numpy as jnp

def every_third(env, params):
    left, forward = env.index_of("turn left"), env.index_of("forward")

    def policy(carry, obs, key):
        return carry + 1, jnp.where(carry % 3 == 2, left, forward)

    return policy, 0

def forward(env, params):
    return lambda obs, key: env.index_of("forward"), None

def alone(env, params):
    return lambda obs, key: 0

def logits(env, params):
    return lambda obs, key: jnp.zeros(env.num_actions), None

nothing = 3
'''


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """The name of that module, in the current folder and not imported."""
    name = f"agents_of_{tmp_path.name}"
    (tmp_path / f"{name}.py").write_text(MODULE, "utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    (tmp_path / "map.txt").write_text("#######\n#S...G#\n#######\n")
    return name


WORLD = ["--map-file", "map.txt", "--heading", "0", "--set", "height=8", "--set", "width=12"]


def test_evaluate_plays_own_policy(module: str, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["evaluate", "--policy", f"{module}:forward", *WORLD, "--episodes", "3"]
    assert main([*arguments, "--json", "r.json", "--gif", "a.gif"]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert shown[0] == f"{module}:forward in map: 3 episodes"
    # Four tiles less the radius of the goal in steps of 0.15: 25.
    assert shown[2].split() == [
        "its",
        "own",
        "1",
        "1",
        "to",
        "1",
        *("100.0%", "100.0%", "to", "100.0%", "25"),
    ]
    (results,) = read_results("r.json")
    assert (results.policy, results.actions) == (f"{module}:forward", None)
    np.testing.assert_array_equal(results.lengths, [[25, 25, 25]])
    with Image.open("a.gif") as film:
        assert getattr(film, "n_frames", 1) > 20


def test_the_draw_that_a_policy_is_made_for_is_printed(
    module: str, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["evaluate", "--policy", f"{module}:forward", *WORLD, "--episodes", "1"]
    assert main([*arguments, "--param", "turn_angle=0.1:0.4"]) == 0
    assert ", drawn from 0.1:0.4 by --seed 0" in capsys.readouterr().out


def test_memory_resets_with_each_episode(module: str) -> None:
    env, params = jaxenstein.from_ascii("#######\n#S...G#\n#######", heading=0, height=8, width=12)
    from jaxenstein.cli.opening import import_modules

    import_modules([module])
    own = load_own(f"{module}:every_third", env, params)
    session = Session(env, params, 0)
    for seed in (1, 2):
        session.reset(seed)
        for _ in range(7):
            session.step(own(session))
        forward, left = env.index_of("forward"), env.index_of("turn left")
        assert session.actions == [forward, forward, left, forward, forward, left, forward]


def test_map_files_are_tasks_of_their_own_names(
    module: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("hall.txt").write_text("#########\n#S.....G#\n#########\n")
    play = ["evaluate", "--policy", f"{module}:forward", *WORLD, "--episodes", "1"]
    assert main([*play, "--json", "map.json"]) == 0
    assert main([*play, "--map-file", "hall.txt", "--json", "hall.json"]) == 0
    assert main([*play, "--set", "name=own", "--json", "own.json"]) == 0
    capsys.readouterr()
    assert main(["score", "map.json", "hall.json", "own.json"]) == 0
    rows = capsys.readouterr().out.splitlines()[1:4]
    assert [row.split()[0] for row in rows] == ["hall", "map", "own"]


def test_record_and_play_accept_own_policy(module: str, capsys: pytest.CaptureFixture[str]) -> None:
    where = ["--map-file", "map.txt", "--heading", "0", "--height", "8", "--width", "12"]
    given = ["record", *where, "--policy", f"{module}:every_third"]
    assert main([*given, "--steps", "6", "--save", "walk.json"]) == 0
    trajectory = jaxenstein.load_trajectory("walk.json")
    assert trajectory.actions == (2, 2, 0, 2, 2, 0)
    capsys.readouterr()
    # Before a window opens.
    assert main(["play", *where, "--policy", f"{module}:logits"]) == 2
    assert "must be one whole number of shape ()" in capsys.readouterr().err
    assert main([*given, "--out", "a.gif", "--greedy"]) == 2
    assert "--run and --greedy need --policy with a run directory" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--policy", "{}:every_thrid"], "has no function 'every_thrid', did you mean 'every_thi"),
        (["--policy", "{}:nothing"], "has no function 'nothing'"),
        (["--policy", "{}:alone"], "must take (env, params) and return (policy, carry)"),
        (["--policy", "os:getcwd"], "return (policy, carry), with carry None for a policy without"),
        (["--policy", "{}:logits"], "must be one whole number of shape ()"),
        (["--policy", "{}_not:forward"], "there is no module"),
        (["--policy", "{}"], "has no player 'agents_of"),
        (["--policy", "{}:forward", "--greedy"], "--run, --greedy and --in need RUN"),
        (["--policy", "{}:forward", "runs/x"], "give either RUN or --policy MODULE:FUNCTION"),
        ([], "give either RUN or --policy MODULE:FUNCTION"),
    ],
)
def test_wrong_policies_are_refused(
    module: str, arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    given = [word.format(module) for word in arguments]
    assert main(["evaluate", *given, *WORLD]) == 2
    assert message in capsys.readouterr().err


def test_missing_environment_is_reported(module: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["evaluate", "--policy", f"{module}:forward"]) == 2
    assert "give an environment with --env ID" in capsys.readouterr().err


def test_error_for_policy_given_as_run_names_the_flag(
    module: str, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("flax")
    for text in (f"{module}:forward", f"{module}.py"):
        assert main(["evaluate", text]) == 2
        told = capsys.readouterr().err
        assert "neither a run directory nor a .npz file" in told
        assert "--policy MODULE:FUNCTION (see 'Agents of your own' in docs/training.md)" in told
