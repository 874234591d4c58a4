"""MiniWorld's rooms with things: rules in single steps, and players that solve them."""

from __future__ import annotations

import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from jaxenstein import from_ascii
from jaxenstein.about import Player
from jaxenstein.errors import SettingError
from jaxenstein.players import play, player_of
from jaxenstein.players.walking import movement_of
from jaxenstein.tasks.minigrid.state import BOX_KIND, KEY_KIND
from jaxenstein.tasks.miniworld import objects
from jaxenstein.tasks.miniworld.objects import PickupObjects
from tests.tasks.solving import solvable

LEFT, RIGHT, FORWARD, BACKWARD, PICK_UP, DROP = range(6)


@functools.cache
def task(name) -> tuple[Any, Any]:
    env, params = jaxenstein.make(f"miniworld-{name}", height=8, width=8)
    return env, env.check_params(params)


@functools.cache
def programs(name):
    env, params = task(name)
    reset = jax.jit(jax.vmap(lambda key: env.init_state(key, params)))
    return reset, jax.jit(lambda s, a: env.advance(jax.random.key(7), s, a, params))


def first_states(name, count):
    return programs(name)[0](jax.random.split(jax.random.key(2), count))


def single(states, i=0):
    return jax.tree.map(lambda leaf: leaf[i], states)


def act(name, state, action, **changes):
    """One step from a state with changes."""
    changes = {key: jnp.asarray(value, getattr(state, key).dtype) for key, value in changes.items()}
    return programs(name)[1](state.replace(**changes), jnp.int32(action))


# Without optimisation, a plan with many things takes ten seconds.
@pytest.mark.parametrize(
    "name",
    [*(pytest.param(n, marks=pytest.mark.slow) for n in ("pickup-objects", "put-next")), "sign"],
)
def test_player_solves_levels(name) -> None:
    check_player(name, 32)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["pickup-objects", "put-next", "sign"])
def test_player_solves_hundreds_of_levels(name) -> None:
    check_player(name, 512)


def check_player(name, count) -> None:
    """The planner solves all levels within the time limit; a search shows that it is possible."""
    env, params = task(name)
    states = first_states(name, count)
    assert solvable(env, params, jax.device_get(states)).all()
    out = play(env, player_of(env), params, jax.random.key(0), states)
    assert np.asarray(out.successes).sum() == count
    steps = np.asarray(out.length)
    wanted = {"pickup-objects": 5.0, "put-next": 1 - 0.2 * steps / 250, "sign": 1.0}[name]
    np.testing.assert_allclose(out.returned, np.broadcast_to(wanted, count), atol=1e-5)


def test_collector_survives() -> None:
    env, params = task("collect-health")
    params = params.replace(max_steps_in_episode=jnp.int32(300))
    out = play(env, player_of(env), params, jax.random.key(0), first_states("collect-health", 32))
    assert np.mean(np.asarray(out.returned) == 2 * 300) > 0.9


def test_medkits_are_apart_and_block_the_way() -> None:
    states = jax.device_get(first_states("collect-health", 64))
    for kits, start in zip(states.medkits, states.position, strict=True):
        apart = np.linalg.norm(kits[:, None] - kits[None], axis=-1) + 9 * np.eye(18)
        assert apart.min() >= 0.5
        assert np.linalg.norm(kits - start[None], axis=-1).min() >= 0.65
        assert ((kits >= 1.25) & (kits <= 16.75)).all()
    far = np.full((18, 2), 3.0)
    far[0] = (9.0, 9.0)
    state = single(first_states("collect-health", 1)).replace(medkits=jnp.asarray(far, jnp.float32))
    for x, moves in ((8.1, True), (8.3, False)):
        after = act("collect-health", state, FORWARD, position=[x, 9.0], heading=0.0)[0]
        assert float(after.position[0]) == pytest.approx(x + 0.15 * moves)
        back = act("collect-health", state, BACKWARD, position=[x, 9.0], heading=0.0)[0]
        assert float(back.position[0]) < x
    # A new medkit may appear so near that the agent stands in it: it may step away.
    for action, moved in ((FORWARD, 0), (BACKWARD, -0.15)):
        after = act("collect-health", state, action, position=[8.5, 9.0], heading=0.0)[0]
        assert float(after.position[0]) == pytest.approx(8.5 + moved)


def test_health_is_lost_and_restored() -> None:
    far = np.full((18, 2), 3.0)
    far[0] = (9.0, 9.0)
    state = single(first_states("collect-health", 1)).replace(medkits=jnp.asarray(far, jnp.float32))
    # The hand is 0.6 ahead and reaches 0.48 and the medkit's radius, 0.25.
    for x, reached in ((7.6, False), (7.7, True)):
        after, reward, terminated, info = act(
            "collect-health", state, PICK_UP, position=[x, 9.0], heading=0.0, health=20
        )
        assert int(after.health) == (100 if reached else 18)
        assert bool(info["took_medkit"]) == reached
        moved = (np.asarray(after.medkits) != far).any(axis=1)
        assert moved.tolist() == [reached] + [False] * 17
        assert (float(reward), bool(terminated)) == (2, False)
    after, reward, terminated, info = act("collect-health", state, -1, position=[6, 6], health=2)
    assert (int(after.health), float(reward), bool(terminated)) == (0, -100, True)
    assert info["died"]
    _, reward, terminated, _ = act(
        "collect-health", state, PICK_UP, position=[7.7, 9.0], heading=0.0, health=2
    )
    assert (float(reward), bool(terminated)) == (2, False)


def test_picked_up_object_pays_and_disappears() -> None:
    state = single(first_states("pickup-objects", 1))
    tiles = np.array([(5, 5), (9, 2), (9, 4), (9, 6), (9, 8)])
    things = state.things.replace(tile=jnp.asarray(tiles, jnp.int32))
    state = state.replace(things=things)
    before = {"position": [4.5, 5.5], "heading": 0.0}
    after, reward, over, info = act("pickup-objects", state, PICK_UP, **before)
    assert (float(reward), bool(over), bool(info["picked_up"])) == (1, False, True)
    assert np.asarray(after.things.lying).tolist() == [False] + [True] * 4
    assert not np.asarray(after.things.held).any()
    # It was in the way there; now it is gone.
    near = {"position": [4.95, 5.5], "heading": 0.0}
    assert float(act("pickup-objects", state, FORWARD, **near)[0].position[0]) < 5
    assert float(act("pickup-objects", after, FORWARD, **near)[0].position[0]) > 5
    # Invalid actions do nothing, including interacting and dropping.
    for action in (5, 6, 7, -1):
        same = act("pickup-objects", state, action, **before)[0]
        assert np.asarray(same.things.lying).all()
    last = state.replace(things=things.replace(place=jnp.array([0, 3, 3, 3, 3], jnp.int32)))
    _, reward, over, info = act("pickup-objects", last, PICK_UP, **before)
    assert (float(reward), bool(over), bool(info["success"])) == (1, True, True)
    env, params = task("pickup-objects")
    late, slow = state.replace(time=jnp.int32(199)), params.replace(time_cost=jnp.float32(0.5))
    late = late.replace(position=jnp.array([4.5, 5.5]), heading=jnp.float32(0))
    paid = env.transition(jax.random.key(0), late, jnp.int32(PICK_UP), slow)[1]
    assert float(paid) == 1 - 0.5 * 200 / 400


def test_the_red_box_beside_the_yellow_one() -> None:
    states = jax.device_get(first_states("put-next", 256))
    colours, tiles = states.things.colour, states.things.tile
    assert (np.sort(colours, axis=1) == np.arange(6)).all()
    where = {
        c: np.take_along_axis(tiles, np.argmax(colours == c, 1)[:, None, None], 1)[:, 0]
        for c in range(6)
    }
    assert (np.abs(where[0] - where[4]).sum(axis=1) > 1).all()
    state = single(first_states("put-next", 1))
    order = {int(c): i for i, c in enumerate(state.things.colour)}
    placed = np.array([(12, 1 + 2 * i) for i in range(6)])
    placed[order[4]] = (5, 4)
    held = np.zeros(6, np.int32)
    held[order[0]] = 1
    things = state.things.replace(tile=jnp.asarray(placed, jnp.int32), place=jnp.asarray(held))
    state = state.replace(things=things, time=jnp.int32(99))
    for x, solved in ((4.5, False), (5.5, True)):
        # Dropped on the tile to the south: (4, 5) touches (5, 4) at a corner alone.
        after, reward, over, _ = act(
            "put-next", state, DROP, position=[x, 6.5], heading=1.5 * np.pi
        )
        assert np.asarray(after.things.lying).all()
        assert bool(over) == solved
        assert float(reward) == pytest.approx(1 - 0.2 * 100 / 250 if solved else 0)


def test_sign_shows_the_colour() -> None:
    env, _ = task("sign")
    states = first_states("sign", 128)
    host = jax.device_get(states)
    asked, seen = host.asked[:, 0, 0], host.level.walls[:, 0, 10:13, 11]
    assert set(asked.tolist()) == {KEY_KIND, BOX_KIND}
    assert (seen == seen[:, :1]).all()
    # Red, blue and green walls have the labels 3, 4 and 5; colours are red, green, blue.
    colour = np.array([0, 2, 1])[seen[:, 0] - 3]
    assert set(colour.tolist()) == {0, 1, 2}
    for i in range(16):
        target = np.asarray(env.target(single(states, i)))
        wanted = (host.things.kind[i] == asked[i]) & (host.things.colour[i] == colour[i])
        assert (target == wanted).all()
        assert target.sum() == 1
        word = "box" if asked[i] == BOX_KIND else "key"
        assert (
            env.instruction(single(host, i)) == f"asked for: the {word} in the colour of the sign"
        )
    # The vector does not reveal the colour.
    assert len({single(states, i).asked.tobytes() for i in range(16)}) == 2


def test_touching_the_right_object_pays() -> None:
    state = single(first_states("sign", 1))
    target = np.asarray(task("sign")[0].target(state))
    for i, (column, row) in enumerate(np.asarray(state.things.tile).tolist()):
        inward = np.array((1.0 if column < 5 else -1.0, 0.0)) * (1.72, 0)
        place = np.array((column + 0.5, row + 0.5)) + inward
        _, reward, over, info = act("sign", state, -1, position=place)
        assert (float(reward), bool(over)) == (1 if target[i] else -1, True)
        assert bool(info["success"]) == target[i]
    _, reward, over, info = act("sign", state, 3)
    assert (float(reward), bool(over), bool(info["failed"])) == (0, True, True)
    _, reward, over, _ = act("sign", state, LEFT)
    assert (float(reward), bool(over)) == (0, False)


def test_bad_settings_are_refused() -> None:
    with pytest.raises(SettingError, match="objects must be a whole number from 1 to 30"):
        PickupObjects(objects=31)


def test_open_lines_match_points_along_the_path():
    """Against points on each path: none may be near a solid tile and approach it."""
    rng = np.random.default_rng(0)
    row, column = np.indices((7, 7))
    tiles = np.stack([column.ravel(), row.ravel()], axis=-1) + 0.5
    parts = np.linspace(0, 1, 400)[:, None]
    seen = {True: 0, False: 0}
    for _ in range(12):
        solid = rng.random(49) < 0.12
        here = rng.uniform(1, 6, 2)
        offsets = jnp.asarray((tiles - here).astype(np.float32))
        found = np.asarray(objects._path_is_clear(offsets, jnp.asarray(solid)))
        for tile, lies_open in zip(tiles, found, strict=True):
            points = here + parts * (tile - here)
            distances = np.linalg.norm(points[:, None] - tiles[solid], axis=-1)
            nearer = distances.min(axis=0) < distances[0] - 1e-9
            least = distances.min(axis=0)[nearer]
            if len(least) and abs(least.min() - 0.8) < 0.01:
                continue  # too close to call, by so few points
            assert lies_open == (not len(least) or least.min() > 0.8)
            seen[bool(lies_open)] += 1
    assert min(seen.values()) > 50


def straight_walker(env, params):
    """A player that walks straight."""
    body = movement_of(env, params)

    def choose(key, state):
        scene = env.scene(state, params)
        return objects.walk_straight(body, scene, env.distance_field(state), key)[0]

    return choose


def steps(text):
    """The lengths of 16 episodes from any heading, all of which succeed."""
    env, params = from_ascii(text.strip(), height=8, width=8)
    keys = jax.random.split(jax.random.key(1), 16)
    states = jax.vmap(lambda key: env.init_state(key, params))(keys)
    out = play(env, Player("", straight_walker), params, jax.random.key(0), states)
    assert (np.asarray(out.successes) == 1).all()
    return np.asarray(out.length)


def test_path_across_a_hall_is_straight():
    hall = ["#" * 14, *["#" + "." * 12 + "#"] * 12, "#" * 14]
    hall[1], hall[12] = "#S" + "." * 11 + "#", "#" + "." * 11 + "G#"
    # 11 tiles across and down, less the goal's radius; at most half a turn before.
    most = (11 * 2**0.5 - 0.35) / 0.15 * 1.05 + 13
    assert (steps("\n".join(hall)) <= most).all()


def test_player_arrives_around_corners():
    text = """
#########
#S..#...#
###.#.#.#
#...#.#.#
#.###.#.#
#.....#G#
#########
"""
    assert steps(text).max() < 300
