"""The oracle's bonus: every tile of an episode pays once."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from jaxenstein import registry


def test_each_tile_pays_when_it_is_new_in_its_episode(monkeypatch: pytest.MonkeyPatch) -> None:
    # The id ends with the test.
    monkeypatch.setattr(registry, "ENTRIES", dict(registry.ENTRIES))
    env, params = jaxenstein.make(
        "experiments.oracle:dmlab-static-01-oracle", height=16, width=16, autoreset=None
    )
    params = params.replace(tile_reward=0.5, goal_reward=0.0)
    # By right angles and almost whole tiles, so that the player gets about.
    drawn = jax.random.choice(jax.random.key(1), jnp.array([0, 1, 2, 2], jnp.int32), (120,))
    actions = jnp.repeat(drawn, 6)

    @jax.jit
    def play(key: jax.Array) -> tuple[jax.Array, jax.Array]:
        def step(state: object, action: jax.Array) -> tuple[object, tuple[jax.Array, jax.Array]]:
            _, state, reward, _, _, info = env.step(key, state, action, params)
            return state, (reward, info["cell"])

        _, state = env.reset(key, params)
        return jax.lax.scan(step, state, actions)[1]

    rewards, cells = (np.asarray(part) for part in play(jax.random.key(0)))
    seen: set[tuple[int, int]] = set()
    for reward, cell in zip(rewards, map(tuple, cells.tolist()), strict=True):
        assert reward == pytest.approx(0.0 if cell in seen else 0.5)
        seen.add(cell)
    assert len(seen) > 5
