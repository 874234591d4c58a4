"""Rollouts of random frames, and helpers for the tests of all bonuses."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxenstein.baselines import Bonus, Config, Experience, HParams
from jaxenstein.baselines.config import algorithm
from jaxenstein.baselines.loop import Loop
from jaxenstein.baselines.observations import ObservationSpec, Part

KEY = jax.random.key(0)
SPEC = ObservationSpec((Part((8, 8), True, "bounds", 0, 255), Part((2,), False, "bounds")))
BATCH, STEPS, ACTIONS = 4, 6, 3


def experience(seed: int = 0, steps: int = STEPS, batch: int = BATCH) -> Experience:
    rng = np.random.default_rng(seed)
    frames = jnp.asarray(rng.integers(0, 256, (steps + 1, batch, 8, 8)).astype(np.uint8))
    vector = jnp.asarray(rng.random((steps + 1, batch, 2)).astype(np.float32))
    action = jnp.asarray(rng.integers(0, ACTIONS, (steps, batch)).astype(np.int32))
    return Experience((frames, vector), action, jnp.asarray(rng.random((steps, batch)) < 0.2))


def simple_world(steps: int = 12, batch: int = 16) -> Experience:
    """Action 0 keeps the frame, 1 inverts it, 2 blackens it.

    Black frames stay black or turn white, so the episode ends there and the truth is hidden.
    """
    rng = np.random.default_rng(0)
    action = rng.integers(0, 3, (steps, batch)).astype(np.int32)
    frames = [rng.integers(40, 216, (batch, 8, 8)).astype(np.uint8)]
    black = np.zeros((steps, batch), bool)
    for t, chosen in enumerate(action):
        last = frames[-1]
        following = np.select(
            [(chosen == k)[:, None, None] for k in range(3)], [last, 255 - last, 0 * last]
        )
        black[t] = chosen == 2
        frames.append(following.astype(np.uint8))
    hidden = np.concatenate([np.zeros((1, batch), bool), np.cumsum(black, 0)[:-1] > 0])
    vector = np.zeros((steps + 1, batch, 2), np.float32)
    return Experience(
        (jnp.asarray(np.stack(frames)), jnp.asarray(vector)),
        jnp.asarray(action),
        jnp.asarray(hidden),
    )


def loop_of(algo: str, **settings: Any) -> Loop:
    """A loop with the bonus of an algorithm, but without environments and network."""
    small = {"num_envs": BATCH, "minibatches": 2, "rollout": STEPS, "total_steps": 1000}
    sizes = dict.fromkeys(("rnd_hidden", "rnd_output", "icm_latent", "icm_hidden"), 8)
    config = Config.of(
        {"algo": algo, **small, **sizes, "e3b_hidden": 8, "e3b_latent": 6} | settings
    )
    nothing: Any = None
    return Loop(
        config=config,
        simulator=nothing,
        network=nothing,
        bonus=algorithm(algo).bonus(SPEC, ACTIONS, config),
        slots=0,
        discount=0.99,
        clocks=None,
    )


def bonus_of(algo: str, **settings: Any) -> Any:
    return loop_of(algo, **settings).bonus


def numbers_of(algo: str, **values: Any) -> HParams:
    return loop_of(algo).numbers(HParams.of(algo, {"bonus_gamma": 0.9} | values))


def leaves(tree: Any) -> list[np.ndarray[Any, Any]]:
    return [np.asarray(leaf) for leaf in jax.tree.leaves(tree)]


def train(
    bonus: Bonus, state: Any, data: Experience, numbers: HParams, updates: int
) -> tuple[Any, dict[str, jax.Array]]:
    """The state after some updates on the same rollout, and the metrics of the last."""
    update, metrics = jax.jit(bonus.update), {}
    for key in jax.random.split(KEY, updates):
        state, metrics = update(key, state, numbers, data, jnp.float32(3e-3))
    return state, metrics
