"""The rules of navigation, against a slow simulation that shares no code with them."""

import functools
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import jaxenstein
from jaxenstein.tasks.steering import BACKWARD, FORWARD, INTERACT, TURN_LEFT, TURN_RIGHT

pytestmark = pytest.mark.usefixtures("plain_frames")
# Every kind of door and key; the goal behind a chain of doors.
HOUSE = """
###########
#S.r#..b..#
#...R.....#
#.#.#..#..#
#...###"###
##\\##...y.#
#....#B####
#.S..#....#
#..n.Y..G.#
#..#.####P#
#.p.......#
###########
"""
SETTINGS = {"height": 6, "width": 8}


@functools.cache
def house():
    env, params = jaxenstein.from_ascii(HOUSE.strip("\n"), **SETTINGS)
    return env, params, jax.jit(env.advance)


class Oracle:
    """The rules in float64 on the text itself, finding crossings by sampling the path."""

    def __init__(self, text, position, heading, opened, taken, params):
        self.rows = text.strip("\n").split("\n")
        self.position = np.array(position, np.float64)
        self.heading = float(heading)
        self.params = params
        cells = [(c, r, ch) for r, row in enumerate(self.rows) for c, ch in enumerate(row)]
        self.doors = [cell for cell in cells if cell[2] in "RNBPYE',\";\\:"]
        self.keys = [cell for cell in cells if cell[2] in "rnbpye"]
        self.goal = next((c + 0.5, r + 0.5) for c, r, ch in cells if ch == "G")
        self.opened = {
            door[:2] for door, is_open in zip(self.doors, opened, strict=True) if is_open
        }
        self.taken = {key for key, gone in zip(self.keys, taken, strict=True) if gone}

    def first_stop(self, delta):
        """The first solid tile on the straight way, or None, by small steps."""
        for f in np.linspace(0, 1, 4001):
            column, row = (math.floor(v) for v in self.position + f * np.array(delta))
            char = self.rows[row][column]
            closed_door = (column, row) not in self.opened and any(
                (column, row) == door[:2] for door in self.doors
            )
            if char == "#" or closed_door:
                return column, row
        return None

    def step(self, action):
        turn = {TURN_LEFT: -1, TURN_RIGHT: 1}.get(action, 0) * self.params.turn_angle
        self.heading = (self.heading + turn) % (2 * math.pi)
        ahead = np.array([math.cos(self.heading), math.sin(self.heading)])
        pace = {FORWARD: 1, BACKWARD: -1}.get(action, 0) * self.params.move_distance
        if pace and self.first_stop(pace * ahead) is None:
            self.position = self.position + pace * ahead
        opened = False
        if action == INTERACT:
            stop = self.first_stop(float(self.params.interact_distance) * ahead)
            for column, row, char in self.doors:
                carried = {key[2] for key in self.taken}
                if (column, row) == stop and (not char.isalpha() or char.lower() in carried):
                    self.opened.add((column, row))
                    opened = True
        picked = False
        for key in set(self.keys) - self.taken:
            if math.dist(self.position, (key[0] + 0.5, key[1] + 0.5)) <= self.params.pickup_radius:
                self.taken.add(key)
                picked = True
        reached = math.dist(self.position, self.goal) <= self.params.goal_radius
        return picked, opened, reached


@settings(deadline=None, max_examples=150)
@given(
    data=st.data(),
    cell=st.sampled_from(
        [
            (c, r)
            for r, row in enumerate(HOUSE.strip("\n").split("\n"))
            for c, ch in enumerate(row)
            if ch in ".SGrnbpy"
        ]
    ),
    inside=st.tuples(st.floats(0.03, 0.97), st.floats(0.03, 0.97)),
    heading=st.floats(0, 6.28),
    action=st.integers(-1, 5),
    move=st.sampled_from([0.15, 0.45, 0.9]),
)
def test_step_matches_the_oracle(data, cell, inside, heading, action, move):
    env, params, step = house()
    params = params.replace(move_distance=move)
    doors, keys = len(env.tilemap.doors), len(env.tilemap.keys)
    bits = st.lists(st.booleans(), min_size=doors, max_size=doors)
    opened = data.draw(bits)
    taken = data.draw(st.lists(st.booleans(), min_size=keys, max_size=keys))
    _, state = env.reset(jax.random.key(0), params)
    state = state.replace(
        position=jnp.array([cell[0] + inside[0], cell[1] + inside[1]], jnp.float32),
        heading=jnp.float32(heading),
        opened=jnp.array(opened),
        taken=jnp.array(taken),
    )
    order = [(d.column, d.row) for d in env.tilemap.doors]
    oracle = Oracle(HOUSE, state.position, heading, opened, taken, params)
    assert order == [door[:2] for door in oracle.doors]
    assert [(k.column, k.row) for k in env.tilemap.keys] == [key[:2] for key in oracle.keys]
    picked, newly_opened, reached = oracle.step(action)
    after, reward, terminated, info = step(jax.random.key(0), state, action, params)
    np.testing.assert_allclose(after.position, oracle.position, atol=2e-5)
    np.testing.assert_allclose(np.cos(after.heading), math.cos(oracle.heading), atol=1e-5)
    np.testing.assert_allclose(np.sin(after.heading), math.sin(oracle.heading), atol=1e-5)
    assert bool(terminated) == bool(info["reached_goal"]) == reached
    assert float(reward) == float(reached)
    assert bool(info["opened_door"]) == (newly_opened)
    assert {cell for cell, is_open in zip(order, after.opened, strict=True) if is_open} == (
        oracle.opened
    )
    assert bool(info["picked_key"]) == picked
    assert np.asarray(after.taken).tolist() == [key in oracle.taken for key in oracle.keys]
    assert float(info["distance_to_goal"]) == pytest.approx(
        math.dist(oracle.position, oracle.goal), abs=1e-4
    )


def follow(env, params, heading, actions):
    """States and infos of a scripted walk."""
    _, state = env.reset(jax.random.key(0), params)
    state = state.replace(heading=jnp.float32(heading))
    trace = []
    for action in actions:
        state, reward, terminated, info = env.advance(jax.random.key(0), state, action, params)
        trace.append((state, float(reward), bool(terminated), info))
    return trace


def test_key_door_needs_the_key():
    env, params = jaxenstein.make("key-door", **SETTINGS)
    walk = [FORWARD] * 20 + [INTERACT] + [FORWARD] * 40
    trace = follow(env, params, 0.0, walk)
    ends = [t for t, (_, _, terminated, _) in enumerate(trace) if terminated]
    picked = [t for t, (*_, info) in enumerate(trace) if info["picked_key"]]
    opened = [t for t, (*_, info) in enumerate(trace) if info["opened_door"]]
    # The key is two tiles minus the radius away, and the goal eight, at 0.15 tiles per step.
    assert picked == [math.ceil((2 - 0.35) / 0.15) - 1]
    assert opened == [20]
    assert len(ends) > 0
    assert trace[ends[0]][1] == 1.0
    without = env.init_state(jax.random.key(0), params).replace(
        position=jnp.array([4.5, 1.5], jnp.float32)
    )
    state, *_ = env.advance(jax.random.key(0), without, INTERACT, params)
    assert not state.opened.any()


def test_key_opens_only_doors_of_its_colour():
    """The red door is in the north and the blue one in the south of the red key."""
    text = "#####\n##G##\n##R##\n#Srb#\n##B##\n##.##\n#####"
    env, params = jaxenstein.from_ascii(text, **SETTINGS)
    start = env.init_state(jax.random.key(0), params)
    state = start.replace(position=jnp.array([2.5, 3.5], jnp.float32))
    state, *_, info = env.advance(jax.random.key(0), state, -1, params)
    assert info["picked_key"]
    opened = []
    for heading in (math.pi / 2, 3 * math.pi / 2):
        facing = state.replace(heading=jnp.float32(heading))
        after = env.advance(jax.random.key(0), facing, INTERACT, params)[0]
        opened.append(int(after.opened.sum()))
    assert opened == [0, 1]


def test_doors_do_not_open_through_walls_or_out_of_reach():
    env, params = jaxenstein.from_ascii("######\n#S#\\G#\n#....#\n######", heading=0.0, **SETTINGS)
    ((state, *_),) = follow(env, params, 0.0, [INTERACT])
    assert not state.opened.any()
    env, params = jaxenstein.from_ascii("######\n#S.\\G#\n######", heading=0.0, **SETTINGS)
    ((state, *_),) = follow(env, params, 0.0, [INTERACT])
    assert not state.opened.any()
    # Five steps of 0.15 from 1.5 tiles before the door.
    for distance, opens in ((0.7, False), (0.74, False), (0.76, True)):
        reach = params.replace(interact_distance=distance)
        trace = follow(env, reach, 0.0, [FORWARD] * 5 + [INTERACT])
        assert trace[-1][0].opened.all() == opens
    trace = follow(env, params, 0.0, [FORWARD] * 5 + [INTERACT])
    assert not trace[-2][0].opened.any()
    assert trace[-1][0].opened.all()


def test_corners_between_diagonal_walls_are_closed():
    with pytest.warns(jaxenstein.MapWarning, match="no path"):
        env, params = jaxenstein.from_ascii("####\n#S##\n##G#\n####", heading=45.0, **SETTINGS)
    trace = follow(env, params.replace(move_distance=0.9), math.pi / 4, [FORWARD])
    np.testing.assert_array_equal(trace[0][0].position, [1.5, 1.5])


@pytest.mark.parametrize(
    ("name", "cells", "low", "high"),
    [
        ("simple", 1, 0.0, 0.0),
        ("key-door", 1, 0.0, 0.0),
        ("my-way-home", 17, 0.0, 360.0),
        ("my-way-home-colorless", 17, 0.0, 360.0),
        ("my-way-home-sparse", 1, 356.4, 360.0),
        ("my-way-home-very-sparse", 1, 176.4, 183.6),
    ],
)
def test_starts_are_drawn_uniformly(name, cells, low, high):
    env, params = jaxenstein.make(name)
    keys = jax.random.split(jax.random.key(0), 3400)
    states = jax.jit(jax.vmap(env.init_state, (0, None)))(keys, params)
    _, counts = np.unique(np.asarray(states.position), axis=0, return_counts=True)
    assert len(counts) == cells
    # Five standard deviations of a binomial count.
    p = 1 / cells
    assert np.abs(counts - 3400 * p).max() <= 5 * math.sqrt(3400 * p * (1 - p)) + 1e-9
    degrees = np.degrees(np.asarray(states.heading))
    assert degrees.min() >= low - 1e-4
    assert degrees.max() <= high + 1e-4
    if high > low:
        thirds = np.histogram(degrees, 3, (low, high))[0] / 3400
        assert np.abs(thirds - 1 / 3).max() < 0.05


def test_start_heading_and_goal_are_drawn_independently():
    env, params = jaxenstein.from_ascii("#########\n#GSGSGSG#\n#########", height=6, width=8)
    keys = jax.random.split(jax.random.key(1), 4800)
    states = jax.jit(jax.vmap(env.init_state, (0, None)))(keys, params)
    start = np.floor(np.asarray(states.position)[:, 0]).astype(int) // 2 - 1
    quarter = np.floor(np.asarray(states.heading) / (math.pi / 2)).astype(int)
    drawn = np.zeros((3, 4, 4), int)
    np.add.at(drawn, (start, np.asarray(states.goal), quarter), 1)
    # 48 cells of 100: chi-squared with 47 degrees of freedom, far beyond its 1e-6 quantile.
    assert ((drawn - 100) ** 2 / 100).sum() < 120


BAD_HEADINGS = ["east", (3.0,), (10.0, 5.0), math.nan, (0.0, math.inf), (-1e76, 10), 10**400, 3601]


@pytest.mark.parametrize("heading", BAD_HEADINGS, ids=range(len(BAD_HEADINGS)))
def test_bad_headings(heading):
    with pytest.raises(jaxenstein.SettingError, match="heading must be"):
        jaxenstein.from_ascii("####\n#SG#\n####", heading=heading)
