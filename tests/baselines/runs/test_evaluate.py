"""Trained agents: the policy of a run directory, evaluation, watching."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from PIL import Image

pytest.importorskip("flax")

import jaxenstein
from jaxenstein import SettingError
from jaxenstein.baselines.runs.agents import WAYS, best_run, evaluate, load_policy
from jaxenstein.baselines.runs.folder import RunFolder
from jaxenstein.baselines.runs.options import resolve
from jaxenstein.baselines.runs.trained import load_trained, score_of
from jaxenstein.cli import main
from jaxenstein.comparison import gather
from jaxenstein.episodes.recorder import record
from jaxenstein.episodes.session import Session
from jaxenstein.interactive.game import AgentGame
from jaxenstein.results import read_results
from tests.baselines.tiny import OPTIONS, tiny, untrained_run

pytestmark = pytest.mark.usefixtures("plain_frames")


def test_greedy_policy_matches_network_over_whole_sequence(folder: RunFolder) -> None:
    """Against the network unrolled over all observations at once, not step by step."""
    learner = folder.experiment.learner
    policy = load_policy(folder.path, run=1, greedy=True)
    restored = folder.restore()
    assert restored is not None
    weights = jax.tree.map(lambda leaf: leaf[1], restored.state.params)
    # Twice, to detect memory left from the first episode.
    for seed in (3, 4):
        session = Session(policy.env, policy.params, seed)
        frames, actions = [], []
        while not session.over:
            frames.append(session.observation)
            actions.append(policy(session))
            session.step(actions[-1])
        first = jnp.arange(len(actions)) == 0
        previous = jnp.asarray([-1, *actions[:-1]], jnp.int32)
        logits, _, _ = jax.jit(learner.network.unroll)(
            weights,
            jnp.stack(frames)[:, None],
            previous[:, None],
            first[:, None],
            learner.network.initial_memory(1),
        )
        gaps = np.sort(np.asarray(logits[:, 0]), axis=-1)
        clear = gaps[:, -1] - gaps[:, -2] > 1e-4
        np.testing.assert_array_equal(
            np.argmax(np.asarray(logits[:, 0]), axis=-1)[clear], np.array(actions)[clear]
        )
        assert clear.sum() > len(actions) // 2


def test_sampled_policy_repeats_per_seed(folder: RunFolder) -> None:
    policy = load_policy(folder.path)
    env, params = policy.env, policy.params

    def played(seed: int) -> list[float]:
        return record(env, params, policy, seed=seed).positions.ravel().tolist()

    assert played(1) == played(1)
    assert len({tuple(played(seed)) for seed in range(4)}) > 1


def test_evaluation_counts_whole_episodes(folder: RunFolder) -> None:
    trained = load_trained(folder.path)
    result = evaluate(trained, episodes=12, seed=1)
    assert result.returns.shape == (2, 12)
    # The goal is the only reward, and the horizon is 10.
    np.testing.assert_array_equal(result.returns, result.successes.astype(np.float32))
    assert result.lengths.min() >= 1
    assert result.lengths.max() <= 10
    assert np.all(result.lengths[~result.successes] == 10)
    again = evaluate(trained, episodes=12, seed=1)
    np.testing.assert_array_equal(result.lengths, again.lengths)
    assert (result.names, result.seed, result.actions) == (("seed-0", "seed-1"), 1, "sampled")
    assert result.environment == trained.experiment.environment
    plain = json.loads(json.dumps(score_of(result)))
    assert plain["episodes"] == 12
    assert plain["runs"]["seed-1"]["length"] == pytest.approx(result.lengths[1].mean())
    assert plain["length"]["mean"] == pytest.approx(result.lengths.mean())


def test_command_evaluates_and_writes_animation(
    folder: RunFolder, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    film, report = tmp_path / "agent.gif", tmp_path / "report.json"
    arguments = ["--episodes", "12", "--json", str(report), "--gif", str(film), "--run", "1"]
    assert main(["evaluate", str(folder.path), *arguments]) == 0
    shown = capsys.readouterr().out
    assert f"{folder.path}: update 0 of 6, 2 runs, 12 episodes each" in shown
    assert "tiny seed-1:" in shown
    trained = load_trained(folder.path)
    for read, (name, greedy) in zip(read_results(report), WAYS.items(), strict=True):
        played = evaluate(trained, episodes=12, greedy=greedy)
        assert (read.policy, read.actions, read.names) == ("tiny", name, ("seed-0", "seed-1"))
        np.testing.assert_array_equal(read.returns, played.returns)
        np.testing.assert_array_equal(read.lengths, played.lengths)
        np.testing.assert_array_equal(read.successes, played.successes)
        assert read.environment.build() == trained.experiment.environment.build()
    with Image.open(film) as image:
        assert 2 <= getattr(image, "n_frames", 1) <= 11


def test_command_evaluates_each_point_of_a_grid(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = untrained_run(tmp_path / "tiny", tiny(grid={"clip": [0.1, 0.2]}))
    report = tmp_path / "report.json"
    arguments = ["evaluate", str(folder.path), "--episodes", "3", "--json", str(report)]
    assert main(arguments) == 0
    assert "\nsampled, clip 0.2 " in capsys.readouterr().out
    together = evaluate(load_trained(folder.path), episodes=3)
    found = [one for one in read_results(report) if one.actions == "sampled"]
    assert [one.policy for one in found] == ["tiny, clip 0.1", "tiny, clip 0.2"]
    assert {one.names for one in found} == {("seed-0", "seed-1")}
    np.testing.assert_array_equal(np.concatenate([one.lengths for one in found]), together.lengths)
    for flag in (["--run", "1"], ["--greedy"]):
        assert main([*arguments, *flag]) == 2
        assert "--run and --greedy choose the agent of the film" in capsys.readouterr().err


def test_command_evaluates_in_another_environment(
    folder: RunFolder, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["evaluate", str(folder.path), "--episodes", "2"]
    assert main([*arguments, "--param", "max_steps_in_episode=3"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1].split()[-1] == lines[-2].split()[-1] == "3"
    assert main([*arguments, "--set", "width=20"]) == 2
    assert "was trained on observations [[12, 16, 3]]" in capsys.readouterr().err
    # Another environment, seen as the one before was; but not with other actions.
    assert main([*arguments, "--env", "simple", "--param", "max_steps_in_episode=4"]) == 0
    assert capsys.readouterr().out.splitlines()[-1].split()[-1] == "4"
    assert main([*arguments, "--env", "doom-basic"]) == 2
    assert "was trained with the actions turn left, " in capsys.readouterr().err


def test_command_names_the_split_and_can_play_the_other(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = {name: value for name, value in OPTIONS.items() if name != "map"}
    given["env"] = "minigrid-red-blue-doors-6x6"
    given["settings"] = {"split": "train", "test_fraction": 0.5}
    folder = untrained_run(tmp_path / "tiny", resolve(given))
    arguments = ["evaluate", str(folder.path), "--episodes", "2"]
    for more, line in (
        ([], "levels of the train split (test_fraction 0.5); --set split=test "),
        (["--set", "split=test"], "levels of the test split (test_fraction 0.5); "),
    ):
        assert main([*arguments, *more]) == 0
        assert line in capsys.readouterr().out


def test_record_plays_agent_in_its_training_environment(
    folder: RunFolder, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    film, saved = tmp_path / "agent.gif", tmp_path / "agent.json"
    common = ["record", "--policy", str(folder.path), "--out", str(film)]
    assert main([*common, "--save", str(saved)]) == 0
    assert "tiny seed-0" in capsys.readouterr().out
    assert main(["replay", str(saved)]) == 0
    assert "the same bit for bit" in capsys.readouterr().out
    # In other environments it gets images of its own size; its own environment can be changed.
    assert main([*common, "simple", "--steps", "3", "--run", "1", "--greedy"]) == 0
    assert "simple: 3 steps" in capsys.readouterr().out
    assert main([*common, "--param", "max_steps_in_episode=2", "--run", "1"]) == 0
    assert "tiny seed-1: 2 steps" in capsys.readouterr().out
    assert main([*common, "--width", "20"]) == 2
    assert "was trained on observations [[12, 16, 3]]" in capsys.readouterr().err
    assert main(["record", "simple", "--run", "1", "--out", str(film)]) == 2
    assert "--run and --greedy need --policy with a run directory" in capsys.readouterr().err
    for more in ([], ["--run", "1"]):
        assert main(["record", "--policy", "missing", *more, "--out", str(film)]) == 2
        assert "there is no run directory 'missing'" in capsys.readouterr().err


def test_best_run_acts_by_default(folder: RunFolder, tmp_path: Path) -> None:
    shutil.copytree(folder.path, tmp_path / "run")
    copied = RunFolder.open(tmp_path / "run")
    assert best_run(copied) == 0

    def write(sums: list[tuple[int, float, int]]) -> None:
        """Ten bad updates of both runs, then one with these episodes, returns and lengths."""
        names = ("episodes", "return_sum", "length_sum")
        early: list[Any] = [{"episodes": 9, "return_sum": 9.0 * (1 - r)} for r in (0, 1)] * 10
        late: list[Any] = [dict(zip(names, row, strict=True)) for row in sums]
        text = "".join(
            json.dumps({"update": 1, "steps": 8} | row) + "\n" for row in (*early, *late)
        )
        (copied.path / "metrics.jsonl").write_text(text)

    write([(4, 1.0, 30), (2, 1.0, 20)])
    assert best_run(copied) == 1
    assert load_policy(copied.path).name == "run seed-1"
    assert load_policy(copied.path, run=0).name == "run seed-0"
    # Of equal returns the shorter episodes, and runs without an episode come last.
    write([(2, 1.0, 20), (4, 2.0, 60)])
    assert best_run(copied) == 0
    write([(0, 0.0, 0), (4, -2.0, 60)])
    assert best_run(copied) == 1
    # A killed training has left a row of only the first run.
    write([(4, 1.0, 30), (2, 1.0, 20), (9, 0.0, 30)])
    assert best_run(copied) == 1


def test_batch_policy_drives_gymnasium_environments(folder: RunFolder) -> None:
    """Compare with the policy for one environment, whose memory is reset by hand."""
    gymnasium = pytest.importorskip("gymnasium")
    from jaxenstein.adapters.gymnasium_vector import GymnasiumVectorEnv

    policy = load_policy(folder.path, run=1, greedy=True)
    envs = GymnasiumVectorEnv(policy.env, policy.params, num_envs=8)
    assert isinstance(envs, gymnasium.vector.VectorEnv)
    batch = policy.batch(8, seed=3)
    observations, _ = envs.reset(seed=0)
    first, ended, begun, acted = np.ones(8, bool), np.zeros(8, bool), 0, set()
    learner, weights = policy._learner, policy._weights
    carries = [learner.initial_carry()] * 8
    for _ in range(25):
        actions = batch.act(observations, first)
        begun += int(first.sum())
        acted |= set(actions.tolist())
        for number in range(8):
            carry = learner.initial_carry() if first[number] else carries[number]
            wanted, carries[number] = learner.policy(weights, observations[number], carry)
            assert int(wanted) == actions[number]
        observations, _, terminated, truncated, _ = envs.step(actions)
        # In Gymnasium's default mode the step after the end returns the first observation.
        first, ended = ended, terminated | truncated
    assert begun > 16
    assert len(acted) > 1


def test_sampled_actions_of_a_batch_repeat_with_the_seed(folder: RunFolder) -> None:
    policy = load_policy(folder.path)
    observations, first = np.zeros((8, 12, 16, 3), np.uint8), np.ones(8, bool)

    def drawn(seed: int) -> list[list[int]]:
        batch = policy.batch(8, seed=seed)
        return [batch.act(observations, first).tolist() for _ in range(6)]

    assert drawn(1) == drawn(1)
    assert drawn(1) != drawn(2)
    assert len(set(map(tuple, drawn(1)))) > 1


def test_watched_game_advances_at_its_frame_rate(folder: RunFolder) -> None:
    policy = load_policy(folder.path)
    game = AgentGame(policy.env, policy.params, policy, seed=2, fps=10.0, note="watching")
    expected = record(policy.env, policy.params, policy, seed=2)
    now = 5.0
    assert game.due(now) == 0
    assert game.advance(now)
    assert not game.advance(now + 0.05)
    assert game.due(now + 0.05) == pytest.approx(0.05)
    while not game.session.over:
        now += 0.11
        assert game.advance(now)
    assert len(game.session.actions) == expected.steps
    assert game.due(now) is None
    press: Any = SimpleNamespace(kind="press", key="r")
    game.handle(press, now)
    assert game.session.seed == 3
    assert game.advance(now + 1)
    press.key = "p"
    game.handle(press, now)
    assert not game.advance(now + 2)
    assert not any("turn" in line for line in game.help())


def test_errors_name_missing_run_checkpoint_and_actions(folder: RunFolder, tmp_path: Path) -> None:
    with pytest.raises(SettingError, match="has runs 0 to 1, not 2"):
        load_policy(folder.path, run=2)
    RunFolder.create(tmp_path / "new", folder.experiment)
    with pytest.raises(SettingError, match="has no checkpoint yet"):
        load_policy(tmp_path / "new")
    policy = load_policy(folder.path)
    env, params = jaxenstein.make("health-gathering", height=12, width=16)
    with pytest.raises(SettingError, match="was trained with the actions turn left, "):
        policy.check(env, params)


@pytest.mark.parametrize("command", ["evaluate", "play", "export"])
def test_error_names_module_of_imported_environment(
    command: str, folder: RunFolder, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = tmp_path / "run"
    shutil.copytree(folder.path, run)
    config = json.loads((run / "config.json").read_text())
    config["environment"] |= {"id": "my_module:my-task", "map": None}
    (run / "config.json").write_text(json.dumps(config))
    out = str(tmp_path / "agent.npz")
    words = {
        "evaluate": [str(run)],
        "play": ["--policy", str(run)],
        "export": [str(run), "--out", out],
    }
    assert main([command, *words[command]]) == 2
    told = capsys.readouterr().err
    assert "the module of the environment 'my_module:my-task' has not been imported" in told
    assert "--import my_module" in told


def test_here_and_in_vizdoom_the_rules_are_the_same(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The agent trained with a hundredth of the rewards and a penalty for its death."""
    pytest.importorskip("vizdoom")
    file = tmp_path / "both.json"
    told = ["evaluate", "pretrained/doom-health-gathering", "--in", "vizdoom", "--episodes", "1"]
    told += ["--param", "max_steps_in_episode=48", "--json", str(file)]
    assert main(told) == 0
    assert "ignores" not in capsys.readouterr().out
    results = read_results(file)
    assert [one.in_game for one in results] == [False, False, True, True]
    assert [one.returns.tolist() for one in results] == [[[48]]] * 4
    assert all(one.environment.params == {"max_steps_in_episode": 48} for one in results)
    policies = ["doom-health-gathering", "doom-health-gathering in ViZDoom"]
    assert [*gather([(None, file)], "greedy")] == policies
    assert main([*told, "--param", "living_reward=2"]) == 0
    assert "ViZDoom has its own rules and ignores living_reward\n" in capsys.readouterr().out
