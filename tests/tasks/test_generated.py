"""The levels that a generated task draws."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from jaxenstein.errors import SettingError
from jaxenstein.maps.ascii import parse_ascii
from jaxenstein.spec import spec_of
from jaxenstein.tasks.levels import closed_doors

NAME = "key-corridor-s3r1"


def first_states(count, **settings):
    env, params = jaxenstein.make(NAME, height=8, width=8, **settings)
    keys = jax.random.split(jax.random.key(2), count)
    draw = jax.jit(jax.vmap(lambda key: env.init_state(key, env.check_params(params))))
    return env, jax.device_get(draw(keys))


def layouts(states):
    parts = states.level.walls, states.level.doors, states.key, states.key_colour, states.goal
    return [tuple(leaf[i].tobytes() for leaf in parts) for i in range(len(states.key))]


def test_levels_match_their_seeds():
    first = 4_000_000_000
    env, few = first_states(300, levels=(first, first + 2))
    seen = layouts(few)
    one = [set(layouts(first_states(20, levels=range(s, s + 1))[1])) for s in (first, first + 1)]
    assert [len(found) for found in one] == [1, 1]
    assert set(seen) == one[0] | one[1]
    # Each level is equally likely, and each episode draws its own start.
    assert min(seen.count(layout) for layout in set(seen)) >= 100
    assert len(set(few.heading[[layout == seen[0] for layout in seen]].tolist())) > 1
    assert env.about().generated
    assert not jaxenstein.make(NAME, levels=(3, 4))[0].about().generated


def test_layout_seed_equals_a_range_of_one():
    seed = 2**32 - 1
    assert layouts(first_states(2, layout_seed=seed)[1]) == layouts(
        first_states(2, levels=(seed, seed + 1))[1]
    )
    with pytest.raises(SettingError, match="either levels or layout_seed"):
        jaxenstein.make(NAME, layout_seed=3, levels=(3, 4))


def test_levels_do_not_depend_on_the_kind_of_generator():
    env, params = jaxenstein.make(NAME, height=8, width=8, levels=(7, 8))
    states = [
        env.init_state(jax.random.key(0, impl=kind), env.check_params(params))
        for kind in ("threefry2x32", "rbg")
    ]
    with jax.default_prng_impl("rbg"):
        states.append(env.init_state(jax.random.key(0), env.check_params(params)))
    for other in states[1:]:
        np.testing.assert_array_equal(states[0].level.walls, other.level.walls)
        assert jnp.array_equal(states[0].key, other.key)


def test_equal_levels_make_equal_environments_and_specs():
    one, params = jaxenstein.make(NAME, levels=range(3, 6))
    assert one == jaxenstein.make(NAME, levels=[3, 6])[0]
    assert spec_of(one, params).build()[0] == dataclasses.replace(one, autoreset=None)


def test_closed_doors_are_found_by_position() -> None:
    tilemap = parse_ascii("######\n#SrRb#\n#..BG#\n######", "doors", goal_required=False)
    places = [(door.column, door.row) for door in tilemap.doors]
    assert len(places) == 2
    # A level that has them the other way round, between absent doors.
    level = np.array([(0, 0), places[1], (0, 0), places[0]])
    closed = np.array([[True, False, True, True], [True, True, True, False]])
    found = closed_doors(tilemap, level, closed)
    np.testing.assert_array_equal(found, [[True, False], [False, True]])
    np.testing.assert_array_equal(closed_doors(tilemap, level[:2], closed[0, :2]), [True, False])
    bare = parse_ascii("####\n#SG#\n####", "bare")
    assert closed_doors(bare, np.zeros((0, 2)), np.zeros((5, 0))).shape == (5, 0)
