"""Rockets by exact small cases: when one leaves, what it meets, and the monster that walks away."""

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from jaxenstein.tasks.doom.fixed import ONE
from tests.tasks.doom.cases import make, place, places, player, started


@pytest.fixture(scope="module")
def range_() -> Any:
    return started("doom-rocket-basic")


@pytest.mark.parametrize(("off", "hits"), [(30.99, True), (31, False), (-30.99, True)])
def test_zero_width_rocket_just_hits_and_just_misses(range_: Any, off: float, hits: bool) -> None:
    env, state, play = range_
    actions = [0] * 3 + [env.index_of("attack")] + [0] * 36
    reward, ends, _, after = play(state.replace(target=place(0, 32 + off)), actions)
    x, flies = after.rockets.position[:, 0, 0], after.rockets.flies[:, 0]
    # As recorded in the game: it leaves in tic 11, is at -290 after it, and goes on by 20.
    np.testing.assert_array_equal(x[11:24] / ONE, -290 + 20 * np.arange(13))
    assert reward[:11].tolist() == [-1] * 11
    assert reward[11] == -6
    if hits:
        # It meets the monster's box at -30, and the game ends in the tic after it.
        assert reward[24] == 105
        assert np.flatnonzero(ends).tolist()[:1] == [25]
        assert flies[11:24].all()
        assert not flies[24]
    else:
        # No wall stops it, either, as in the game.
        assert (reward[12:] == -1).all()
        assert flies[11:].all()
        assert x[39] / ONE == 270


@pytest.fixture(scope="module")
def prediction() -> Any:
    return started("doom-predict-position")


def walking(state: Any, x: float, y: float) -> Any:
    """The state with the monster there, on its way north."""
    monster = state.monsters.replace(
        position=places((x, y)),
        direction=jnp.array([2]),
        steps_left=jnp.array([0]),
        just_attacked=jnp.array([False]),
    )
    return state.replace(monsters=monster, line=place(x, y)[0], northward=jnp.bool_(True))


def test_monster_walks_and_turns_back_as_in_the_game(prediction: Any) -> None:
    """Twenty units in every third tic; near the end it waits a step, then goes on to the wall."""
    _, state, play = prediction
    after = play(walking(state, 52.43, 526.59), [0] * 70, seed=1).state
    path = after.monsters.position[:, 0] / ONE
    wanted = [526.59] * 2 + [546.59] * 3 + [566.59] * 6 + [586.59] * 3 + [606.59] * 3
    np.testing.assert_allclose(path[:17, 1], wanted, atol=0.01)
    np.testing.assert_allclose(path[:17, 0], 52.43, atol=0.01)
    # North is the wall: it turns to the side, and in the end comes back.
    assert (path[17] != path[16]).any()
    assert (np.abs(path) <= 609).all()


def test_missed_rocket_ends_the_episode_after_46_tics(prediction: Any) -> None:
    env, state, play = prediction
    actions = [0] * 2 + [env.index_of("attack")] * 68
    reward, ends, _, after = play(walking(state, 52.43, -560), actions, seed=1)
    assert np.flatnonzero(after.rockets.flies[:, 0])[0] == 10
    assert np.flatnonzero(ends).tolist() == [56]
    np.testing.assert_allclose(reward, -0.001)


def test_rocket_kills_the_monster_it_hits(prediction: Any) -> None:
    env, state, play = prediction
    # It needs 8 tics to leave and 28 to get there, in which the monster walks 240 units.
    actions = [0] * 2 + [env.index_of("attack")] * 68
    reward, ends, _, after = play(walking(state, 52.43, -300), actions, seed=1)
    hit = int(np.flatnonzero(reward > 0.5)[0])
    assert reward[hit] == pytest.approx(0.999)
    assert abs(after.monsters.position[hit, 0, 1]) < (31 + 11) * ONE
    assert np.flatnonzero(ends).tolist()[:1] == [hit + 1]


def test_aim_reward_is_paid_for_better_aim_until_the_shot(prediction: Any) -> None:
    """The monster walks north at 20 units in 3 tics, so a rocket meets it in the north of it."""
    env, state, _ = prediction
    params = make("doom-predict-position")[1].replace(aim_reward=2.0, living_reward=0.0)
    left, attack = env.index_of("turn left"), env.index_of("attack")
    actions = [left] * 6 + [0] * 4 + [attack] * 2 + [left] * 20
    before = walking(state, 52.43, -100)
    reward, _, _, after = player(env, params)(before, actions, seed=1)
    x, y = 52.43 + 544, np.append(-100, after.monsters.position[:, 0, 1] / ONE)
    meets = np.arctan2(y + 20 / 3 * (8 + np.hypot(x, y) / 20), x)
    turned = np.append(0, after.angle.astype(np.uint32).view(np.int32) * np.pi / 2**31)
    off = np.abs(meets - turned)
    shot = int(np.flatnonzero(after.trigger.ammo == 0)[0])
    assert 10 < shot < 31
    np.testing.assert_allclose(reward[:shot], 2 * (off[:-1] - off[1:])[:shot], atol=0.02)
    assert reward[:6].sum() > 0.1
    np.testing.assert_array_equal(reward[shot:], 0)
