"""The T-maze of the documentation keeps the contract, and asks for a memory."""

from __future__ import annotations

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from examples import custom_task
from examples.custom_task import TMaze
from jaxenstein import record

ENV = TMaze(height=24, width=32)
PARAMS = ENV.check_params()
NORTH_AND_WEST = [2] * 19 + [0] * 6 + [2] * 19


def test_it_is_as_short_as_the_documentation_says() -> None:
    assert len(Path(custom_task.__file__).read_text("utf-8").splitlines()) < 100


def test_who_remembers_the_key_gets_all_and_who_does_not_gets_nothing_on_average() -> None:
    keys = jax.random.split(jax.random.key(3), 256)
    play = jax.jit(jax.vmap(custom_task.play, (0, None, None)), static_argnums=1)
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        assert (np.asarray(play(keys, ENV, True)) == 1).all()
        west = np.asarray(play(keys, ENV, False))
    assert set(west.tolist()) == {-1.0, 1.0}
    # Five standard deviations of a fair coin.
    assert abs(west.mean()) < 5 / np.sqrt(256)


def test_the_key_is_all_that_tells_the_arms_apart_and_goes_out_of_sight() -> None:
    _, state = ENV.reset(jax.random.key(0), PARAMS)
    look = jax.jit(lambda arm, time: ENV.observe(state.replace(arm=arm, time=time), PARAMS))
    for time, different in [(0, True), (9, True), (10, False), (99, False)]:
        frames = [np.asarray(look(jnp.int32(arm), jnp.int32(time))) for arm in (0, 1)]
        assert (frames[0] != frames[1]).any() == different


@pytest.mark.parametrize(("arm", "reward"), [(0, 1.0), (1, -1.0)])
def test_an_end_of_an_arm_ends_the_episode_with_its_reward(arm: int, reward: float) -> None:
    seed = next(s for s in range(20) if int(ENV.reset(jax.random.key(s))[1].arm) == arm)
    key = jax.random.key(seed)
    _, state = ENV.reset(key, PARAMS)
    step = jax.jit(lambda state, action: ENV.advance(key, state, action, PARAMS))
    rewards = []
    for action in NORTH_AND_WEST:
        state, value, terminated, _ = step(state, jnp.int32(action))
        rewards.append(float(value))
        if terminated:
            break
    assert rewards == [0.0] * (len(rewards) - 1) + [reward]
    # It ends within half a tile of the middle of the western end.
    assert np.hypot(*(np.asarray(state.position) - (1.5, 1.5))) < 0.5


def test_time_runs_out_and_params_may_differ_within_a_batch() -> None:
    limits = jnp.array([3, 7], jnp.int32)
    params = PARAMS.replace(max_steps_in_episode=limits)
    axes = jax.tree.map(lambda _: None, PARAMS).replace(max_steps_in_episode=0)

    def wait(params):
        _, state = ENV.reset(jax.random.key(0), params)

        def body(state, _):
            _, state, _, _, truncated, _ = ENV.step(jax.random.key(1), state, -1, params)
            return state, truncated

        return jax.lax.scan(body, state, length=10)[1]

    truncated = np.asarray(jax.jit(jax.vmap(wait, (axes,)))(params))
    assert [int(row.argmax()) + 1 for row in truncated] == [3, 7]


def test_the_recorder_takes_it(tmp_path: Path) -> None:
    episode = record(ENV, PARAMS, NORTH_AND_WEST, seed=0)
    assert episode.ending == "terminated"
    assert abs(float(episode.returns[-1])) == 1
    episode.save(tmp_path / "t-maze.gif", every=8)
    assert (tmp_path / "t-maze.gif").stat().st_size > 1000
