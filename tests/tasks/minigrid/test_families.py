"""Every world that is registered: what it holds, and that it can be solved."""

import functools
from typing import Any

import jax
import numpy as np
import pytest

import jaxenstein
from jaxenstein.errors import SettingError
from jaxenstein.players import player_of
from jaxenstein.players.playing import play
from jaxenstein.tasks.minigrid.errands import GoToDoor, Memory
from jaxenstein.tasks.minigrid.table import PREFIX, WORLDS, build
from tests.tasks.minigrid.search import BALL, BOX, GOAL, GONE, KEY, LAVA, LYING, reached, solvable

SIZES = {name: (world.source, *size) for world in WORLDS for name, size in world.sizes.items()}
FEW, MANY = 256, 4096
# One of each class, of which the most involved are not among the slow tests.
SHOWN = (
    "four-rooms",
    "empty-random-5x5",
    "multi-room-n4-s5",
    "lava-crossing-s9n3",
    "lava-gap-s5",
    "dist-shift2",
    "dynamic-obstacles-random-5x5",
    "door-key-5x5",
    "locked-room",
    "red-blue-doors-6x6",
    "unlock",
    "blocked-unlock-pickup",
    "key-corridor-s3r3",
    "obstructed-maze-full",
    "memory-s13-random",
    "fetch-8x8-n3",
    "go-to-door-5x5",
    "go-to-object-6x6-n2",
    "put-near-8x8-n3",
)
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
    env: Any = build(*SIZES[name])(height=8, width=8)
    return env, env.check_params()


@functools.cache
def levels(name, count):
    env, params = world(name)
    keys = jax.random.split(jax.random.key(5), count)
    return jax.device_get(jax.jit(jax.vmap(lambda key: env.init_state(key, params)))(keys))


def check(name, count):
    """Levels can be solved, and hold what they should, each thing on a tile of its own."""
    env, _ = world(name)
    states = levels(name, count)
    good = solvable(env, states)
    assert good.all(), f"{(~good).sum()} of {count} cannot be solved"
    things, batch = states.things, np.arange(count)
    walls = states.level.walls[:, 0] != 0
    row, column = things.tile[..., 1], things.tile[..., 0]
    lies = things.place == LYING
    assert not (walls[batch[:, None], row, column] & lies).any()
    cell = np.floor(states.position).astype(int)
    assert not walls[batch, cell[:, 1], cell[:, 0]].any()
    here = lies & (column == cell[:, :1]) & (row == cell[:, 1:])
    assert not here.any()
    flat = np.where(lies, row * walls.shape[2] + column, -1 - np.arange(row.shape[1]))
    flat.sort(axis=1)
    assert (np.diff(flat, axis=1) > 0).all()
    assert set(np.unique(things.kind).tolist()) <= set(env.kinds)
    assert ((things.colour >= 0) & (things.colour < 6)).all()


@pytest.mark.parametrize("name", QUICK)
def test_levels_can_be_solved(name):
    check(name, FEW)


@pytest.mark.slow
@pytest.mark.parametrize("name", SIZES)
def test_thousands_of_levels_can_be_solved(name):
    check(name, MANY)


@pytest.mark.slow
@pytest.mark.parametrize("name", SHOWN)
def test_the_planner_solves_them(name):
    env, params = world(name)
    states = jax.tree.map(lambda leaf: jax.numpy.asarray(leaf[:64]), levels(name, FEW))
    played = play(env, player_of(env), params, jax.random.key(0), states)
    wandering = name.startswith("dynamic")
    assert np.asarray(played.successes).sum() >= (60 if wandering else 64)


def test_what_the_search_finds_out():
    """A level whose key is taken away, or whose box is empty, cannot be solved."""
    for name, which in (("door-key-5x5", KEY), ("unlock", KEY)):
        env, _ = world(name)
        states = levels(name, FEW)
        place = np.where(states.things.kind == which, GONE, states.things.place)
        assert not solvable(env, states.replace(things=states.things.replace(place=place))).any()
    seen, got, doors = reached(levels("blocked-unlock-pickup", FEW))
    assert got.all()
    assert doors.all()
    assert (seen.sum(axis=(1, 2)) > 32).all()


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


def test_ids_and_horizons():
    for name, (_, moves, _) in SIZES.items():
        _, params = jaxenstein.make(PREFIX + name)
        assert int(params.max_steps_in_episode) == round(moves / 0.15)
    assert len(SIZES) == 70


@pytest.mark.parametrize(
    ("kind", "settings", "match"),
    [(GoToDoor, {"size": 4}, "size must be a whole number from 5"), (Memory, {"size": 6}, "size")],
)
def test_sizes_that_cannot_be_built_are_refused(kind, settings, match):
    with pytest.raises(SettingError, match=match):
        kind(**settings)


def test_levels_of_a_range_are_those_of_their_seeds():
    env = build(*SIZES["fetch-8x8-n3"])(height=8, width=8, levels=(7, 9))
    draw = jax.jit(jax.vmap(lambda key: env.init_state(key, env.default_params)))
    states = jax.device_get(draw(jax.random.split(jax.random.key(0), 64)))
    assert len(np.unique(states.things.tile.reshape(64, -1), axis=0)) == 2
    assert len(np.unique(states.position, axis=0)) <= 2
    assert env.about().generated
