"""Every registered world: its content, and that it can be solved."""

import functools
import itertools
from typing import Any

import jax
import numpy as np
import pytest

import jaxenstein
from jaxenstein.catalogue import ENTRIES
from jaxenstein.errors import SettingError
from jaxenstein.tasks.minigrid.instructions import GoToDoor, Memory
from jaxenstein.tasks.minigrid.open_rooms import Crossing, DynamicObstacles, FourRooms
from jaxenstein.tasks.miniworld.objects import PutNext
from jaxenstein.tasks.miniworld.sign import Sign
from tests.tasks.minigrid.drawn import drawn
from tests.tasks.minigrid.search import (
    BALL,
    BOX,
    GOAL,
    GONE,
    KEY,
    LAVA,
    LYING,
    RING,
    Search,
    check_placement,
    hangs_together,
    solvable,
)

PREFIX = "minigrid-"
NAMES = [id.removeprefix(PREFIX) for id in ENTRIES if id.startswith(PREFIX)]
FEW = 256
# Some very different worlds; tests/tasks/test_solvable.py has all worlds, and more levels of each.
QUICK = (
    "multi-room-n4-s5",
    "lava-crossing-s9n3",
    "locked-room",
    "blocked-unlock-pickup",
    "obstructed-maze-full",
    "memory-s13-random",
    "fetch-8x8-n3",
    "put-near-8x8-n3",
)


@functools.cache
def world(name) -> tuple[Any, Any]:
    return jaxenstein.make(PREFIX + name, height=8, width=8)


def test_ball_colour_is_independent_of_the_start():
    states = levels("key-corridor-s3r1", FEW)
    quarters = np.round(np.asarray(states.heading) / (np.pi / 2)).astype(int) % 4
    colours = np.asarray(states.asked)[:, 0, 1]
    for quarter in np.unique(quarters):
        assert set(colours[quarters == quarter].tolist()) == set(range(6))


@functools.cache
def levels(name, count):
    env, params = world(name)
    keys = jax.random.split(jax.random.key(5), count)
    return jax.device_get(jax.jit(jax.vmap(lambda key: env.init_state(key, params)))(keys))


@pytest.mark.parametrize("name", QUICK)
def test_levels_are_solvable(name):
    env, _ = world(name)
    states = levels(name, FEW)
    good = solvable(env, states)
    assert good.all(), f"{(~good).sum()} of {FEW} cannot be solved"
    check_placement(env, states)


def test_search_decides_solvability():
    """A level whose key is taken away, or whose box is empty, cannot be solved."""
    for name, which in (("door-key-5x5", KEY), ("unlock", KEY)):
        env, _ = world(name)
        states = levels(name, FEW)
        place = np.where(states.things.kind == which, GONE, states.things.place)
        assert not solvable(env, states.replace(things=states.things.replace(place=place))).any()
    found = Search(levels("blocked-unlock-pickup", FEW))
    assert found.had.all()
    assert found.opened.all()
    assert found.moved[found.kind == BALL].all()
    # Two rooms and a door, less three things.
    assert (found.floor.sum(axis=(1, 2)) == 2 * 16 + 1 - 3).all()


@pytest.mark.parametrize(
    ("text", "solved"),
    [
        ("######\n#.SoG#\n######", True),
        # The agent picks it up, walks on, and drops it behind itself.
        ("######\n#SooG#\n######", True),
        ("######\n#S~.G#\n######", False),
        # The yellow key is in the box, and the red key blocks it.
        ("########\n#..Skb##\n#....#.#\n##Y###.#\n#G.#####\n########", True),
        ("########\n#..Sk.##\n#....#.#\n##Y###.#\n#G.#####\n########", False),
        # The only matching key would be locked in.
        ("#########\n#bSooYG##\n#########", False),
        ("#########\n#bSooYG##\n##..#####\n#########", True),
        # The key is behind its own door.
        ("#######\n#S.Y.b#\n##.##.#\n##.##G#\n#######", False),
    ],
)
def test_search_moves_obstacles_aside(text, solved):
    env, _, state, _ = drawn(text)
    states = jax.tree.map(lambda leaf: np.asarray(leaf)[None], state)
    assert solvable(env, states).tolist() == [solved]


def test_connectivity_matches_a_slow_search():
    """All surroundings of a tile, as graphs of eight tiles in a ring."""
    rings = np.array(list(itertools.product((False, True), repeat=8)))
    floor = np.zeros((len(rings), 3, 3), bool)
    for k, (row, column) in enumerate(RING):
        floor[:, 1 + row, 1 + column] = rings[:, k]
    for ring, found in zip(rings, hangs_together(floor)[:, 1, 1], strict=True):
        edges = [k for k in range(0, 8, 2) if ring[k]]
        seen = set(edges[:1])
        while more := {n % 8 for k in seen for n in (k - 1, k + 1) if ring[n % 8]} - seen:
            seen |= more
        assert found == (bool(edges) and set(edges) <= seen)


def test_numbers_of_things_and_doors():
    kinds = lambda name: np.bincount(levels(name, FEW).things.kind[0], minlength=5).tolist()  # noqa: E731
    assert kinds("obstructed-maze-full") == [8, 9, 8, 0, 0]
    assert levels("obstructed-maze-full", FEW).doors.locked.sum(axis=1).tolist() == [8] * FEW
    assert kinds("blocked-unlock-pickup") == [1, 1, 1, 0, 0]
    assert kinds("dynamic-obstacles-random-5x5")[BALL] == 2
    crossing = levels("lava-crossing-s9n3", FEW).things
    lava = ((crossing.kind == LAVA) & (crossing.place == LYING)).sum(axis=1)
    # Three streams of seven tiles; where two cross, one tile fewer; and three gaps.
    assert set(lava.tolist()) == {18, 16}
    assert (levels("multi-room-n4-s5", FEW).level.doors.min(axis=(1, 2)) > 0).all()


def test_boxes_hide_keys():
    things = levels("obstructed-maze-full", FEW).things
    for box, kind in zip(things.box[0].tolist(), things.kind[0].tolist(), strict=True):
        assert (box >= 0) == (kind == KEY)
        assert box < 0 or things.kind[0, box] == BOX
    assert (things.kind != GOAL).all()


def test_number_of_environments():
    assert len(NAMES) == 70


@pytest.mark.parametrize(
    ("kind", "settings", "match"),
    [
        (GoToDoor, {"size": 4}, "size must be a whole number from 5"),
        (Memory, {"size": 6}, "size"),
        (FourRooms, {"size": 8}, "size must be odd, not 8"),
        (Crossing, {"size": 10}, "size must be odd, not 10"),
        (DynamicObstacles, {"size": 4, "obstacles": 3}, "obstacles must be .* to 2"),
        (PutNext, {"size": 3}, "size must be a whole number from 4"),
        (Sign, {"size": 40}, "size"),
    ],
)
def test_impossible_sizes_are_refused(kind, settings, match):
    with pytest.raises(SettingError, match=match):
        kind(**settings)


def test_many_crossings_in_a_large_world():
    env = Crossing(size=37, crossings=34)
    jax.eval_shape(env.reset, jax.random.key(0), env.default_params)


def test_levels_of_a_range_match_their_seeds():
    env: Any = jaxenstein.make("minigrid-fetch-8x8-n3", height=8, width=8, levels=(7, 9))[0]
    draw = jax.jit(jax.vmap(lambda key: env.init_state(key, env.default_params)))
    states = jax.device_get(draw(jax.random.split(jax.random.key(0), 64)))
    assert len(np.unique(states.things.tile.reshape(64, -1), axis=0)) == 2
    assert len(np.unique(states.position, axis=0)) <= 2
    assert env.about().generated
