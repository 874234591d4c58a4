"""The configs of this package: names, contents, and their list."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import pytest

pytest.importorskip("flax")

from jaxenstein.baselines.runs.configs import configs, find_config, listed
from jaxenstein.baselines.runs.options import read_file, resolve
from jaxenstein.cli import build_parser, main
from jaxenstein.cli.opening import given_training
from jaxenstein.errors import SettingError

AGENTS = Path(__file__).parents[3] / "docs" / "agents.json"


@pytest.mark.parametrize("algo", ["ppo", "rnd", "icm"])
@pytest.mark.parametrize("config", configs())
def test_config_files_resolve_to_experiments(config: str, algo: str) -> None:
    if read_file(find_config(config)).get("look") == "game":
        pytest.importorskip("vizdoom", reason="the game's pictures come with it")
    flags = ["train", "--out", "x", "--config", config, "--algo", algo]
    experiment = resolve(given_training(build_parser().parse_args(flags)))
    assert experiment.config.algo == algo
    if config.startswith("figure3/"):
        # The values of the paper.
        found = experiment.config
        assert len(experiment.runs) == 5
        assert experiment.environment.settings == {"height": 64, "width": 64}
        assert (found.rollout, found.epochs, found.hidden, found.features) == (128, 4, 256, 256)


def test_list_shows_every_config(capsys: pytest.CaptureFixture) -> None:
    rows = {row.name: row for row in listed()}
    assert list(rows) == list(configs())
    for name, file in configs().items():
        told, row = tomllib.loads(file.read_text("utf-8")), rows[name]
        assert row.environment == told.get("env", "a map")
        assert (row.frame_skip, row.decisions) == (told.get("frame_skip", 1), told["total_steps"])
        assert row.algo == told.get("algo", "ppo")
        assert row.about[:1].isupper()
        assert row.about.endswith(".")
        assert len(row.about) < 100
    assert main(["list", "--configs"]) == 0
    shown = capsys.readouterr().out.splitlines()
    line = next(line for line in shown if line.startswith("key-door-skip6 "))
    assert line.split()[:5] == ["key-door-skip6", "key-door", "rnd", "6", "300,000"]


def test_configs_of_all_scoreboard_agents_exist() -> None:
    trained = {row["config"] for row in json.loads(AGENTS.read_text("utf-8"))}
    assert len(trained) > 10
    assert trained <= set(configs())


def test_names_are_found_and_paths_take_precedence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert find_config("room") == find_config("room", tmp_path) == configs()["room"]
    assert find_config(Path("figure3") / "simple") == configs()["figure3/simple"]
    # A folder with that name is not a file.
    (tmp_path / "room").mkdir()
    assert find_config("room") == configs()["room"]
    (tmp_path / "simple-skip6").write_text("seeds = 2\n")
    assert find_config("simple-skip6") == Path("simple-skip6")
    assert find_config("simple-skip6", tmp_path) == tmp_path / "simple-skip6"


@pytest.mark.parametrize(
    ("given", "near"),
    [
        ("rom", "'room'"),
        ("simple-skip6.toml", "'simple-skip6'"),
        ("experiments/room.toml", "'room'"),
        ("figure3/simpel", "'figure3/simple' or 'figure3-skip3/simple'"),
    ],
)
def test_error_suggests_the_nearest_name(
    given: str, near: str, capsys: pytest.CaptureFixture
) -> None:
    message = f"cannot read {given}: no such file, and this package has no config {given!r}"
    with pytest.raises(SettingError) as raised:
        find_config(given)
    assert str(raised.value).startswith(f"{message}, did you mean {near}?; ")
    assert main(["sweep", "--config", given, "--out", "x"]) == 2
    assert message in capsys.readouterr().err


def test_unreadable_path_is_not_mistaken_for_a_name() -> None:
    with pytest.raises(SettingError, match=r"^cannot read aaa.*: file name too long$"):
        read_file(find_config("a" * 300))
