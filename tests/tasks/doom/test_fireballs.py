"""Fireballs by exact small cases, and Take Cover: the eye that bobs, and imps that join."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxenstein.pytree import PyTreeNode
from jaxenstein.tasks.doom.collision import segments, way_to
from jaxenstein.tasks.doom.fixed import ONE
from jaxenstein.tasks.doom.maps import Line
from jaxenstein.tasks.doom.parts import Game
from jaxenstein.tasks.doom.projectiles import Projectiles, fireballs, throw
from jaxenstein.tasks.doom.view import EYE
from tests.tasks.doom.cases import first_state, make, place, places, player

# Actions from the start of an episode on, and the height of the game's camera after some of them
# (ViZDoom 1.3.2, `CAMERA_POSITION_Z`).
ACTIONS = [1] * 30 + [2] * 33 + [0] * 10 + [2] * 40
TICS = 6, 7, 15, 24, 30, 33, 54, 62, 63, 72, 84, 98, 104, 112
HEIGHTS = (
    *(41.0, 41.041, 38.372, 46.511, 39.726, 40.408, 35.38),
    *(46.552, 46.362, 40.225, 46.111, 38.775, 48.558, 34.695),
)
BALLS = fireballs(3)
WALLS = segments([Line(-300, 100, -300, -100, "-")])


@jax.jit
def flown(balls: Projectiles, player: jax.Array, others: jax.Array, living: jax.Array) -> Any:
    """Forty tics: positions, who flies, who hits the player, bursts."""

    def tic(balls: Projectiles, _: None) -> Any:
        places = jnp.concatenate([others, player[None]])
        bodies = places, np.array([20, 20, 16]), jnp.append(living, True)
        after, hits = BALLS.fly(balls, bodies, WALLS)
        return after, (after.position, after.flies, hits[:, -1], after.bursts)

    return jax.lax.scan(tic, balls, None, length=40)[1]


def shoot(at: tuple[float, float], living: list[bool]) -> Any:
    """One fireball from the origin, which the first of two monsters has thrown, to (-200, 0)."""
    others = places((0, 0), (-100, 0))
    way = way_to(others, places((-200, 0)))
    balls = throw(BALLS.none(), jnp.array([True, False]), others, way, 10)
    out = flown(balls, place(*at), others, jnp.array(living))
    return jax.tree.map(np.asarray, out)


def test_fireball_flies_ten_units_a_tic_and_hits_the_player() -> None:
    position, flies, hits, bursts = shoot((-200, 0), [True, False])
    # It has half a tic's way behind it; it stops within a third of a tic of the box, 22 away.
    steps = position[:17, 0, 0] / ONE
    np.testing.assert_allclose(steps, -15 - 10 * np.arange(17), atol=1e-3)
    assert np.flatnonzero(hits[:, 0]).tolist() == [17]
    assert -185.1 < position[17, 0, 0] / ONE < -178
    assert flies[:, 0].tolist() == [True] * 17 + [False] * 23
    assert bursts[16:37, 0].tolist() == [0, *range(18, -1, -1), 0]
    assert not flies[:, 1:].any()


def test_fireball_just_hits_and_just_misses() -> None:
    """The boxes' half-widths are 6 and 16; boxes that only touch do not meet."""
    assert shoot((-200, 21.99), [True, False])[2].any()
    position, _, hits, _ = shoot((-200, 22), [True, False])
    assert not hits.any()
    # Then it ends at the wall, of which its box may touch, but not cross it.
    assert -301 < position[-1, 0, 0] / ONE < -294


def test_fireball_stops_at_another_monster_without_damage() -> None:
    position, _, hits, _ = shoot((-200, 0), [True, True])
    assert not hits.any()
    assert -81 < position[-1, 0, 0] / ONE < -74


def test_new_fireballs_replace_the_oldest() -> None:
    origin = places((0, 0), (0, 50))
    way = way_to(origin, places((-200, 0)))
    balls = BALLS.none()
    for _ in range(2):
        balls = throw(balls, jnp.array([True, True]), origin, way, 10)
    assert balls.owner.tolist() == [1, 1, 0]
    assert int(balls.next) == 1
    assert balls.flies.all()


class Air(PyTreeNode):
    """A state of which only the fireballs matter."""

    fireballs: Projectiles


def test_fireballs_read_from_the_game_fly_or_burst() -> None:
    rows = [(10, 20, 7, 0, 0), (30, 40, 8, 0, 10 * ONE), (50, 60, 9, 0, 10 * ONE)]
    game = Game(("DoomImpBall", "BaronBall", "DoomImpBall"), np.array(rows, np.int64), {})

    def told(count: int) -> Any:
        part = fireballs(count)
        return part.from_game(Air(part.none()), game).fireballs

    balls = told(4)
    assert balls.position.tolist() == [[30, 40], [50, 60], [10, 20], [0, 0]]
    assert balls.flies.tolist() == [True, True, False, False]
    assert (np.asarray(balls.bursts) > 0).tolist() == [False, False, True, False]
    assert told(2).position.tolist() == [[30, 40], [50, 60]]


def test_eye_bobs_as_in_the_game() -> None:
    env, params = make("doom-take-cover")
    tics = player(env, params)(first_state(env, params), ACTIONS)
    lifts = jax.jit(jax.vmap(env.lift))(tics.state) * env.unit
    np.testing.assert_allclose(EYE + lifts[np.array(TICS)], HEIGHTS, atol=0.005)


def test_imps_wake_throw_damage_and_multiply() -> None:
    env, params = make("doom-take-cover")
    params = params.replace(damage_factor=0.5)
    state = first_state(env, params, 5)
    reward, terminated, info, after = player(env, params)(state, [0] * 300, seed=5)
    hits, health, imps = info["hits"], after.health, after.monsters.present.sum(axis=1)
    flying = after.fireballs.flies.any(axis=1)
    assert (reward == 1).all()
    # Who has looked after 9 tics waits for 8 steps of 3 tics and aims for 16.
    assert not flying[: 9 + 21 + 16].any()
    assert flying.any()
    assert hits.any()
    first = int(np.flatnonzero(hits)[0])
    assert (health[:first] == 100).all()
    # 3 to 24 points, of which a half is left, rounded down.
    assert 1 <= 100 - health[first] <= 12 * hits[first]
    assert not terminated[:first].any()
    assert imps[58] == 3
    assert imps[59] in (3, 4)
    assert imps[-1] > 4
    assert (np.diff(imps) >= 0).all()
