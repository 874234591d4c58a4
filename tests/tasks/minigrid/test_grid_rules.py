"""The rules of worlds with things and doors: small cases, and a slow independent program."""

import functools
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxenstein.maps.symbols import door_label
from jaxenstein.maps.things import BALL, BOX, KEY
from tests.tasks.minigrid.drawn import DOORS, PAINT, RED, YELLOW, drawn

LEFT, RIGHT, FORWARD, BACKWARD, INTERACT, PICK_UP, DROP, DONE = range(8)
LYING, HELD, BOXED, GONE = range(4)
PLAZA = """
#########
#S.k.R..#
#.o..#G.#
#b..x##d#
#...~..~#
#########
"""


@functools.cache
def plaza():
    # With the default params, steps and arms would end exactly on the edges of tiles.
    return drawn(PLAZA, interact_distance=0.87, move_distance=0.17)


def put(state, x, y, quarter):
    """The state with the agent at another pose."""
    place = jnp.array([x, y], jnp.float32)
    return state.replace(position=place, heading=jnp.float32(quarter * math.pi / 2))


def after(step, state, first, *others):
    """The state, reward, termination and info after some actions."""
    out = step(state, jnp.int32(first))
    for action in others:
        out = step(out[0], jnp.int32(action))
    return out


def number(state, kind, at=0):
    return int(np.flatnonzero(np.asarray(state.things.kind) == kind)[at])


def test_objects_block_the_way():
    _, _, state, step = plaza()
    blocked = after(step, put(state, 2.9, 1.5, 0), FORWARD)[0]
    np.testing.assert_allclose(blocked.position, [2.9, 1.5])
    key = number(state, 0)
    taken, _, _, info = after(step, put(state, 2.5, 1.5, 0), PICK_UP)
    assert bool(info["picked_up"])
    assert int(info["carried"]) == KEY.labels[RED]
    assert int(taken.things.place[key]) == HELD
    walked = after(step, put(taken, 2.9, 1.5, 0), FORWARD)[0]
    np.testing.assert_allclose(walked.position, [3.07, 1.5], rtol=1e-6)


@pytest.mark.parametrize(
    ("x", "y", "quarter", "free"),
    [
        (3.5, 1.5, 0, True),  # floor
        (4.5, 1.5, 0, False),  # a door
        (2.5, 3.5, 3, False),  # a ball
        (1.5, 1.5, 3, False),  # a wall
        (6.5, 1.5, 1, False),  # the goal
        (3.5, 4.5, 0, False),  # lava
        (1.1, 1.5, 0, False),  # the arm does not reach past its own tile
    ],
)
def test_carried_object_drops_only_on_empty_floor(x, y, quarter, free):
    _, _, state, step = plaza()
    key = number(state, 0)
    state = after(step, put(state, 2.5, 1.5, 0), PICK_UP)[0]
    dropped, _, _, info = after(step, put(state, x, y, quarter), DROP)
    assert bool(info["dropped"]) == free
    assert int(dropped.things.place[key]) == (LYING if free else HELD)
    if free:
        assert np.asarray(dropped.things.tile[key]).tolist() == [4, 1]


def test_locked_door_opens_with_carried_key_and_closes_again():
    _, _, state, step = plaza()
    before = put(state, 4.5, 1.5, 0)
    shut, _, _, info = after(step, before, INTERACT)
    assert not bool(info["opened_door"])
    assert not np.asarray(shut.doors.opened).any()
    keyed = put(after(step, put(state, 2.5, 1.5, 0), PICK_UP)[0], 4.5, 1.5, 0)
    opened, _, _, info = after(step, keyed, INTERACT)
    assert bool(info["opened_door"])
    assert int(info["carried"]) == KEY.labels[RED]
    door = int(np.flatnonzero(np.asarray(state.doors.colour) == RED)[0])
    assert np.flatnonzero(np.asarray(opened.doors.opened)).tolist() == [door]
    column, row = np.asarray(state.level.doors)[door]
    assert int(state.level.walls[0, row, column]) == door_label(RED, locked=True)
    assert int(opened.level.walls[0, row, column]) == door_label(RED, locked=False)
    inside = after(step, opened, FORWARD, FORWARD, FORWARD, FORWARD)[0]
    assert float(inside.position[0]) > 5
    # An agent cannot close the door that it stands in.
    stays, _, _, info = after(step, put(inside, 5.05, 1.5, 0), INTERACT)
    assert np.asarray(stays.doors.opened)[door]
    closed, _, _, info = after(step, put(opened, 4.5, 1.5, 0), INTERACT)
    assert bool(info["closed_door"])
    assert not np.asarray(closed.doors.opened).any()
    # A key has unlocked it for good.
    held = closed.things.held
    place = jnp.where(held, GONE, closed.things.place)
    without = closed.replace(things=closed.things.replace(place=place))
    assert np.asarray(after(step, without, INTERACT)[0].doors.opened)[door]


def test_box_keeps_its_key_when_carried():
    _, _, state, step = plaza()
    box, key = number(state, 2), number(state, 0, 1)
    assert int(state.things.place[key]) == BOXED
    here, _, _, info = after(step, put(state, 2.5, 3.5, 2), INTERACT)
    assert bool(info["opened_box"])
    assert np.asarray(here.things.place)[[box, key]].tolist() == [GONE, LYING]
    assert np.asarray(here.things.tile)[key].tolist() == [1, 3]
    carried, _, _, info = after(step, put(state, 2.5, 3.5, 2), PICK_UP)
    assert int(info["carried"]) == BOX.labels[3]
    there = after(step, put(carried, 1.5, 1.5, 1), DROP)[0]
    opened = after(step, put(there, 1.5, 1.5, 1), INTERACT)[0]
    assert np.asarray(opened.things.tile)[key].tolist() == [1, 2]
    assert int(after(step, opened, PICK_UP)[3]["carried"]) == KEY.labels[YELLOW]


def test_ends_and_rewards():
    _, params, state, step = drawn(PLAZA, time_cost=0.9, fail_reward=-2.0)
    state = state.replace(time=jnp.int32(299))
    steps = float(params.max_steps_in_episode)
    _, reward, terminated, info = after(step, put(state, 6.5, 1.95, 1), FORWARD)
    assert bool(terminated)
    assert bool(info["success"])
    assert float(reward) == pytest.approx(1 - 0.9 * 300 / steps)
    _, reward, terminated, info = after(step, put(state, 3.95, 4.5, 0), FORWARD)
    assert bool(terminated)
    assert bool(info["failed"])
    assert not bool(info["success"])
    assert float(reward) == -2


class Slow:
    """The same rules on dictionaries, with segments looked at point by point."""

    def __init__(self, text):
        lines = text.split()
        self.walls = {
            (c, r) for r, line in enumerate(lines) for c, m in enumerate(line) if m == "#"
        }
        self.doors, self.things, self.hand = {}, {}, None
        for row, line in enumerate(lines):
            for column, mark in enumerate(line):
                if mark in DOORS:
                    self.doors[column, row] = [*DOORS[mark], False]
                if mark in PAINT:
                    content = (0, YELLOW, None) if mark == "b" else None
                    self.things[column, row] = (*PAINT[mark], content)
                if mark == "S":
                    self.x, self.y, self.quarter = column + 0.5, row + 0.5, 0

    def tiles(self, length):
        """The tiles that a segment ahead enters, in order."""
        dx, dy = ((1, 0), (0, 1), (-1, 0), (0, -1))[self.quarter]
        seen = []
        for part in np.linspace(0, length, 400):
            tile = math.floor(self.x + dx * part), math.floor(self.y + dy * part)
            if tile not in seen:
                seen.append(tile)
        return seen

    def solid(self, tile):
        door, thing = self.doors.get(tile), self.things.get(tile)
        return tile in self.walls or (door and not door[2]) or (thing and thing[0] < 3)

    def act(self, action):
        if action in (LEFT, RIGHT):
            self.quarter = (self.quarter + (1 if action == RIGHT else -1)) % 4
        if action in (FORWARD, BACKWARD):
            length = 0.17 if action == FORWARD else -0.17
            if not any(self.solid(tile) for tile in self.tiles(length)[1:]):
                dx, dy = ((1, 0), (0, 1), (-1, 0), (0, -1))[self.quarter]
                self.x, self.y = self.x + dx * length, self.y + dy * length
        if action not in (INTERACT, PICK_UP, DROP) or len(ahead := self.tiles(0.87)) < 2:
            return
        tile = ahead[1]
        thing, door = self.things.get(tile), self.doors.get(tile)
        if action == INTERACT and door:
            colour, locked, is_open = door
            if not locked or (self.hand and self.hand[:2] == (0, colour)):
                self.doors[tile] = [colour, False, not is_open]
        if action == INTERACT and thing and thing[0] == 2:
            del self.things[tile]
            if thing[2]:
                self.things[tile] = thing[2]
        if action == PICK_UP and thing and thing[0] < 3 and not self.hand:
            self.hand = self.things.pop(tile)
        elif action == DROP and self.hand and not thing and not door and tile not in self.walls:
            self.things[tile], self.hand = self.hand, None


def shown(state):
    """The places of things, the held thing and the open doors of a state."""
    things = jax.device_get(state.things)
    rows = list(zip(things.kind.tolist(), things.colour.tolist(), strict=True))
    lies = {
        tuple(things.tile[i].tolist()): rows[i]
        for i in range(len(rows))
        if things.place[i] == LYING
    }
    held = [rows[i] for i in range(len(rows)) if things.place[i] == HELD]
    opened = np.asarray(state.doors.opened).tolist()
    doors = [tuple(tile) for tile in np.asarray(state.level.doors).tolist()]
    return lies, held, dict(zip(doors, opened, strict=True))


def test_random_play_matches_a_slow_program():
    _, _, state, step = plaza()
    rng = np.random.default_rng(3)
    slow, done = Slow(PLAZA), []
    chances = [0.14, 0.14, 0.38, 0.04, 0.1, 0.1, 0.1]
    floor = [(c, r) for r in range(1, 5) for c in range(1, 8) if (c, r) not in slow.walls]
    for time in range(1200):
        if time % 40 == 0:
            free = [tile for tile in floor if tile not in slow.things and tile not in slow.doors]
            column, row = free[rng.integers(len(free))]
            slow.x, slow.y, slow.quarter = column + 0.5, row + 0.5, int(rng.integers(4))
            state = put(state, slow.x, slow.y, slow.quarter)
        action = int(rng.choice(7, p=chances))
        state, *_, info = step(state, jnp.int32(action))
        slow.act(action)
        done += [name for name, happened in info.items() if name[-1] in "drxp" and happened.any()]
        np.testing.assert_allclose(state.position, [slow.x, slow.y], atol=1e-3)
        lies, held, doors = shown(state)
        assert lies == {tile: thing[:2] for tile, thing in slow.things.items()}
        assert held == ([slow.hand[:2]] if slow.hand else [])
        assert doors == {tile: is_open for tile, (_, _, is_open) in slow.doors.items()}
    assert {"picked_up", "dropped", "opened_door", "closed_door", "opened_box"} <= set(done)


def test_frame_shows_the_carried_object():
    env, params, state, step = plaza()
    draw = jax.jit(lambda state: env.draw(state, params, "labels"))
    assert not (np.asarray(draw(put(state, 1.5, 3.5, 1))) == BALL.labels[1]).any()
    carried = after(step, put(state, 2.5, 3.5, 3), PICK_UP)[0]
    # Right before a wall, at the lower right.
    seen = np.asarray(draw(put(carried, 1.5, 4.9, 1))) == BALL.labels[1]
    rows, columns = np.nonzero(seen)
    assert len(rows) >= 3
    assert rows.min() >= 10
    assert columns.min() >= 9
    variables = env.variables(carried)["carried"]
    assert np.flatnonzero(variables).tolist() == [1, 6 + 1]
    assert env.variable_spaces()["carried"].shape == variables.shape
