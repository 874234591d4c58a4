"""Layouts of key-corridor against the rules of MiniGrid and their exact frequencies."""

# pyright: reportAttributeAccessIssue=false

import functools
import math
import warnings
from fractions import Fraction
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from jaxenstein.errors import MapWarning
from jaxenstein.maps import parse_ascii
from jaxenstein.maps.reach import flood, open_tiles
from jaxenstein.maps.things import KEY
from jaxenstein.tasks.steering import INTERACT
from tests.reference.corridors import broken_rules, from_tilemap

IDS = ("key-corridor-s3r1", "key-corridor-s3r2", "key-corridor", "key-corridor-s6r3")


@functools.cache
def task(name, **settings):
    env, params = jaxenstein.make(name, height=8, width=8, autoreset=None, **settings)
    return env, env.check_params(params)


@functools.cache
def first_states(name, count, **settings):
    env, params = task(name, **settings)
    keys = jax.random.split(jax.random.key(2), count)
    return jax.device_get(jax.jit(jax.vmap(lambda key: env.init_state(key, params)))(keys))


def pick(states, index):
    return jax.tree.map(lambda leaf: leaf[index], states)


def connected(tilemap, doors):
    walkable = np.array(open_tiles(tilemap))
    for door in tilemap.doors:
        walkable[door.row, door.column] = door in doors
    rooms = np.array(open_tiles(tilemap))
    for door in tilemap.doors:
        rooms[door.row, door.column] = False
    reached = flood(walkable, [tilemap.spawns[0]])
    return bool(reached[rooms].all())


@pytest.mark.parametrize("name", IDS)
def test_layouts_keep_the_rules(name):
    env, _ = task(name)
    states = first_states(name, 300)
    seen = set()
    for i in range(300):
        state = pick(states, i)
        tilemap = env.tilemap_of(state)
        layout = from_tilemap(tilemap, state.position, float(state.heading))
        assert broken_rules(layout) == [], (name, i)
        assert (tilemap.columns, tilemap.rows) == env.map_size
        # The generator stops at the door that connects the last room.
        rest = [set(tilemap.doors) - {door} for door in tilemap.doors]
        assert any(not connected(tilemap, doors) for doors in rest)
        seen.add((tilemap.doors, tilemap.keys, tilemap.goals))
    # With rooms of one tile in one row, only the colours of the two doors differ.
    assert len(seen) == 36 if name.endswith("r1") else len(seen) > 100
    assert not states.opened.any()
    assert not states.taken.any()


def exact_door_counts(rows):
    """Probabilities of numbers of unlocked doors, which are added until all is connected."""
    counts = {}
    for locked in range(rows):
        rooms = {(side, row) for side in (0, 1) for row in range(rows)} | {"hall"}
        walls = [((side, row), "hall") for side in (0, 1) for row in range(rows)]
        walls += [((side, row), (side, row + 1)) for side in (0, 1) for row in range(rows - 1)]
        shut = (1, locked)
        walls = [wall for wall in walls if shut not in wall]
        for number, chance in chances(frozenset(walls), frozenset(), len(rooms) - 1).items():
            counts[number] = counts.get(number, 0) + chance / rows
    return counts


@functools.cache
def chances(left, doors, needed):
    reached = {"hall"}
    while more := {room for wall in doors if reached & set(wall) for room in wall} - reached:
        reached |= more
    if len(reached) == needed:
        return {len(doors): Fraction(1)}
    total = {}
    for wall in left:
        for number, chance in chances(left - {wall}, doors | {wall}, needed).items():
            total[number] = total.get(number, 0) + chance / len(left)
    return total


@pytest.mark.parametrize("name", ["key-corridor-s3r1", "key-corridor-s3r2", "key-corridor-s3r3"])
def test_number_of_doors_has_the_right_distribution(name):
    rows = int(name[-1])
    expected = exact_door_counts(rows)
    if rows == 3:
        assert expected == {5: Fraction(26, 63), 6: Fraction(47, 126), 7: Fraction(3, 14)}
    doors = first_states(name, 3000).level.doors
    unlocked = (doors[..., 0] > 0).sum(axis=1) - 1
    assert set(unlocked.tolist()) == set(expected)
    for number, chance in expected.items():
        # Five standard deviations.
        spread = 5 * np.sqrt(float(chance * (1 - chance)) * 3000)
        assert abs((unlocked == number).sum() - float(chance) * 3000) <= spread


def test_rooms_of_key_and_goal_and_the_colour_are_drawn_independently():
    states = first_states("key-corridor-s3r3", 5400)
    # Rooms are two tiles apart.
    key, goal = (np.asarray(place)[:, 1].astype(int) // 2 for place in (states.key, states.goal))
    drawn = np.zeros((3, 3, 6), int)
    np.add.at(drawn, (key, goal, np.asarray(states.key_colour)), 1)
    # 53 degrees of freedom; 130 is far beyond the quantile of 1e-6.
    assert ((drawn - 100) ** 2 / 100).sum() < 130


def test_layout_seed_freezes_the_layout_but_not_the_start():
    layouts = []
    for seed in range(2):
        states = first_states("key-corridor-s3r3", 1000, layout_seed=seed)
        for part in (states.level, states.locked, states.key, states.key_colour, states.goal):
            assert all((leaf == leaf[:1]).all() for leaf in jax.tree.leaves(part))
        layouts.append((states.level.walls[0].tobytes(), states.key[0].tobytes()))
        counts = np.unique(
            np.column_stack([states.position, states.heading]), axis=0, return_counts=True
        )[1]
        # Three tiles of the hall and four headings, without the one that faces the locked door.
        door = states.level.doors[0][states.locked[0]][0]
        expected = 12 - (3 - 1 <= door[1] - states.level.margin <= 4)
        assert len(counts) == expected
        square = ((counts - 1000 / expected) ** 2 / (1000 / expected)).sum()
        assert square < expected + 5 * np.sqrt(2 * expected)
    assert len(set(layouts)) == 2


@functools.cache
def stepper():
    env, params = task("key-corridor")
    step = jax.jit(lambda state, action: env.advance(jax.random.key(0), state, action, params))
    return env, step, pick(first_states("key-corridor", 300), 7)


def before_the_locked_door(state):
    door = state.level.doors[state.locked][0] - state.level.margin
    place = np.array([door[0] - 0.5, door[1] + 0.5], np.float32)
    return state.replace(position=jnp.asarray(place), heading=jnp.float32(0))


def test_locked_door_needs_the_key():
    _, step, state = stepper()
    state = before_the_locked_door(state)
    after, _, _, info = step(state, jnp.int32(INTERACT))
    assert not np.array(after.opened).any()
    assert not bool(info["opened_door"])
    after, reward, _, info = step(state.replace(taken=jnp.bool_(True)), jnp.int32(INTERACT))
    np.testing.assert_array_equal(after.opened, state.locked)
    assert bool(info["opened_door"])
    assert float(reward) == 0
    # An open door stays open and lets the agent through.
    for _ in range(12):
        after, _, _, info = step(after, jnp.int32(2))
        assert not bool(info["opened_door"])
    assert float(after.position[0]) > float(state.position[0]) + 1


def test_unlocked_door_needs_no_key():
    _, step, state = stepper()
    doors = state.level.doors - state.level.margin
    west = next(i for i in range(3) if doors[i, 0] > 0)
    place = np.array([doors[west, 0] + 1.5, doors[west, 1] + 0.5], np.float32)
    state = state.replace(position=jnp.asarray(place), heading=jnp.float32(np.pi))
    after, *_ = step(state, jnp.int32(INTERACT))
    assert np.flatnonzero(after.opened).tolist() == [west]


def test_key_is_picked_up_once_and_goal_ends_the_episode():
    env, step, state = stepper()
    over = state.replace(position=jnp.asarray(state.key))
    after, _, terminated, info = step(over, jnp.int32(-1))
    assert bool(after.taken)
    assert bool(info["picked_key"])
    assert not bool(terminated)
    carried = np.array(env.variables(after)["carried_keys"])
    assert np.flatnonzero(carried).tolist() == [int(state.key_colour)]
    assert not bool(step(after, jnp.int32(-1))[3]["picked_key"])
    there = state.replace(position=jnp.asarray(state.goal))
    after, reward, terminated, info = step(there, jnp.int32(-1))
    assert (float(reward), bool(terminated), bool(info["reached_goal"])) == (1, True, True)


def test_key_is_visible_in_its_colour_until_taken():
    env, params = task("key-corridor", observation="labels")
    states = first_states("key-corridor", 40)
    # Within the key's tile, looking east at it.
    beside = states.key - np.array([0.4, 0], np.float32)
    states = states.replace(position=beside, heading=np.zeros(40, np.float32))
    observe = jax.jit(jax.vmap(lambda state: env.observe(state, params)))
    before = np.asarray(observe(states))
    after = np.asarray(observe(states.replace(taken=np.ones(40, bool))))
    assert set(states.key_colour.tolist()) == set(range(6))
    for colour, with_key, without in zip(states.key_colour, before, after, strict=True):
        assert set(np.unique(with_key)) & set(KEY.labels) == {KEY.labels[int(colour)]}
        assert not set(np.unique(without)) & set(KEY.labels)


DRAWN = """\
##########
#..#..#..#
#.r'..,..#
##'#..##;#
#..#.S:..#
#..#..#..#
#'##..####
#..#..#G.#
#..#..R..#
##########
"""


def layout(text: str = DRAWN, heading: float = 0.0) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MapWarning)
        tilemap = parse_ascii(text)
    return from_tilemap(tilemap, np.add(tilemap.spawns[0], 0.5), math.radians(heading))


def test_valid_layout_breaks_no_rule() -> None:
    assert broken_rules(layout()) == []


def changed(*changes: tuple[int, int, str]) -> str:
    """The drawn text with other characters at some (column, row)."""
    lines = [list(line) for line in DRAWN.splitlines()]
    for column, row, character in changes:
        lines[row][column] = character
    return "\n".join("".join(line) for line in lines)


@pytest.mark.parametrize(
    ("changes", "rule"),
    [
        ([(4, 3, "#")], "walls and hallway"),
        ([(1, 3, ".")], "walls and hallway"),
        ([(7, 7, "."), (7, 5, "G")], "goal in the locked room"),
        ([(7, 6, "'")], "no other door to the locked room"),
        ([(2, 2, "."), (4, 7, "r")], "key in the first column"),
        ([(2, 2, "b")], "key in the door's colour"),
        ([(5, 4, "."), (5, 2, "S")], "start in the middle"),
        ([(5, 4, "."), (5, 7, "S")], "start in the middle"),
        ([(1, 6, "#")], "all rooms connected"),
        ([(6, 8, "#"), (6, 4, "R")], "goal in the locked room"),
        ([(6, 8, "#"), (8, 6, "R")], "locked door west of a room of the last column"),
        ([(6, 2, "R")], "one locked door, one key, one goal"),
        ([(2, 2, "."), (8, 8, "r")], "solvable"),
    ],
)
def test_broken_rules_are_found(changes: list[tuple[int, int, str]], rule: str) -> None:
    assert rule in broken_rules(layout(changed(*changes)))


def test_facing_the_locked_door_is_found() -> None:
    changes = changed((5, 4, "."), (6, 8, "#"), (6, 5, "R"), (6, 4, "#"), (5, 5, "S"))
    assert "locked door not in front" in broken_rules(layout(changes))
    assert "locked door not in front" not in broken_rules(layout(changes, heading=90))


@pytest.mark.parametrize(("position", "heading"), [((1.0, 1.5), 0.0), ((1.5, 1.5), 0.1)])
def test_starts_between_tiles_or_quarter_turns(
    position: tuple[float, float], heading: float
) -> None:
    with pytest.raises(ValueError, match="between tiles"):
        from_tilemap(parse_ascii(DRAWN), np.array(position), heading)
