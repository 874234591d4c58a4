"""Training with 64-bit numbers enabled in JAX."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np
import pytest

pytest.importorskip("flax")

from jaxenstein.baselines import Config, HParams, Learner
from tests.baselines import worlds
from tests.baselines.worlds import Memory
from tests.x64 import enable_x64

BONUS_SIZES = worlds.BONUS_SIZES | {
    "e3b": {**worlds.BONUS_SIZES["e3b"], "e3b_embedding": "temporal"}
}


@pytest.mark.parametrize(
    "algo",
    # RND has all of PPO in it.
    ["rnd", *(pytest.param(algo, marks=pytest.mark.variant) for algo in ("ppo", "icm", "e3b"))],
)
def test_trainings_have_the_same_types_and_curves(algo: str) -> None:
    env = Memory(delay=4)
    params = env.default_params.replace(max_steps_in_episode=3)
    config = Config(
        algo=algo, bonus=BONUS_SIZES[algo], num_envs=4, rollout=6, minibatches=2, epochs=2,
        features=8, hidden=8, head=8, total_steps=240, normalise_bonus=True, persistence=0.5,
        random_clocks=True, stop_success=0.99,
    )  # fmt: skip

    def train(on: bool) -> Any:
        with enable_x64(on):
            learner = Learner(env, params, config)
            state = learner.init(jax.random.key(0))
            state, metrics = learner.train_chunk(state, HParams(learning_rate=1e-3), 2)
            # Which does not depend on the algorithm.
            played = None
            if algo == "rnd":
                played = learner.evaluate(state.params, jax.random.key(1), 2)
            return jax.device_get((state, metrics, played))

    one, other = train(False), train(True)
    for (path, narrow), wide in zip(
        jax.tree_util.tree_flatten_with_path(one)[0], jax.tree.leaves(other), strict=True
    ):
        name = jax.tree_util.keystr(path)
        assert (wide.dtype, wide.shape) == (narrow.dtype, narrow.shape), name
        # Ratios of two small variances.
        loose = "explained" in name
        np.testing.assert_allclose(
            wide, narrow, rtol=1e-2 if loose else 1e-3, atol=1e-2 if loose else 1e-5, err_msg=name
        )
