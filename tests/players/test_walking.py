"""Walking players reach their goals on nearly shortest paths."""

import jax
import numpy as np
import pytest

from jaxenstein import from_ascii, make
from jaxenstein.players import play
from jaxenstein.players.walking import FAR, SHORTEST_PATH, distance_tables
from jaxenstein.tasks.navigation import Navigation

SIZE = {"height": 8, "width": 8}


def starts(env, params, count):
    keys = jax.random.split(jax.random.key(1), count)
    return jax.vmap(lambda key: env.init_state(key, params))(keys)


@pytest.mark.parametrize(
    "name", ["simple", "key-door", pytest.param("key-corridor-s3r2", marks=pytest.mark.slow)]
)
def test_shortest_path_reaches_every_goal(name):
    env, params = make(name, **SIZE)
    episodes = play(env, SHORTEST_PATH, params, jax.random.key(0), starts(env, params, 16))
    assert episodes.terminated.all()
    assert (episodes.successes == 1).all()
    np.testing.assert_array_equal(episodes.returned, np.ones(16))
    assert (episodes.length < params.max_steps_in_episode).all()


@pytest.mark.parametrize(("name", "skip"), [("simple", 2), ("key-door", 3), ("simple", 6)])
def test_players_reach_the_goal_with_frame_skip(name, skip):
    """Their turns of 15 degrees times the skip divide a right angle."""
    env, params = make(name, frame_skip=skip, **SIZE)
    episodes = play(env, SHORTEST_PATH, params, jax.random.key(0), starts(env, params, 16))
    assert episodes.terminated.all()


BENDS = """
#########
#S..#...#
###.#.#.#
#...#.#.#
#.###.#.#
#.....#G#
#########
""".strip()


@pytest.mark.parametrize(("skip", "turn", "least"), [(1, 90, 64), (6, 15, 58)])
def test_wide_turns_and_strides_arrive_from_any_heading(skip, turn, least):
    """Aligned to less than half a turn, a step can lead into the wall of the corridor.

    Six steps are 0.9 tiles: one start in twenty can only pass the goal, whose radius is 0.35,
    until a wall has put it onto other tracks.
    """
    env, params = from_ascii(BENDS, frame_skip=skip, **SIZE)
    params = params.replace(turn_angle=np.float32(np.radians(turn)))
    episodes = play(env, SHORTEST_PATH, params, jax.random.key(0), starts(env, params, 64))
    assert int((episodes.successes > 0).sum()) >= least
    assert int(np.median(episodes.length)) < 400


def test_shortest_path_is_nearly_as_short_as_its_tiles():
    env, params = make("simple", **SIZE)
    state = starts(env, params, 16)
    episodes = play(env, SHORTEST_PATH, params, jax.random.key(0), state)
    assert isinstance(env, Navigation)
    cell = np.floor(np.asarray(state.position[0])).astype(int)
    tiles = int(distance_tables(env.tilemap)[0, 0, cell[1], cell[0]])
    walked = (tiles - float(params.goal_radius)) / float(params.move_distance)
    # Corners may be cut, and each turn of 90 degrees takes about 6 steps.
    assert 0.7 * walked < int(episodes.length[0]) < 1.2 * walked + 24


def test_long_paths_are_not_mistaken_for_walls():
    rows = ["#" * 201]
    for row in range(99):
        gap = "#" * 198 + ".#" if row % 2 else ""
        rows += ["#" + "." * 199 + "#", "#" + (gap or "." + "#" * 198) + "#"]
    rows[1] = "#S" + rows[1][2:]
    rows = [*rows[:-1], "#" * 201]
    rows[-2] = rows[-2][:100] + "G" + rows[-2][101:]
    env, _ = from_ascii("\n".join(rows), **SIZE)
    assert isinstance(env, Navigation)
    tables = distance_tables(env.tilemap)[0, 0]
    assert 2**14 < tables[1, 1] < tables[0, 0] == FAR


def test_distances_lead_to_the_key_first():
    env, _ = make("key-door", **SIZE)
    assert isinstance(env, Navigation)
    tilemap = env.tilemap
    tables = distance_tables(tilemap)
    (key,), (door,), (goal,) = tilemap.keys, tilemap.doors, tilemap.goals
    column, row = tilemap.spawns[0]
    assert tables[0, 0, key.row, key.column] == 0
    assert 0 < tables[0, 0, row, column] < FAR
    assert tables[0, 0, door.row, door.column] == FAR
    assert tables[1, 0, goal[1], goal[0]] == 0
    assert 0 < tables[1, 0, door.row, door.column] < tables[1, 0, row, column]
