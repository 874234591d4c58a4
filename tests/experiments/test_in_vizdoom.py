"""Training in the game: gymnax' interface, on games that count steps."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("flax")
pytest.importorskip("gymnasium")

from experiments import in_vizdoom
from jaxenstein.baselines.runs.trained import Trained


class Counter:
    """A session that ends after two steps plus its number."""

    def __init__(self, env: Any, params: Any, seed: int) -> None:
        self.number, self.begun = seed, 0
        self.reset(0)

    def reset(self, seed: int) -> np.ndarray:
        self.begun, self.rewards = self.begun + 1, []
        self.terminated = self.truncated = self.over = False
        self.info: dict[str, bool] = {"success": False}
        self.observation = np.array([self.number, self.begun, 0], np.float32)
        return self.observation

    def step(self, action: int) -> np.ndarray:
        self.rewards.append(10.0 * self.number + action)
        self.over = len(self.rewards) == 2 + self.number
        self.terminated, self.truncated = self.over, False
        self.info = {"success": self.over and self.number == 1}
        if not self.over:
            self.observation = np.array(
                [self.number, self.begun, len(self.rewards)], np.float32
            )  # fmt: skip
        return self.observation


def test_games_step_independently_and_restart(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(in_vizdoom, "GameSession", Counter)
    env: Any = SimpleNamespace(action_space=None, observation_space=None, frame_skip=4)
    games = in_vizdoom.Games(env, None, 2)

    @jax.jit
    def play(key: jax.Array) -> Any:
        obs, state = jax.vmap(lambda k: games.reset(k, None))(jax.random.split(key))

        def step(carry: Any, t: jax.Array) -> Any:
            keys = jax.random.split(jax.random.fold_in(key, t))
            actions = jnp.stack([t, t + 1])
            values = jax.vmap(lambda k, s, a: games.step(k, s, a, None))(keys, carry, actions)
            return values[1], (values[0], *values[2:])

        return obs, jax.lax.scan(step, state, jnp.arange(6, dtype=jnp.int32))[1]

    first, (obs, reward, terminated, truncated, info) = play(jax.random.key(0))
    # Each began once when it was made, and once more by reset.
    np.testing.assert_array_equal(first, [[0, 2, 0], [1, 2, 0]])
    np.testing.assert_array_equal(reward[:, 0], np.arange(6))
    np.testing.assert_array_equal(reward[:, 1], np.arange(6) + 11)
    np.testing.assert_array_equal(terminated[:, 0], [0, 1, 0, 1, 0, 1])
    np.testing.assert_array_equal(terminated[:, 1], [0, 0, 1, 0, 0, 1])
    assert not np.any(truncated)
    np.testing.assert_array_equal(
        info["success"], np.stack([np.zeros(6, bool), terminated[:, 1]], 1)
    )
    np.testing.assert_array_equal(obs[:3, 1], [[1, 2, 1], [1, 2, 2], [1, 3, 0]])
    np.testing.assert_array_equal(info["final_observation"][2, 1], [1, 2, 2])


class Dark(Counter):
    """A session that ends after two steps plus its number, in the dark."""

    def reset(self, seed: int) -> np.ndarray:
        super().reset(seed)
        self.observation = np.zeros((8, 8, 3), np.uint8)
        return self.observation

    def step(self, action: int) -> np.ndarray:
        super().step(action)
        self.observation = np.zeros((8, 8, 3), np.uint8)
        return self.observation

    def close(self) -> None:
        pass


SIZES = "--height 8 --width 8 --num-envs 2 --rollout 4 --minibatches 1 --epochs 1 --features 8"


@pytest.mark.slow
def test_training_takes_the_flags_of_train(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Only this test compiles a training with games."""
    monkeypatch.setattr(in_vizdoom, "GameSession", Dark)
    rows = tmp_path / "rows.jsonl"
    told = f"--env doom-basic {SIZES} --network tiny --seed 3"
    in_vizdoom.main([*told.split(), "--minutes", "1e-6", "--scale", "0.5", "--out", str(rows)])
    first, *_ = [json.loads(line) for line in rows.read_text().splitlines()]
    # Action a of game k gives 10 k + a; rows have the game's own rewards.
    assert first["return_sum"] >= 30
    assert (first["seed"], first["steps"], first["seconds"]) == (3, 8, 0)
    # The first game ends twice; the second, whose episodes have three steps, once.
    assert first["episodes"] == 3


@pytest.mark.slow
def test_agents_are_tested_after_each_part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Only this test trains in parts; the k-th test gives a return of k to each of two episodes."""
    updates: list[int] = []

    def in_game(trained: Trained, *, episodes: int) -> Any:
        updates.append(trained.update)
        values = np.full((1, 2), len(updates))
        return SimpleNamespace(returns=values, successes=values > 3)

    monkeypatch.setattr(in_vizdoom, "evaluate_in_game", in_game)
    rows, run = tmp_path / "rows.jsonl", tmp_path / "run"
    told = f"--env simple {SIZES} --network tiny --seed 3 --total-steps 144 --run {run}"
    in_vizdoom.main([*told.split(), "--out", str(rows)])
    tests = [json.loads(line) for line in rows.read_text().splitlines()]
    # 18 updates of 8 decisions in twelve parts; halves are rounded to even numbers.
    assert updates == [2, 3, 4, 6, 8, 9, 10, 12, 14, 15, 16, 18]
    assert [row["steps"] for row in tests] == [8 * update for update in updates]
    assert [row["return_sum"] for row in tests] == [2 * (k + 1) for k in range(12)]
    assert [row["successes"] for row in tests] == [0, 0, 0] + 9 * [2]
    seconds = [row["seconds"] for row in tests]
    assert seconds == sorted(seconds)


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ("--gamma 2", "a finite number from 0 to 1, not 2.0"),
        ("--env doom-bassic", "doom-basic"),
        ("--minutes 0", "--minutes: must be a finite number above 0, not 0"),
        ("--minutes nan", "--minutes: must be a finite number above 0, not nan"),
        ("--env simple", "ViZDoom has no scenario for 'simple'"),
        ("--run new --clock cpu", "--run takes neither --minutes nor --clock nor --scale"),
    ],
)
def test_wrong_flags_are_told_in_a_line(wrong: str, told: str, tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match=told):
        in_vizdoom.main(["--out", str(tmp_path / "rows"), "--env", "doom-basic", *wrong.split()])
    assert not any(tmp_path.iterdir())
