"""Walking straight across open ground: what lies open, and the action that leads there."""

import jax
import jax.numpy as jnp
import numpy as np

from jaxenstein import from_ascii
from jaxenstein.about import Player
from jaxenstein.players import play, straight
from jaxenstein.players.walking import gait


def test_what_lies_open_as_points_along_the_way_say():
    """Against points on each way, of which none may be near a solid tile and come nearer to it."""
    rng = np.random.default_rng(0)
    row, column = np.indices((7, 7))
    tiles = np.stack([column.ravel(), row.ravel()], axis=-1) + 0.5
    parts = np.linspace(0, 1, 400)[:, None]
    seen = {True: 0, False: 0}
    for _ in range(12):
        solid = rng.random(49) < 0.12
        here = rng.uniform(1, 6, 2)
        offsets = jnp.asarray((tiles - here).astype(np.float32))
        found = np.asarray(straight._lies_open(offsets, jnp.asarray(solid)))
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


def straight_on(env, params):
    """A player that walks straight."""
    body = gait(env, params)

    def choose(key, state):
        scene = env.scene(state, params)
        return straight.walk_straight(body, scene, env.distance_field(state), key)[0]

    return choose


def steps(text):
    """How long 16 episodes from any heading are, all of which arrive."""
    env, params = from_ascii(text.strip(), height=8, width=8)
    keys = jax.random.split(jax.random.key(1), 16)
    states = jax.vmap(lambda key: env.init_state(key, params))(keys)
    out = play(env, Player("", straight_on), params, jax.random.key(0), states)
    assert (np.asarray(out.successes) == 1).all()
    return np.asarray(out.length)


def test_across_a_hall_the_way_is_a_line():
    hall = ["#" * 14, *["#" + "." * 12 + "#"] * 12, "#" * 14]
    hall[1], hall[12] = "#S" + "." * 11 + "#", "#" + "." * 11 + "G#"
    # 11 tiles across and down, less the goal's radius; at most half a turn before.
    most = (11 * 2**0.5 - 0.35) / 0.15 * 1.05 + 13
    assert (steps("\n".join(hall)) <= most).all()


def test_around_corners_it_arrives_too():
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
