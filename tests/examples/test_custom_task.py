"""The task of the documentation: its two ends and its visible things."""

from __future__ import annotations

import runpy
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from examples import custom_task
from examples.custom_task import Fruit
from jaxenstein import record

WEST = [2] * 19 + [0] * 6 + [2] * 19


def test_reaching_a_place_ends_the_episode_with_its_reward() -> None:
    env = Fruit(height=24, width=32)
    episodes = [record(env, env.check_params(), WEST, seed=seed) for seed in range(6)]
    assert {episode.ending for episode in episodes} == {"terminated"}
    assert {float(episode.returns[-1]) for episode in episodes} == {-1.0, 1.0}


def test_frames_show_where_the_apple_is() -> None:
    env = Fruit(height=24, width=32)
    params = env.check_params()
    _, state = env.reset(jax.random.key(0), params)
    look = jax.jit(lambda apple: env.observe(state.replace(apple=apple), params))
    west, east = (np.asarray(look(jnp.int32(apple))) for apple in (0, 1))
    assert (west != east).any()


def test_program_runs(capsys: pytest.CaptureFixture[str]) -> None:
    runpy.run_path(str(Path(custom_task.__file__)), run_name="__main__")
    assert "mean return of always going west" in capsys.readouterr().out
