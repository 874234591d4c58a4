"""Memory Maze: levels by search on the host, rules in plain steps of a jitted function."""

import functools
import itertools
import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from jaxenstein.errors import SettingError
from jaxenstein.maps.reach import walking_distances
from jaxenstein.maps.things import BALL
from jaxenstein.tasks.memory_maze import COLOURS, MemoryMaze


@functools.cache
def task(size, **settings) -> Any:
    env, params = jaxenstein.make(f"memory-maze-{size}x{size}", height=16, width=16, **settings)
    return env, env.check_params(params)


@functools.cache
def first_states(size, count):
    env, params = task(size)
    keys = jax.random.split(jax.random.key(2), count)
    return jax.device_get(jax.jit(jax.vmap(lambda key: env.init_state(key, params)))(keys))


@functools.cache
def stepper():
    env, params = task(9)
    states = first_states(9, 256)
    return jax.jit(lambda k, s, a: env.advance(k, s, a, params)), jax.tree.map(
        lambda x: x[0], states
    )


def check_levels(size, count):
    states = first_states(size, count)
    assert states.level.walls.shape[1:] == (1, size + 2, size + 2)
    number = {9: 3, 11: 4, 13: 5, 15: 6}[size]
    assert states.things.shape[1] == number
    for i in range(count):
        walls = states.level.walls[i, 0]
        column, row = np.floor(states.position[i]).astype(int)
        steps = walking_distances(walls == 0, ((column, row),))[0]
        columns, rows = np.floor(states.things[i]).astype(int).T
        assert (steps[rows, columns] > 0).all()
        # Things are in different rooms, and no two are close enough to touch both.
        apart = np.abs(states.things[i][:, None] - states.things[i][None]).max(-1)
        assert (apart[~np.eye(number, dtype=bool)] >= 2).all()
        third = (0, (size + 2) // 3, 2 * (size + 2) // 3, size + 2)
        for top, bottom in itertools.pairwise(third):
            for left, right in itertools.pairwise(third):
                assert len(set(walls[top:bottom, left:right].ravel().tolist()) - {0}) <= 1
    # 99.9 % quantiles of chi squared are below these: 2, and 5 degrees of freedom.
    asked = np.bincount(states.wanted, minlength=number)
    assert ((asked - count / number) ** 2 / (count / number)).sum() < 25


def test_levels():
    check_levels(9, 256)


@pytest.mark.slow
@pytest.mark.parametrize("size", [9, 11, 13, 15])
def test_thousands_of_levels(size):
    check_levels(size, 4096)


@pytest.mark.parametrize(
    ("action", "turned", "walked"),
    [(-1, 0, 0), (0, 0, 0), (1, 0, 1), (2, -1, 0), (3, 1, 0), (4, -1, 1), (5, 1, 1)],
)
def test_actions_turn_and_walk_together(action, turned, walked):
    step, state = stepper()
    thing = state.things[state.wanted]
    state = state.replace(heading=jnp.float32(1.0))
    after, *_ = step(jax.random.key(0), state, jnp.int32(action))
    heading = 1.0 + turned * math.radians(21.5)
    target = state.position + 0.25 * walked * np.array([math.cos(heading), math.sin(heading)])
    column, row = np.floor(target).astype(int)
    assert float(after.heading) == pytest.approx(heading, abs=1e-6)
    expected = target if state.level.walls[0, row, column] == 0 else state.position
    np.testing.assert_allclose(after.position, expected, atol=1e-6)
    assert (thing == after.things[state.wanted]).all()


def test_target_pays_and_then_changes():
    step, state = stepper()
    many = jax.vmap(step, (0, None, None))
    for wanted in range(3):
        state = state.replace(wanted=jnp.int32(wanted))
        for there in range(3):
            near = state.things[there] + np.array([0.38, 0], np.float32)
            state = state.replace(position=jnp.asarray(near))
            keys = jax.random.split(jax.random.key(1), 200)
            after, reward, terminated, info = many(keys, state, jnp.int32(0))
            fetched = there == wanted
            assert (np.asarray(reward) == fetched).all()
            assert (np.asarray(info["fetched"]) == fetched).all()
            assert (np.asarray(info["success"]) == fetched).all()
            assert not np.asarray(terminated).any()
            counts = np.bincount(np.asarray(after.wanted), minlength=3)
            assert counts[wanted] == (0 if fetched else 200)
            assert not fetched or (np.delete(counts, wanted) > 60).all()
    far = state.replace(position=jnp.asarray(state.things[2] + np.array([0.4, 0], np.float32)))
    assert float(step(jax.random.key(0), far, jnp.int32(0))[1]) == 0


@pytest.mark.parametrize(
    "kind", ["rgb", *(pytest.param(k, marks=pytest.mark.slow) for k in ("gray", "labels", "depth"))]
)
def test_frame_border_has_the_colour_of_the_target(kind):
    env, params = task(9, observation=kind)
    _, state = stepper()
    draw = jax.vmap(lambda i: env.draw(state.replace(wanted=i), params, kind))
    images = np.asarray(draw(jnp.arange(3)))
    rims = np.concatenate([images[:, 0], images[:, -1], images[:, :, 0], images[:, :, -1]], axis=1)
    if kind == "depth":
        assert (images == images[0]).all()
        return
    for rim, colour, label in zip(rims, COLOURS, BALL.labels, strict=False):
        seen = np.unique(rim, axis=0)
        assert len(seen) == 1
        if kind == "labels":
            assert seen[0] == label
        elif kind == "rgb":
            np.testing.assert_allclose(seen[0], np.array(colour) * 0.7, atol=0.5)
        else:
            luma = np.array([0.299, 0.587, 0.114]) @ (np.array(colour) * 0.7)
            assert seen[0] == pytest.approx(luma, abs=1.5)
    # In a picture of 16 by 16 pixels the frame is one pixel wide.
    assert (images[0, 1:-1, 1:-1] == images[1, 1:-1, 1:-1]).all()


def test_more_things_than_rooms_are_refused():
    with pytest.raises(SettingError, match="things must be a whole number from 2 to 3"):
        MemoryMaze(things=4)
