"""Params from ranges in every adapter, compared with episodes assembled by hand."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np
import pytest

from jaxenstein.adapters.batch import Batch
from jaxenstein.errors import SettingError
from jaxenstein.params import Range, draw_numbers
from tests.adapters.corridor import FORWARD, N, make_crowd
from tests.adapters.players import STREAMS, GymnaxPlayer, SB3Player, StoaPlayer
from tests.adapters.test_batch import Loop, assert_same, at, compare

pytestmark = [
    pytest.mark.usefixtures("plain_frames"),
    pytest.mark.filterwarnings("ignore::DeprecationWarning:(gymnax|stoa|chex|flax|distrax).*"),
]
RANGES = {"living_reward": Range(-2.0, -1.0), "move_distance": Range(0.3, 0.7)}
LIMIT = 4
IDLE = np.zeros(N, np.int32)


def make_ranged() -> tuple[Any, Any, Any]:
    """The environment, and its params without and with ranges."""
    env, usual = make_crowd()
    usual = usual.replace(max_steps_in_episode=LIMIT)
    return env, usual, usual.replace(**RANGES)


class DrawingLoop(Loop):
    """One environment by the native functions, with plain numbers in each episode."""

    def __init__(self, env: Any, usual: Any, mode: str | None, seed: int) -> None:
        super().__init__(env, usual, mode, [seed])
        self.usual = usual

    def reset(self, i: int) -> tuple[Any, dict[str, Any]]:
        numbers, used = draw_numbers(RANGES, self.draw(i))
        self.params = self.usual.replace(**numbers)
        observation, self.states[i] = self.env.reset(used, self.params)
        self.over[i] = False
        return observation, self.describe(self.states[i], self.params)


@pytest.mark.parametrize("mode", ["same-step", "next-step", None])
def test_each_episode_of_a_batch_draws_its_own_params(mode: Any) -> None:
    env, usual, ranged = make_ranged()
    limits = np.array([4, 6, 9])
    batch = Batch(env, ranged.replace(max_steps_in_episode=limits), N, autoreset=mode)
    assert batch.drawn_params.living_reward == RANGES["living_reward"]
    loops = [
        DrawingLoop(env, usual.replace(max_steps_in_episode=limit), mode, 5 + i)
        for i, limit in enumerate(limits)
    ]
    observation, info = batch.reset(5)
    for i, loop in enumerate(loops):
        assert_same(at((observation, info), i), loop.reset(0))
    seen, rng = set(), np.random.default_rng(0)
    for time in range(24):
        actions = rng.choice([0, FORWARD, FORWARD], N)
        out = batch.step(actions)
        compare(out, [loop.step(0, one) for loop, one in zip(loops, actions, strict=True)])
        if time == 7 or (mode is None and time % 5 == 0):
            mask = np.array([True, False, True])
            observation, info = batch.reset(mask=mask)
            for i in np.flatnonzero(mask):
                assert_same(at((observation, info), i), loops[i].reset(0))
        for name in RANGES:
            own = [np.float32(getattr(loop.params, name)) for loop in loops]
            np.testing.assert_array_equal(getattr(batch.drawn_params, name), own)
            seen |= set(map(float, own))
    assert len(seen) > 12


def numbers_of(seed: int, calls: int) -> float:
    """The living reward of the episode after a number of steps and resets of a stream."""
    key = jax.random.fold_in(jax.random.key(seed), 0)
    for _ in range(calls):
        key, _ = jax.random.split(key)
    return draw_numbers(RANGES, jax.random.split(key)[1])[0]["living_reward"].item()


@pytest.mark.parametrize("player", STREAMS)
def test_adapter_seeds_determine_drawn_params(player: Any) -> None:
    env, _, ranged = make_ranged()
    ours = player(env, ranged, N)
    for seed in (7, 7, 8):
        ours.reset(seed)
        for episode in range(3):
            # A reset and the steps of an episode each split the stream.
            wanted = [numbers_of(seed + i, episode * (LIMIT + 1)) for i in range(N)]
            for _ in range(LIMIT):
                np.testing.assert_allclose(ours.step(IDLE).reward, wanted, rtol=1e-6)


@pytest.mark.parametrize("player", [GymnaxPlayer, StoaPlayer])
def test_functional_adapters_draw_from_given_keys(player: Any) -> None:
    env, _, ranged = make_ranged()
    ours = player(env, ranged, N)
    ours.reset(3)
    keys = jax.random.split(jax.random.key(3), N)
    split = jax.vmap(jax.random.split)
    resets = steps = keys
    if player is StoaPlayer:
        resets, keys = split(keys).T
    for _ in range(3):
        wanted = jax.vmap(lambda key: draw_numbers(RANGES, key)[0]["living_reward"])(resets)
        for _ in range(LIMIT):
            if player is StoaPlayer:
                keys, steps = split(keys).T
            np.testing.assert_allclose(ours.step(IDLE).reward, wanted, rtol=1e-6)
        resets = split(steps)[:, 1]
    # The other functions of a state, mapped or not, use the params its episode drew.
    if player is GymnaxPlayer:
        one = jax.tree.map(lambda leaf: leaf[0], ours.state)
        after, reward, *_ = ours.of.step_env(keys[0], one, 0, ours.params)[1:]
        np.testing.assert_allclose(reward, one.numbers["living_reward"], rtol=1e-6)
        assert after.time == one.time + 1
        assert not ours.of.is_terminal(after, ours.params)
        assert ours.of.get_obs(after, ours.params).shape == (8, 12, 3)


def test_ranges_of_a_batch_can_change_between_episodes() -> None:
    env, usual, ranged = make_ranged()
    batch = Batch(env, ranged, N)
    batch.reset(0)
    before = [batch.step(IDLE).reward for _ in range(2)]
    batch.params = ranged.replace(living_reward=(5, 6))
    after = [batch.step(IDLE).reward for _ in range(3)]
    np.testing.assert_allclose([*before[1:], *after[:2]], [before[0]] * 3, rtol=1e-6)
    assert np.all((after[2] >= 5) & (after[2] <= 6))
    with pytest.raises(SettingError, match="living_reward: after the first reset a range can only"):
        batch.params = ranged.replace(living_reward=1.0)
    with pytest.raises(SettingError, match="living_reward, move_distance: after the first reset"):
        batch.params = usual


def test_sb3_attributes() -> None:
    env, usual, _ = make_ranged()
    venv = SB3Player(env, usual, N).of
    venv.set_attr("living_reward", (-2.0, -1.0))
    assert venv.get_attr("living_reward") == [(-2.0, -1.0)] * N
    with pytest.raises(SettingError, match="living_reward can have a range in all environments"):
        venv.set_attr("living_reward", 1.0, [0])
    with pytest.raises(SettingError, match="move_distance can have a range in all environments"):
        venv.set_attr("move_distance", (0.1, 0.2), [0, 1])
    venv.seed(4)
    venv.reset()
    np.testing.assert_allclose(venv.step(IDLE)[1], venv.get_attr("living_reward"))
