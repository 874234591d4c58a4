"""Training in the game: gymnax' interface, on games that count steps."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("flax")
pytest.importorskip("gymnasium")

from experiments import in_vizdoom


class Counter:
    """A session that ends after two steps plus a seventh of its number."""

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
