"""Rockets by exact small cases: when one leaves, what it meets, and the monster that walks away."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from jaxenstein.tasks.doom.arsenal import Arsenal
from jaxenstein.tasks.doom.fixed import ONE, to_fixed
from jaxenstein.tasks.doom.weapons import ROCKET_LAUNCHER, Slot, pull

SIZE: dict[str, Any] = {"height": 4, "width": 6, "autoreset": None}


def fired(held: list[int], wait: int) -> list[int]:
    """The tics in which a launcher fires, with ATTACK held where there is a 1."""
    trigger, tics = Arsenal([Slot(ROCKET_LAUNCHER)], raise_tics=wait).trigger(), []
    for tic, attack in enumerate(held):
        trigger, fires = pull(ROCKET_LAUNCHER, trigger, jnp.bool_(attack))
        tics += [tic] * bool(fires)
    return tics


def test_a_launcher_fires_in_the_tics_of_the_game() -> None:
    """In ViZDoom's Rocket Basic; who holds ATTACK while it is raised must release it first."""
    assert fired([0] * 3 + [1] * 50, 3) == [11, 31, 51]
    assert fired([0] * 5 + [1] + [0] * 20, 3) == [13]
    assert fired([1] * 50, 3) == []
    assert fired([0, 0] + [1] * 50, 3) == []
    assert fired([1] * 9 + [0] + [1] * 20, 3) == [18]


@pytest.fixture(scope="module")
def range_() -> Any:
    """Rocket Basic, and a function that plays 40 tics: rewards, ends, the rocket's x."""
    env, params = jaxenstein.make("doom-rocket-basic", **SIZE)
    attack = env.index_of("attack")

    @jax.jit
    def play(state: Any) -> Any:
        def step(state: Any, tic: jax.Array) -> Any:
            action = jnp.where(tic == 3, attack, 0)
            after, reward, ends, _ = env.advance(jax.random.key(0), state, action, params)
            return after, (reward, ends, after.rockets.position[0, 0], after.rockets.flies[0])

        return jax.lax.scan(step, state, jnp.arange(40))[1]

    return env.reset(jax.random.key(0), params)[1], play


@pytest.mark.parametrize(("off", "hits"), [(30.99, True), (31, False), (-30.99, True)])
def test_a_rocket_without_width_just_hits_and_just_misses(
    range_: Any, off: float, hits: bool
) -> None:
    state, play = range_
    target = jnp.array([0, to_fixed(32 + off)], jnp.int32)
    reward, ends, x, flies = map(np.asarray, play(state.replace(target=target)))
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
    """Predict Position: its first state, and a function that plays tics of one action."""
    env, params = jaxenstein.make("doom-predict-position", **SIZE)

    @jax.jit
    def play(state: Any, shoots: jax.Array, key: jax.Array) -> Any:
        def step(state: Any, given: Any) -> Any:
            tic, key = given
            action = jnp.where(shoots & (tic >= 2), env.index_of("attack"), 0)
            after, reward, ends, _ = env.advance(key, state, action, params)
            return after, (reward, ends, after.monsters.position[0], after.rockets.flies[0])

        given = jnp.arange(70), jax.random.split(key, 70)
        return jax.lax.scan(step, state, given)[1]

    return env.reset(jax.random.key(0), params)[1], play


def walking(state: Any, x: float, y: float) -> Any:
    """The state with the monster there, on its way north."""
    place = jnp.array([[to_fixed(x), to_fixed(y)]], jnp.int32)
    monster = state.monsters.replace(
        position=place,
        direction=jnp.array([2]),
        steps_left=jnp.array([0]),
        just_attacked=jnp.array([False]),
    )
    return state.replace(monsters=monster, line=place[0, 0], northward=jnp.bool_(True))


def test_the_monster_walks_and_turns_back_as_recorded_in_the_game(prediction: Any) -> None:
    """Twenty units in every third tic; near the end it waits a step, then goes on to the wall."""
    state, play = prediction
    start = walking(state, 52.43, 526.59)
    place = np.asarray(play(start, jnp.bool_(False), jax.random.key(1))[2]) / ONE
    wanted = [526.59] * 2 + [546.59] * 3 + [566.59] * 6 + [586.59] * 3 + [606.59] * 3
    np.testing.assert_allclose(place[:17, 1], wanted, atol=0.01)
    np.testing.assert_allclose(place[:17, 0], 52.43, atol=0.01)
    # North is the wall: it turns to the side, and in the end comes back.
    assert (place[17] != place[16]).any()
    assert (np.abs(place) <= 609).all()


def test_a_missed_rocket_ends_the_episode_46_tics_later(prediction: Any) -> None:
    state, play = prediction
    far = walking(state, 52.43, -560)
    reward, ends, _, flies = map(np.asarray, play(far, jnp.bool_(True), jax.random.key(1)))
    assert np.flatnonzero(flies)[0] == 10
    assert np.flatnonzero(ends).tolist() == [56]
    np.testing.assert_allclose(reward, -0.001)


def test_a_rocket_that_meets_the_monster_kills_it(prediction: Any) -> None:
    state, play = prediction
    # It needs 8 tics to leave and 28 to get there, in which the monster walks 240 units.
    ahead = walking(state, 52.43, -300)
    reward, ends, place, _ = map(np.asarray, play(ahead, jnp.bool_(True), jax.random.key(1)))
    hit = int(np.flatnonzero(reward > 0.5)[0])
    assert reward[hit] == pytest.approx(0.999)
    assert abs(place[hit, 1]) < (31 + 11) * ONE
    assert np.flatnonzero(ends).tolist()[:1] == [hit + 1]
