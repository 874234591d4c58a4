"""DeepMind Lab's explore levels: levels by search on the host, rules in plain steps."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from jaxenstein.errors import SettingError
from jaxenstein.maps.reach import walking_distances
from jaxenstein.maps.symbols import DEFAULT_WALL, DOOR_LABELS
from jaxenstein.players import play, player_of
from jaxenstein.tasks.explore import Explore
from jaxenstein.tasks.maze_ways import sample_path

IDS = ("goal-locations", "object-locations", "object-rewards")
# Of things to take two kinds: one that pays, and several that pay or cost.
MARKED_IDS = [
    pytest.param(name, marks=[pytest.mark.slow] * (name == "object-locations")) for name in IDS
]
OBSTRUCTED = ("obstructed-goals", "obstructed-goals-large")


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
            assert len(things) == (1 if name.startswith("goal-locations") else 2 * rooms)
            assert states.good[i].all()
        steps = walking_distances(walls == 0, tuple(cells(things)))
        columns, rows = np.floor(starts).astype(int).T
        assert (steps[:, rows, columns] > 0).all()
        assert set(np.unique(walls)) <= {0, *range(DEFAULT_WALL, DEFAULT_WALL + rooms + 1)}


@pytest.mark.parametrize("name", MARKED_IDS)
def test_levels(name):
    check_levels(name, 256)


@pytest.mark.slow
@pytest.mark.parametrize("name", [*IDS, "goal-locations-large", "object-locations-large"])
def test_thousands_of_levels(name):
    check_levels(name, 4096)


def placed_at(states, places):
    return states.replace(position=jnp.asarray(places))


@pytest.mark.parametrize("name", MARKED_IDS)
def test_new_round_begins_after_all_rewards(name):
    """Take one thing after another in 64 levels, compared with a list on the host."""
    step = programs(name)[1]
    states = first_states(name, 64)
    pay = {"goal-locations": 10, "object-locations": 1, "object-rewards": 2}[name]
    count = states.things.shape[1]
    left, over = np.array(states.there), np.zeros(64, bool)
    for number in range(count):
        # Close enough, and in no wall: things lie in the middle of tiles.
        before, near = states, states.things[:, number] + np.array([0.39, 0], np.float32)
        keys = jax.random.split(jax.random.key(number), 64)
        after, reward, terminated, info = step(keys, placed_at(states, near), np.full(64, -1))
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
            # They are at other places of the level now.
            moved = [
                cells(after.things[i]) != cells(before.things[i]) for i in np.flatnonzero(over)
            ]
            assert not moved or np.mean(moved) > 0.5
            assert all(cells(after.things[i]) <= cells(before.places[i]) for i in range(64))
        if over.all():
            break
    assert over.all()


@pytest.mark.parametrize("name", MARKED_IDS)
def test_expert_collects_rewards(name):
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
    with pytest.raises(SettingError, match="their sum at most 9"):
        Explore(starts=6)
    with pytest.raises(SettingError, match="need kind='goal'"):
        Explore(kind="apples", doors=3)


def doors_of(states, i):
    """The doors of one of several states, as (column, row), and which of them are closed."""
    doors = np.asarray(states.level.doors[i])
    real = doors[:, 0] > 0
    return doors[real], np.asarray(states.closed[i])[real]


def check_doors(name, count):
    states = first_states(name, count)
    shares = []
    for i in range(count):
        doors, closed = doors_of(states, i)
        walls = states.level.walls[i, 0]
        label = np.isin(walls, DOOR_LABELS)
        assert {(c, r) for r, c in np.argwhere(label).tolist()} == set(map(tuple, doors.tolist()))
        floor = (walls == 0) | label
        # Whatever is closed, a way is left from the goal to the start, and with no doors to all.
        everywhere = walking_distances(floor, tuple(cells(states.things[i])))[0]
        columns, rows = np.floor(states.starts[i, : states.starting[i]]).astype(int).T
        assert (everywhere[rows, columns] > 0).all()
        floor[doors[closed, 1], doors[closed, 0]] = False
        (column, row), *_ = cells(states.position[i][None])
        assert walking_distances(floor, tuple(cells(states.things[i])))[0, row, column] > 0
        shares.append(closed.mean() if len(doors) else 0.0)
    assert 0.2 < np.mean(shares) < 0.5


def test_doors_leave_a_path():
    check_doors("obstructed-goals", 256)


@pytest.mark.slow
@pytest.mark.parametrize("name", OBSTRUCTED)
def test_doors_leave_a_path_in_thousands_of_levels(name):
    check_doors(name, 4096)


def digger(walkable, start, end, rng):
    """The same rule on the host: a path with steps back."""
    left = walkable.copy()
    left[start[1], start[0]] = False
    path = [start]
    while path:
        (x, y), ways = path[-1], []
        for way in ((x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)):
            if way == end:
                return [*path, way]
            if left[way[1], way[0]]:
                ways.append(way)
        if not ways:
            path.pop()
            continue
        path.append(ways[rng.integers(len(ways))])
        left[path[-1][1], path[-1][0]] = False
    raise AssertionError("there is no way")


def test_random_paths_match_a_digger():
    walkable = np.pad(np.ones((4, 4), bool), 1)
    walkable[2, 2] = walkable[3, 4] = False
    start, end = (1, 1), (4, 4)
    rng = np.random.default_rng(0)
    count = 4000
    wanted = np.zeros(walkable.shape)
    for _ in range(count):
        for x, y in digger(walkable, start, end, rng):
            wanted[y, x] += 1
    bits = jnp.asarray(rng.integers(0, 2**32, (count, 36), np.uint32))
    draw = jax.vmap(lambda b: sample_path(b, jnp.asarray(walkable), *map(jnp.array, (start, end))))
    paths = np.asarray(jax.jit(draw)(bits))
    assert paths[:, 1, 1].all()
    assert paths[:, 4, 4].all()
    np.testing.assert_allclose(paths.mean(axis=0), wanted / count, atol=0.04)


def test_closed_doors_block_and_change_each_round():
    states = first_states("obstructed-goals", 64)
    step = programs("obstructed-goals")[1]
    keys = jax.random.split(jax.random.key(1), 64)
    # At the goal: another round, with doors that leave a way to the new start.
    after, reward, _, info = step(keys, placed_at(states, states.things[:, 0]), np.full(64, -1))
    assert np.asarray(info["respawned"]).all()
    assert (np.asarray(reward) == 10).all()
    after = jax.device_get(after)
    differs = 0
    for i in range(64):
        doors, closed = doors_of(after, i)
        floor = (after.level.walls[i, 0] == 0) | np.isin(after.level.walls[i, 0], DOOR_LABELS)
        floor[doors[closed, 1], doors[closed, 0]] = False
        (column, row), *_ = cells(after.position[i][None])
        assert walking_distances(floor, tuple(cells(after.things[i])))[0, row, column] > 0
        differs += (closed != doors_of(states, i)[1]).any()
    assert differs > 32
    # Before a door, facing it: an open one lets pass, a closed one does not.
    seen = set()
    for i in range(64):
        for (column, row), shut in zip(*doors_of(states, i), strict=True):
            if states.level.walls[i, 0, row, column - 1] == 0:
                place = np.tile(np.array([column - 0.01, row + 0.5], np.float32), (64, 1))
                east = placed_at(states, place).replace(heading=np.zeros(64, np.float32))
                moved = np.asarray(step(keys, east, np.full(64, 2))[0].position)[i, 0]
                assert (moved > column) == (not shut)
                seen.add(bool(shut))
                break
    assert seen == {True, False}


def test_expert_walks_around_closed_doors():
    env, params = task("obstructed-goals")
    states = programs("obstructed-goals")[0](jax.random.split(jax.random.key(5), 16))
    params = params.replace(max_steps_in_episode=jnp.int32(400))
    out = play(env, player_of(env), params, jax.random.key(0), states)
    assert (np.asarray(out.successes) >= 1).all()


def test_objects_stay_out_of_the_walls_of_mazes_with_fewer_rooms():
    env = Explore(kind="objects", height=8, width=8)
    init = jax.jit(jax.vmap(lambda key: env.init_state(key, env.default_params)))
    states = jax.device_get(init(jax.random.split(jax.random.key(0), 64)))
    rooms = states.starting // env.starts
    assert (rooms < env.plan.rooms).any()
    for i in range(64):
        column, row = np.floor(states.things[i]).astype(int).T
        there = states.left[i]
        assert not states.level.walls[i, 0][row, column][there].any()
        assert (states.good[i] & there).sum() == there.sum() // 2 > 0


def test_many_objects():
    states = first_states("object-rewards-many", 32)
    for i in range(32):
        things = cells(states.things[i])
        assert (len(things), states.good[i].sum()) == (8, 4)
        assert len(cells(states.places[i])) == 16
        assert things <= cells(states.places[i])
        assert not cells(states.starts[i]) & cells(states.places[i])
