"""All options of an environment are flags of every command with an environment."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest
from PIL import Image

from jaxenstein.cli import build_parser, main
from jaxenstein.cli.opening import given_options
from jaxenstein.errors import SettingError
from jaxenstein.settings import changed, given_by, spec_from
from jaxenstein.tasks.first_person import SEEN, FirstPerson

# Each command with its other required flags, and the flag for the environment.
COMMANDS = {
    "play": ["simple"],
    "record": ["simple", "--out", "a.gif"],
    "rollout": ["simple"],
    "bench": [],
    "train": ["--env", "simple", "--out", "x"],
    "sweep": ["--env", "simple", "--out", "x"],
}


@pytest.fixture(params=COMMANDS)
def command(request: pytest.FixtureRequest) -> str:
    if request.param in ("train", "sweep"):
        pytest.importorskip("flax")
    return request.param


def test_every_setting_is_a_flag_of_every_command(
    command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        main([command, "--help"])
    shown = capsys.readouterr().out
    assert {"height", "observation", "frame_skip"} <= set(SEEN)
    for name in (*SEEN, "map_file", "heading", "horizon", "set", "param", "seed"):
        assert f"--{name.replace('_', '-')}" in shown


def test_flags_become_settings_and_params(command: str) -> None:
    arguments = [
        *("--fov", "90", "--frame-skip=2", "--observation", "depth", "--horizon", "7"),
        *("--look", "random", "--set", "look_range=0.5", "--look-seeds", "3,9"),
        *("--set", "sprite_layers=2", "--param", "discount=0.5", "--param", "goal-reward=3"),
    ]
    options = build_parser().parse_args([command, *COMMANDS[command], *arguments])
    env, params = spec_from({"env": "simple", **given_options(options)}).build()
    settings = {"field_of_view": 90, "frame_skip": 2, "observation": "depth", "sprite_layers": 2}
    settings |= {"look": "random", "look_range": 0.5, "look_seeds": (3, 9)}
    assert {name: getattr(env, name) for name in settings} == settings
    numbers = {"discount": 0.5, "goal_reward": 3, "max_steps_in_episode": 7}
    assert {name: float(getattr(params, name)) for name in numbers} == numbers


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--set", "move_distance=2"], "that make returns, --param move_distance=..."),
        (["--param", "height=8"], "is a setting, not a param: use --set height=8"),
        (["--param", "discout=1"], "unknown param 'discout', did you mean 'discount'"),
        (["--set", "hieght=8"], "unknown setting 'hieght', did you mean 'height'"),
        (["--set", "height"], "--set must be NAME=VALUE, not 'height'"),
        (["--height", "0"], "height"),
        (["--frame-skip", "x"], "must be a whole number from 1 to 64, not 'x'"),
    ],
)
def test_mistakes_give_one_line_errors(
    command: str,
    arguments: list[str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main([command, *COMMANDS[command], *arguments]) == 2
    told = capsys.readouterr().err
    assert message in told
    assert told.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_given_look_replaces_look_of_a_run(tmp_path: Path) -> None:
    Image.new("RGB", (8, 8)).save(tmp_path / "floor.png")
    trained = spec_from({"env": "simple", "look": "random", "look_seeds": [0, 100]})
    other = changed(trained, {"settings": {"look_seeds": [100, 200], "look_range": 0.5}})
    assert (
        other.build()[0]
        == spec_from(
            {"env": "simple", "look": "random", "look_seeds": [100, 200], "look_range": 0.5}
        ).build()[0]
    )
    plain = changed(trained, {"settings": {"look": "plain"}}).build()[0]
    assert isinstance(plain, FirstPerson)
    assert plain.look == "plain"
    dressed = spec_from({"env": "simple", "textures": str(tmp_path)})
    assert "textures" not in changed(dressed, {"look": "random"}).settings
    averaged = {"env": "doom-basic", "settings": {"look": "random", "samples": 2}}
    for look, left in (("plain", {"look"}), ("random", {"look", "samples"})):
        other = changed(spec_from(averaged), {"settings": {"look": look}})
        assert set(other.settings) == left
    with pytest.raises(SettingError, match="look_seeds needs look='random'"):
        spec_from({"env": "simple", "look_seeds": [0, 100]})


def test_spec_round_trips_through_options() -> None:
    given = {
        "map": "####\n#SG#\n####",
        "regions": "####\n#12#\n####",
        "heading": 90,
        "height": 8,
        "settings": {"ceiling": [1, 2, 3]},
        "params": {"discount": 0.5},
    }
    spec = spec_from(given)
    assert spec_from(given_by(spec)) == spec
    other = spec_from({"env": "health-gathering", "settings": {"hud": True}, "width": 9})
    assert spec_from(given_by(other)) == other


def test_changed_spec_keeps_shared_settings() -> None:
    spec = spec_from(
        {"env": "health-gathering", "settings": {"hud": True}, "height": 9, "horizon": 5}
    )
    longer = changed(spec, {"horizon": 6})
    assert longer == dataclasses.replace(spec, params={"max_steps_in_episode": 6})
    elsewhere = changed(spec, {"env": "simple"})
    assert (elsewhere.id, elsewhere.settings, elsewhere.params) == ("simple", {"height": 9}, {})


def test_two_maps_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("flax")
    (tmp_path / "maze.txt").write_text("####\n#SG#\n####\n")
    (tmp_path / "maze.faces.txt").write_text("")
    config = tmp_path / "maze.toml"
    for given, told in (
        ('map_file = "maze.txt"\nmap = "###"', "give either map or map_file"),
        ('map_file = "maze.txt"\nfaces = "###"', "give either faces or map_file"),
        ('env = "simple"\nregions = "###"', "regions needs a map"),
    ):
        config.write_text(given)
        assert main(["train", "--config", str(config), "--out", str(tmp_path / "run")]) == 2
        assert told in capsys.readouterr().err
