"""DeepMind Lab's mazes: starts, goals and apples against the text of the maps."""

# pyright: reportAttributeAccessIssue=false

import functools
from collections import deque
from importlib import resources

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from jaxenstein.errors import SettingError
from jaxenstein.maps.ascii import parse_ascii
from jaxenstein.maps.things import APPLE
from jaxenstein.tasks.maze import Maze, _subset
from jaxenstein.tasks.steering import FORWARD, INTERACT

FLOOR = ".aS@G"
LEAST_STEPS = 10
EAST = jnp.float32(0)


@functools.cache
def text(name):
    file = resources.files("jaxenstein.maps") / "layouts" / f"{name}.txt"
    return file.read_text(encoding="utf-8").strip("\n").split("\n")


def cells(name, characters):
    """(column, row) of the places that hold any of some characters."""
    return {
        (c, r)
        for r, row in enumerate(text(name))
        for c, char in enumerate(row)
        if char in characters
    }


def distances(name, goal):
    """Steps on foot from a cell to all that can be reached from it."""
    floor = cells(name, FLOOR)
    steps, pending = {goal: 0}, deque([goal])
    while pending:
        c, r = pending.popleft()
        for near in ((c + 1, r), (c - 1, r), (c, r + 1), (c, r - 1)):
            if near in floor and near not in steps:
                steps[near] = steps[c, r] + 1
                pending.append(near)
    return steps


@functools.cache
def task(name):
    env, params = jaxenstein.make(name, height=8, width=8, autoreset=None)
    return env, env.check_params(params)


@functools.cache
def drawn(name, count=4000):
    """First states: start cell of each, goal cell, apples' cells."""
    env, params = task(name)
    keys = jax.random.split(jax.random.key(3), count)
    state = jax.device_get(jax.jit(jax.vmap(lambda key: env.init_state(key, params)))(keys))
    starts = [tuple(cell) for cell in np.floor(state.position).astype(int).tolist()]
    np.testing.assert_array_equal(state.position % 1, 0.5)
    goals = [env.tilemap.goals[index] for index in state.goal]
    apples = [[env.apple_cells[i] for i in row] for row in state.apples.tolist()]
    assert not state.eaten.any()
    assert state.heading.min() < 0.1
    assert state.heading.max() > 6.18
    return starts, goals, apples


def is_plausible(counts, expected):
    """Whether chi-square is within 5 standard deviations of its mean."""
    counts, expected = np.array(counts, float), np.array(expected, float)
    freedom = len(counts) - 1
    square = ((counts - expected) ** 2 / expected).sum()
    return abs(square - freedom) < 5 * np.sqrt(2 * freedom)


@pytest.mark.parametrize("number", ["01", "02", "03"])
def test_random_goals_are_far_from_starts(number):
    name = f"dmlab-random-goal-{number}"
    starts, goals, apples = drawn(name)
    allowed = cells(name, "a@")
    assert set(apples[0]) == set()
    possible = sorted(allowed)
    assert is_plausible(
        [goals.count(cell) for cell in possible], [4000 / len(possible)] * len(possible)
    )
    chance = dict.fromkeys(possible, 0.0)
    for goal in possible:
        far = [cell for cell, steps in distances(name, goal).items() if steps >= LEAST_STEPS]
        far = allowed.intersection(far)
        for cell in far:
            chance[cell] += 1 / len(far) / len(possible)
        assert far.issuperset(s for s, g in zip(starts, goals, strict=True) if g == goal)
    assert is_plausible(
        [starts.count(cell) for cell in possible], [4000 * chance[cell] for cell in possible]
    )


@pytest.mark.parametrize(("number", "count"), [("01", 5), ("02", 13), ("03", 26)])
def test_drawn_apples_are_distinct_and_not_on_the_goal(number, count):
    name = f"dmlab-random-goal-{number}-respawn"
    starts, goals, apples = drawn(name)
    allowed = cells(name.removesuffix("-respawn"), "a@")
    assert count == len(allowed) // 10
    total = dict.fromkeys(allowed, 0)
    for goal, row in zip(goals, apples, strict=True):
        assert len(set(row)) == len(row) == count
        assert goal not in row
        for cell in row:
            total[cell] += 1
    # Drawing without repetition only narrows the spread, hence only the upper bound.
    expected = 4000 * count / len(allowed)
    square = sum((n - expected) ** 2 / expected for n in total.values())
    freedom = len(allowed) - 1
    assert square < freedom + 5 * np.sqrt(2 * freedom)
    for start, goal in set(zip(starts[:200], goals[:200], strict=True)):
        assert distances(name.removesuffix("-respawn"), goal)[start] >= LEAST_STEPS


@pytest.mark.parametrize("suffix", ["", "-respawn"])
@pytest.mark.parametrize("number", ["01", "02", "03"])
def test_static_mazes_match_the_layout(number, suffix):
    name = f"dmlab-static-{number}"
    env, _ = task(name + suffix)
    (goal,) = cells(name, "G")
    assert env.tilemap.goals == (goal,)
    assert set(env.tilemap.spawns) == cells(name, "S@")
    assert set(env.apple_cells) == (cells(name, "a@") if suffix else set())
    starts, goals, apples = drawn(name + suffix)
    assert set(goals) == {goal}
    assert all(row == list(env.apple_cells) for row in apples)
    steps = distances(name, goal)
    far = sorted(cell for cell in cells(name, "S@") if steps[cell] >= LEAST_STEPS)
    assert set(starts) <= set(far)
    assert is_plausible([starts.count(cell) for cell in far], [4000 / len(far)] * len(far))


# The rules of a step, in the static maze 01.

NAME = "dmlab-static-01"


@functools.cache
def stepper(name):
    """A compiled step that draws nothing, and a first state."""
    env, params = task(name)
    step = jax.jit(lambda key, state, action: env.advance(key, state, action, params))
    return step, env.init_state(jax.random.key(1), params)


def west_of(cell, distance=0.45):
    return jnp.array([cell[0] + 0.5 - distance, cell[1] + 0.5], jnp.float32)


def goal_cell():
    (goal,) = cells(NAME, "G")
    assert (goal[0] - 1, goal[1]) in cells(NAME, FLOOR)
    return goal


def test_the_goal_ends_the_episode():
    step, state = stepper(NAME)
    state = state.replace(position=west_of(goal_cell()), heading=EAST)
    after, reward, terminated, info = step(jax.random.key(0), state, jnp.int32(FORWARD))
    assert (float(reward), bool(terminated), bool(after.done)) == (10, True, True)
    assert bool(info["reached_goal"])
    assert "respawned" not in info
    assert "ate_apple" not in info
    np.testing.assert_allclose(after.position, west_of(goal_cell(), 0.3), atol=1e-6)


def test_the_goal_moves_the_agent_to_a_new_start():
    step, state = stepper(NAME + "-respawn")
    steps = distances(NAME, goal_cell())
    starts = set()
    for seed in range(40):
        before = state.replace(
            position=west_of(goal_cell()),
            heading=EAST,
            time=jnp.int32(77),
            episode_return=jnp.float32(4),
            eaten=jnp.arange(len(state.eaten)) % 2 == 0,
        )
        after, reward, terminated, info = step(jax.random.key(seed), before, jnp.int32(FORWARD))
        assert (float(reward), bool(terminated), bool(after.done)) == (10, False, False)
        assert (int(after.time), float(after.episode_return)) == (78, 14)
        assert bool(info["reached_goal"])
        assert bool(info["respawned"])
        assert int(info["ate_apple"]) == 0
        assert not np.array(after.eaten).any()
        assert int(after.goal) == int(before.goal)
        start = tuple(np.floor(np.array(after.position)).astype(int).tolist())
        assert start in cells(NAME, "S@")
        assert steps[start] >= LEAST_STEPS
        starts.add((*start, float(after.heading)))
    assert len(starts) > 30


def test_respawning_maze_is_truncated_at_the_time_limit():
    _, params = task(NAME + "-respawn")
    assert int(params.max_steps_in_episode) == 1800
    step, state = stepper(NAME + "-respawn")
    for time, done in ((1798, False), (1799, True)):
        before = state.replace(position=west_of(goal_cell()), heading=EAST, time=jnp.int32(time))
        after, _, terminated, _ = step(jax.random.key(0), before, jnp.int32(FORWARD))
        assert (bool(after.done), bool(terminated)) == (done, False)


def test_apple_counts_once():
    env, params = task(NAME + "-respawn")
    step, state = stepper(NAME + "-respawn")
    index, apple = next(
        (i, cell)
        for i, cell in enumerate(env.apple_cells)
        if (cell[0] - 1, cell[1]) in cells(NAME, FLOOR)
    )
    state = state.replace(position=west_of(apple), heading=EAST)
    for reward_expected in (1, 0, 0):
        state, reward, terminated, info = step(jax.random.key(0), state, jnp.int32(FORWARD))
        assert (float(reward), int(info["ate_apple"])) == (reward_expected, reward_expected)
        ends = (terminated, info["reached_goal"], info["respawned"])
        assert not any(map(bool, ends))
        assert np.flatnonzero(state.eaten).tolist() == [index]
    scene = env.scene(state, params)
    labels = np.array(scene.theme.sprite_labels)[np.array(scene.sprites.picture)]
    hidden = ~np.array(scene.sprites.visible)
    assert (labels == APPLE.label).sum() == len(env.apple_cells)
    assert labels[hidden].tolist() == [APPLE.label]
    np.testing.assert_array_equal(np.array(scene.sprites.position)[hidden], [np.add(apple, 0.5)])


def test_apple_on_the_start_is_eaten_at_once():
    step, state = stepper(NAME + "-respawn")
    column, row = min(cells(NAME, "@"))
    state = state.replace(position=jnp.array([column + 0.5, row + 0.5], jnp.float32))
    _, reward, _, info = step(jax.random.key(0), state, jnp.int32(INTERACT))
    assert (float(reward), int(info["ate_apple"])) == (1, 1)


def test_apple_beside_the_goal_counts_in_the_same_step():
    name = "dmlab-random-goal-01-respawn"
    env, params = task(name)
    _, state = stepper(name)
    params = params.replace(pickup_radius=jnp.float32(3))
    state = state.replace(heading=EAST)
    goal = env.tilemap.goals[int(state.goal)]
    beside = next(
        i
        for i, cell in enumerate(env.apple_cells)
        if abs(cell[0] - goal[0]) + abs(cell[1] - goal[1]) == 2
    )
    others = [
        i
        for i, cell in enumerate(env.apple_cells)
        if abs(cell[0] - goal[0]) + abs(cell[1] - goal[1]) > 6
    ][:4]
    state = state.replace(
        position=jnp.array(goal, jnp.float32) + 0.5, apples=jnp.array([beside, *others], jnp.int32)
    )
    action = jnp.int32(INTERACT)
    after, reward, terminated, info = env.advance(jax.random.key(0), state, action, params)
    assert (float(reward), bool(terminated), int(info["ate_apple"])) == (11, False, 1)
    assert not np.array(after.eaten).any()
    np.testing.assert_array_equal(after.apples, state.apples)


def test_every_subset_is_equally_likely():
    def draws(size, count):
        bits = jax.random.bits(jax.random.key(size), (6000, size), jnp.uint32)
        rows = np.array(jax.jit(jax.vmap(lambda b: _subset(b, count)))(bits))
        assert rows.min() >= 0
        assert rows.max() < count
        assert all(len(set(row)) == size for row in rows.tolist())
        return np.unique(np.sort(rows, axis=1), axis=0, return_counts=True)[1]

    three_of_six = draws(3, 6)
    assert len(three_of_six) == 20
    assert is_plausible(three_of_six, [300] * 20)
    assert draws(1, 4).shape == (4,)
    assert draws(4, 4).tolist() == [6000]


def test_start_heading_goal_and_apples_are_drawn_independently():
    tilemap = parse_ascii("#######\n#S.S.S#\n#G.G.G#\n#######", "draws")
    env = Maze(tilemap=tilemap, drawn_apples=1, height=8, width=8)
    keys = jax.random.split(jax.random.key(2), 7200)
    states = jax.jit(jax.vmap(env.init_state, (0, None)))(keys, env.default_params)
    start = np.floor(np.asarray(states.position)[:, 0]).astype(int) // 2
    quarter = np.floor(np.asarray(states.heading) / (np.pi / 2)).astype(int)
    goal, apple = np.asarray(states.goal), np.asarray(states.apples)[:, 0]
    seen = np.zeros((3, 4, 3, 3), int)
    np.add.at(seen, (start, quarter, goal, apple), 1)
    assert seen[:, :, range(3), range(3)].sum() == 0
    others = seen[:, :, ~np.eye(3, dtype=bool)].ravel()
    assert is_plausible(others.tolist(), [7200 / 72] * 72)


def test_impossible_settings_are_refused():
    tilemap = parse_ascii("######\n#S..G#\n######", "short")
    Maze(tilemap=tilemap, start_distance=3)
    with pytest.raises(SettingError, match=r"start_distance 4: .*column 4, row 1"):
        Maze(tilemap=tilemap, start_distance=4)
    for apples in (1, 2, -1):
        with pytest.raises(SettingError, match="drawn_apples must be 0 to 0"):
            Maze(tilemap=tilemap, drawn_apples=apples)
