"""MiniWorld's rooms and mazes: places by search on the host, the reward by its formula."""

from __future__ import annotations

import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from jaxenstein.maps.reach import open_tiles, walking_distances
from jaxenstein.players import play, player_of
from jaxenstein.tasks.miniworld.rooms import ROOMS

# Tiles inside the walls, and T of the reward.
SIZES = {
    "hallway": (48, 250),
    "one-room": (100, 180),
    "one-room-s6": (36, 100),
    "one-room-s6-fast": (36, 50),
    "four-rooms": (4 * 36 + 4 * 4, 250),
    "t-maze": (9 * 4 + 4 * 16, 280),
    "t-maze-left": (9 * 4 + 4 * 16, 280),
    "t-maze-right": (9 * 4 + 4 * 16, 280),
    "wall-gap": (2 * 14 * 8 + 3, 300),
    "sidewalk": (3 * 12 + 6 * 30, 150),
}
MAZES = {"maze-s2": (2, 96), "maze-s3": (3, 216), "maze": (8, 1536), "maze-s3-fast": (3, 300)}


@functools.cache
def task(name) -> tuple[Any, Any]:
    env, params = jaxenstein.make(f"miniworld-{name}", height=8, width=8)
    return env, env.check_params(params)


@functools.cache
def first_states(name, count=256):
    env, params = task(name)
    keys = jax.random.split(jax.random.key(2), count)
    return jax.device_get(jax.jit(jax.vmap(lambda key: env.init_state(key, params)))(keys))


def test_rooms() -> None:
    assert set(SIZES) == set(ROOMS)
    for name, (tiles, steps) in SIZES.items():
        env, params = task(name)
        assert (open_tiles(env.tilemap).sum(), int(params.max_steps_in_episode)) == (tiles, steps)
        # All places in the areas of starts and boxes are connected.
        for area in (*env.starts, *env.boxes):
            corners = np.array(area).reshape(2, 2)
            for x in corners[:, 0] - (0, 1e-3):
                for y in corners[:, 1] - (0, 1e-3):
                    assert env.tilemap.is_floor(int(x), int(y)), (name, area)
        first = tuple(np.argwhere(open_tiles(env.tilemap))[0][::-1].tolist())
        steps_from = walking_distances(open_tiles(env.tilemap), (first,))[0]
        assert (steps_from >= 0).sum() == tiles


@pytest.mark.parametrize("name", ["hallway", "t-maze", "sidewalk"])
def test_initial_positions_and_headings(name) -> None:
    env, _ = task(name)
    states = first_states(name)
    assert (np.linalg.norm(states.position - states.goal, axis=1) > 1.153).all()
    columns, rows = np.floor(states.position).astype(int).T
    assert open_tiles(env.tilemap)[rows, columns].all()
    heading = (states.heading + np.pi) % (2 * np.pi) - np.pi
    widest = np.pi if name == "sidewalk" else np.pi / 4
    assert np.abs(heading).max() == pytest.approx(widest, abs=0.05)
    if name == "hallway":
        # The hall is 12 m long; no edge of the box is more than 2 m from its end.
        assert states.goal[:, 0].min() == pytest.approx(11 - 0.566, abs=0.05)
        assert states.goal[:, 0].max() == pytest.approx(13 - 0.566, abs=0.05)
        assert (states.position[:, 0] < 11.4).all()
    if name == "t-maze":
        north = states.goal[:, 1] < 9
        assert 90 < north.sum() < 166
        assert (np.abs(states.goal[:, 1] - 9) > 6 - 0.57).all()
    if name == "sidewalk":
        assert (states.position[:, 0] < 4).all()
        assert (states.goal[:, 1] - states.position[:, 1] > 7).all()


def single(states):
    return jax.tree.map(lambda leaf: jnp.asarray(leaf[0]), states)


def test_later_box_pays_less() -> None:
    env, params = task("hallway")
    step = jax.jit(lambda state: env.advance(jax.random.key(0), state, jnp.int32(-1), params))
    state = single(first_states("hallway"))
    for time in (0, 99, 249):
        near = state.replace(
            time=jnp.int32(time), position=state.goal - jnp.array([1.15, 0], jnp.float32)
        )
        _, reward, terminated, info = step(near)
        assert float(reward) == pytest.approx(1 - 0.2 * (time + 1) / 250, abs=1e-6)
        assert bool(terminated)
        assert bool(info["success"])
    far = state.replace(position=state.goal - jnp.array([1.16, 0], jnp.float32))
    _, reward, terminated, _ = step(far)
    assert (float(reward), bool(terminated)) == (0, False)


def test_street_ends_without_a_reward() -> None:
    env, params = task("sidewalk")
    step = jax.jit(lambda state: env.advance(jax.random.key(0), state, jnp.int32(2), params))
    state = single(first_states("sidewalk")).replace(heading=jnp.float32(0))
    for x, over in ((3.8, False), (3.9, True)):
        after, reward, terminated, info = step(
            state.replace(position=jnp.array([x, 12.5], jnp.float32))
        )
        assert float(after.position[0]) == pytest.approx(x + 0.15)
        assert (float(reward), bool(terminated), bool(info["stepped_off"])) == (0, over, over)
        assert not info["success"]


@pytest.mark.parametrize("name", ["maze-s3"])
def test_mazes_are_trees_of_cells(name) -> None:
    check_mazes(name)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["maze", "maze-s2"])
def test_thousands_of_mazes(name) -> None:
    check_mazes(name, 4096)


def check_mazes(name, count=256) -> None:
    cells, _ = MAZES[name]
    states = first_states(name, count)
    assert (np.linalg.norm(states.position - states.goal, axis=1) > 1.153).all()
    for i in range(count):
        floor = states.level.walls[i, 0] == 0
        assert floor.shape == (4 * cells + 1, 4 * cells + 1)
        # Cells of 3 by 3 tiles, and all of the three tiles between two of them, or none.
        joints = floor.sum() - 9 * cells**2
        assert joints == 3 * (cells**2 - 1)
        goal = tuple(np.floor(states.goal[i]).astype(int).tolist())
        assert (walking_distances(floor, (goal,))[0][floor] >= 0).all()
        for place, margin in ((states.goal[i], 0.566), (states.position[i], 0.4)):
            inside = (place - 1) % 4
            assert (inside >= margin - 1e-3).all()
            assert (inside <= 3 - margin + 1e-3).all()


def backtracked(visited, stack, links, chance, found) -> None:
    """Compute the probability of each maze of 3 by 3 cells, over all paths of the digger."""
    while stack:
        x, y = stack[-1]
        beside = [(x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)]
        ways = [c for c in beside if c not in visited and min(c) >= 0 and max(c) < 3]
        if ways:
            for way in ways:
                link = frozenset([(x, y), way])
                backtracked(
                    visited | {way}, [*stack, way], links | {link}, chance / len(ways), found
                )
            return
        stack = stack[:-1]
    found[links] = found.get(links, 0) + chance


def test_mazes_match_recursive_backtracking() -> None:
    likely: dict[frozenset, float] = {}
    backtracked({(0, 0)}, [(0, 0)], frozenset(), 1.0, likely)
    walls = first_states("maze-s3", 2048).level.walls[:, 0]
    drawn: dict[frozenset, int] = {}
    for wall in walls:
        links = set()
        for x in range(3):
            for y in range(3):
                if x < 2 and wall[4 * y + 2, 4 * x + 4] == 0:
                    links.add(frozenset([(x, y), (x + 1, y)]))
                if y < 2 and wall[4 * y + 4, 4 * x + 2] == 0:
                    links.add(frozenset([(x, y), (x, y + 1)]))
        drawn[frozenset(links)] = drawn.get(frozenset(links), 0) + 1
    assert set(drawn) <= set(likely)
    for links, chance in likely.items():
        spread = np.sqrt(2048 * chance * (1 - chance))
        assert abs(drawn.get(links, 0) - 2048 * chance) < 4 * spread


def test_numbers_of_the_variants() -> None:
    for name, (cells, steps) in MAZES.items():
        env, params = task(name)
        assert (env.cells, int(params.max_steps_in_episode)) == (cells, steps)
    for name in ("maze-s3-fast", "one-room-s6-fast"):
        numbers = task(name)[1]
        assert float(numbers.move_distance) == pytest.approx(0.7)
        assert float(numbers.turn_angle) == pytest.approx(np.pi / 4)
    assert int(task("one-room-s6-fast")[1].max_steps_in_episode) == 50


@pytest.mark.parametrize("name", ["sidewalk", "maze-s3-fast"])
def test_shortest_path_reaches_the_box(name) -> None:
    check_player(name)


@pytest.mark.slow
@pytest.mark.parametrize("name", ROOMS)
def test_shortest_path_reaches_every_box(name) -> None:
    check_player(name, 256)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["maze", "maze-s2", "maze-s3"])
def test_maze_paths_rarely_exceed_the_limit(name) -> None:
    # The limits are MiniWorld's, where cells are closer together.
    assert np.mean(check_player(name, 256, fewest=0.93)) < 1


def check_player(name, count=64, fewest=1.0) -> np.ndarray:
    """bool[count], whether each box is reached; at least a share of `fewest` of them are."""
    env, params = task(name)
    states = jax.tree.map(lambda leaf: jnp.asarray(leaf[:count]), first_states(name))
    out = play(env, player_of(env), params, jax.random.key(0), states)
    reached, lengths = np.asarray(out.successes) > 0, np.asarray(out.length)
    steps = int(params.max_steps_in_episode)
    assert reached.mean() >= fewest
    assert (lengths[~reached] == steps).all()
    np.testing.assert_allclose(
        out.returned, np.where(reached, 1 - 0.2 * lengths / steps, 0), atol=1e-6
    )
    return reached
