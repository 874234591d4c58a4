"""Agents that play Doom from pixels: their tables, their figure, and the command that adds them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("flax")
pytest.importorskip("matplotlib")

from docs import doom_pixels, measured
from jaxenstein.baselines.runs.agents import evaluate, load_policy
from jaxenstein.baselines.runs.options import resolve
from jaxenstein.cli import main
from jaxenstein.cli.arguments import Parser
from jaxenstein.cli.opening import given_training
from jaxenstein.cli.train import fill
from jaxenstein.settings import spec_from

PAGE = "<!-- doom agents -->\n<!-- end -->\nbetween\n<!-- doom looks -->\n<!-- end -->\n"
# A hundredth of the game's rewards.
BASIC = {"kill_reward": 1.06, "shot_reward": -0.05, "living_reward": -0.01}
TINY = (
    "--height 12 --width 16 --frame-skip 4 --num-envs 4 --rollout 16 --minibatches 2 --features 8"
    " --hidden 8 --head 8 --seeds 2 --total-steps 512"
)


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder in place of the repository's docs."""
    for name in ("FILE", "PAGE", "PICTURE", "TRAINERS"):
        path = tmp_path / getattr(doom_pixels, name).name
        monkeypatch.setattr(doom_pixels, name, path)
    monkeypatch.setattr(doom_pixels, "PACKAGED", tmp_path)
    doom_pixels.PAGE.write_text(PAGE)
    return tmp_path


def test_the_page_has_what_was_measured() -> None:
    page = doom_pixels.PAGE.read_text("utf-8")
    assert doom_pixels.with_tables(page) == page
    assert [page.count(f"<!-- doom {name} -->") for name in ("agents", "looks")] == [1, 1]
    assert doom_pixels.PICTURE.exists() == any(doom_pixels._drawn())


@pytest.mark.parametrize(
    ("params", "scale"),
    [
        ({}, 1.0),
        (BASIC, 0.01),
        (BASIC | {"max_steps_in_episode": 8, "discount": 0.9}, 0.01),
        (BASIC | {"shot_reward": -0.1}, None),
        ({"living_reward": -0.01}, None),
    ],
)
def test_scale_of_rewards(params: dict[str, float], scale: float | None) -> None:
    assert doom_pixels.reward_scale(spec_from({"env": "doom-basic", "params": params})) == scale


@pytest.mark.parametrize(
    "flags",
    [
        "--frame-skip 2 --total-steps 20000 --anneal --entropy 0.02 "
        "--param damage_factor=0:2 --param way_reward=0.2",
        "--no-recurrent --convolutions 8x4x16,4x2x32 --set show_weapon=false",
        "--seeds 2 --grid gamma=0.9,0.99",
        "",
    ],
)
def test_flags_train_the_same_agents(flags: str) -> None:
    told = "--out runs --config doom-pixels --env doom-deadly-corridor --look plain"
    fill(parser := Parser())

    def experiment(flags: str) -> Any:
        return resolve(given_training(parser.parse_args(f"{told} {flags}".split())))

    found = doom_pixels.flags_of(experiment(flags))
    assert sorted(found.split()) == sorted(flags.split())
    assert experiment(found) == experiment(flags)


def test_without_rows_the_page_has_no_tables(files: Path) -> None:
    measured.main(["doom-pixels"])
    assert doom_pixels.PAGE.read_text() == PAGE
    assert not doom_pixels.PICTURE.exists()


def test_training_in_the_game_is_stored_seed_by_seed(files: Path) -> None:
    """The first seed has an episode in the first half of the time, the second seed has none."""
    first = [(30, 1, 4.0), (90, 2, 10.0), (120, 1, 20.0)]
    for seed, rows in enumerate((first, [(120, 2, 6.0)])):
        lines = [dict(zip(("seconds", "episodes", "return_sum"), row, strict=True)) for row in rows]
        (files / f"{seed}.jsonl").write_text("\n".join(map(json.dumps, lines)))
    told = ["doom-trainer", "Another", "doom-basic", *map(str, sorted(files.glob("*.jsonl")))]
    measured.main(told)
    measured.main(told)
    (row,) = json.loads(doom_pixels.FILE.read_text())["trainers"]
    assert (row["id"], row["trainer"], row["minutes"][-1]) == ("doom-basic", "Another", 2.0)
    values = [[v for v in of_seed if v is not None] for of_seed in row["values"]]
    assert values == [[4.0, 5.0, 20.0], [3.0]]
    first_at, second_at = (row["values"][seed].index(v) for seed, v in ((0, 4.0), (1, 3.0)))
    assert row["minutes"][first_at] == pytest.approx(0.5, abs=0.08)
    assert row["minutes"][second_at] == 2
    assert doom_pixels.TRAINERS.stat().st_size > 1000


@pytest.mark.slow
@pytest.mark.usefixtures("plain_frames")
def test_agents_are_added_from_their_run(files: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Only this test runs the whole command; our environment stands for the game."""
    games: list[Any] = []

    def in_game(trained: Any, **how: Any) -> Any:
        games.append(trained.experiment.environment)
        return evaluate(trained, **how)

    monkeypatch.setattr(doom_pixels, "evaluate_in_game", in_game)
    monkeypatch.setattr(doom_pixels, "SHOWN", "plain")
    run = files / "run"
    rewards = [f"--param={name}={value}" for name, value in BASIC.items()]
    horizon = ["--param", "max_steps_in_episode=64"]
    assert not main(
        ["train", "--env", "doom-basic", "--out", str(run), *rewards, *horizon, *TINY.split()]
    )
    measured.main(["doom-pixels", str(run), "--episodes", "4"])
    # The same row again takes the place of the first.
    measured.main(["doom-pixels", str(run), "--episodes", "4"])
    (row,) = json.loads(doom_pixels.FILE.read_text())["agents"]
    assert (row["id"], row["look"], row["scale"], row["seeds"]) == ("doom-basic", "plain", 0.01, 2)
    assert games[0].params == {"max_steps_in_episode": 64}
    # Returns are the game's: each of the 64 tics costs 1, unless the monster dies.
    for place in ("here", "in ViZDoom"):
        for way in ("greedy", "sampled"):
            mean, low, high = row["tests"][place][way]["return"]
            assert low <= mean <= high
            assert -64 - 5 * 8 <= mean <= 106
            assert mean == pytest.approx(round(mean * 8) / 8, abs=1e-3)
    random, expert = (row["players"][name]["return"][0] for name in ("random", "expert"))
    assert random < 0 < expert
    values = np.array(row["curve"]["values"], np.float64)
    assert values.shape == (2, len(row["curve"]["minutes"]))
    assert np.nanmin(values) < -20
    table = doom_pixels.PAGE.read_text()
    assert f"`{row['flags']}` |" in table
    assert f"| `doom-basic` | {random:.4g} | {expert:.3g} |" in table
    assert "looks -->\n<!-- end -->" in table
    assert table.count("](images/results/doom-pixels.png)\n<!-- end -->") == 1
    assert doom_pixels.PICTURE.stat().st_size > 1000
    packaged = load_policy(files / "doom-basic-pixels.npz")
    assert (packaged.params.kill_reward, packaged.params.max_steps_in_episode) == (106, 64)


@pytest.mark.slow
@pytest.mark.usefixtures("plain_frames")
def test_agents_are_tested_in_all_looks(files: Path) -> None:
    pytest.importorskip("vizdoom")
    run = files / "run"
    horizon = ["--param", "max_steps_in_episode=16", "--look", "random"]
    assert not main(
        ["train", "--env", "doom-health-gathering", "--out", str(run), *horizon, *TINY.split()]
    )
    measured.main(["doom-pixels", "--looks", str(run), "--episodes", "2"])
    (row,) = json.loads(doom_pixels.FILE.read_text())["looks"]
    places = [*doom_pixels.LOOKS, doom_pixels.GAME, doom_pixels.OTHER]
    assert [*row["tests"]] == ["episodes", *places]
    for place in places:
        assert row["tests"][place]["sampled"] == {"return": [16, 16, 16], "success": [1, 1, 1]}
    assert "| `random` | 16 (16 to 16) |" in doom_pixels.PAGE.read_text()
