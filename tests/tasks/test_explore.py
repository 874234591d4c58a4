"""DeepMind Lab's explore levels: levels by search on the host, rules in plain steps."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from jaxenstein.errors import SettingError
from jaxenstein.maps.reach import walking_distances
from jaxenstein.maps.symbols import DEFAULT_WALL
from jaxenstein.players import play, player_of
from jaxenstein.tasks.explore import Explore

IDS = ("goal-locations", "object-locations", "object-rewards")


@functools.cache
def task(name):
    env, params = jaxenstein.make(f"dmlab-explore-{name}", height=8, width=8)
    return env, env.check_params(params)


@functools.cache
def programs(name):
    env, params = task(name)
    reset = jax.jit(jax.vmap(lambda key: env.init_state(key, params)))
    return reset, jax.jit(jax.vmap(lambda k, s, a: env.advance(k, s, a, params)))


def first_states(name, count):
    return jax.device_get(programs(name)[0](jax.random.split(jax.random.key(2), count)))


def cells(places):
    return {tuple(cell) for cell in np.floor(places).astype(int).tolist()}


def check_levels(name, count):
    states = first_states(name, count)
    for i in range(count):
        walls = states.level.walls[i, 0]
        rooms = states.starting[i] // 5
        starts = states.starts[i, : states.starting[i]]
        things = states.things[i][states.there[i]]
        assert len(cells(starts)) == 5 * rooms
        assert len(cells(things)) == len(things)
        assert not cells(starts) & cells(things)
        assert cells(states.position[i][None]) <= cells(starts)
        assert (states.left[i] == states.there[i]).all()
        if name == "object-rewards":
            assert (len(things), states.good[i].sum()) == (4, 2)
        else:
            assert len(things) == (1 if name == "goal-locations" else 2 * rooms)
            assert states.good[i].all()
        steps = walking_distances(walls == 0, tuple(cells(things)))
        columns, rows = np.floor(starts).astype(int).T
        assert (steps[:, rows, columns] > 0).all()
        assert set(np.unique(walls)) <= {0, *range(DEFAULT_WALL, DEFAULT_WALL + rooms + 1)}


@pytest.mark.parametrize("name", IDS)
def test_levels(name):
    check_levels(name, 256)


@pytest.mark.slow
@pytest.mark.parametrize("name", [*IDS, "goal-locations-large", "object-locations-large"])
def test_thousands_of_levels(name):
    check_levels(name, 4096)


def stand(states, places):
    return states.replace(position=jnp.asarray(places))


@pytest.mark.parametrize("name", IDS)
def test_all_that_pays_begins_a_new_round(name):
    """Thing after thing, in all of 64 levels, against a list kept on the host."""
    step = programs(name)[1]
    states = first_states(name, 64)
    pay = {"goal-locations": 10, "object-locations": 1, "object-rewards": 2}[name]
    count = states.things.shape[1]
    left, over = np.array(states.there), np.zeros(64, bool)
    for number in range(count):
        # Close enough, and in no wall: things lie in the middle of tiles.
        before, near = states, states.things[:, number] + np.array([0.39, 0], np.float32)
        keys = jax.random.split(jax.random.key(number), 64)
        after, reward, terminated, info = step(keys, stand(states, near), np.full(64, -1))
        there = left[:, number] & np.asarray(before.there[:, number])
        good = np.asarray(before.good[:, number])
        np.testing.assert_array_equal(reward, np.where(there, np.where(good, pay, -1), 0))
        np.testing.assert_array_equal(info["took"], there & good)
        left[:, number] = False
        over = ~np.any(left & np.asarray(before.good), axis=1)
        left[over] = False
        np.testing.assert_array_equal(info["respawned"], over)
        np.testing.assert_array_equal(info["success"], over)
        assert not np.asarray(terminated).any()
        for i in np.flatnonzero(over):
            starts = before.starts[i, : before.starting[i]]
            assert cells(np.asarray(after.position[i])[None]) <= cells(starts)
            assert (after.left[i] == before.there[i]).all()
        states = states.replace(left=np.where(over[:, None], False, after.left))
        if name == "object-rewards":
            # They lie elsewhere now, on places of the level.
            moved = [
                cells(after.things[i]) != cells(before.things[i]) for i in np.flatnonzero(over)
            ]
            assert not moved or np.mean(moved) > 0.5
            assert all(cells(after.things[i]) <= cells(before.places[i]) for i in range(64))
        if over.all():
            break
    assert over.all()


@pytest.mark.parametrize("name", IDS)
def test_the_expert_takes_what_pays(name):
    env, params = task(name)
    states = programs(name)[0](jax.random.split(jax.random.key(5), 16))
    params = params.replace(max_steps_in_episode=jnp.int32(400))
    out = play(env, player_of(env), params, jax.random.key(0), states)
    assert (np.asarray(out.successes) >= 1).all()
    if name == "object-rewards":
        # Two good ones a round, and none of the bad ones on the way.
        assert (np.asarray(out.returned) >= 4 * np.asarray(out.successes)).mean() > 0.8


def test_bad_settings_are_refused():
    with pytest.raises(SettingError, match="kind must be one of"):
        Explore(kind="keys")  # pyright: ignore[reportArgumentType]
    with pytest.raises(SettingError, match="must be 9 at most together"):
        Explore(starts=6)
