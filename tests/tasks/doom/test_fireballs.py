"""Fireballs by exact small cases: their flight, what they hit, and imps that join."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxenstein.tasks.doom.collision import segments, way_to
from jaxenstein.tasks.doom.fixed import ONE
from jaxenstein.tasks.doom.maps import Line
from jaxenstein.tasks.doom.projectiles import Projectiles, fly, no_projectiles, throw
from tests.tasks.doom.cases import make, place, places, player

WALLS = segments([Line(-300, 100, -300, -100, "-")])


@jax.jit
def flown(balls: Projectiles, player: jax.Array, others: jax.Array, living: jax.Array) -> Any:
    """Forty tics: positions, who flies, who hits the player, bursts."""

    def tic(balls: Projectiles, _: None) -> Any:
        places = jnp.concatenate([others, player[None]])
        bodies = places, np.array([20, 20, 16]), jnp.append(living, True)
        after, hits = fly(balls, 6, bodies, WALLS)
        return after, (after.position, after.flies, hits[:, -1], after.bursts)

    return jax.lax.scan(tic, balls, None, length=40)[1]


def shoot(at: tuple[float, float], living: list[bool]) -> Any:
    """One fireball from the origin, which the first of two monsters has thrown, to (-200, 0)."""
    others = places((0, 0), (-100, 0))
    way = way_to(others, places((-200, 0)))
    balls = throw(no_projectiles(3), jnp.array([True, False]), others, way, 10)
    out = flown(balls, place(*at), others, jnp.array(living))
    return jax.tree.map(np.asarray, out)


def test_a_fireball_flies_ten_units_a_tic_and_ends_at_the_player() -> None:
    position, flies, hits, bursts = shoot((-200, 0), [True, False])
    # It has half a tic's way behind it; it stops within a third of a tic of the box, 22 away.
    steps = position[:17, 0, 0] / ONE
    np.testing.assert_allclose(steps, -15 - 10 * np.arange(17), atol=1e-3)
    assert np.flatnonzero(hits[:, 0]).tolist() == [17]
    assert -185.1 < position[17, 0, 0] / ONE < -178
    assert flies[:, 0].tolist() == [True] * 17 + [False] * 23
    assert bursts[16:37, 0].tolist() == [0, *range(18, -1, -1), 0]
    assert not flies[:, 1:].any()


def test_a_fireball_just_hits_and_just_misses() -> None:
    """The boxes' half-widths are 6 and 16; boxes that only touch do not meet."""
    assert shoot((-200, 21.99), [True, False])[2].any()
    position, _, hits, _ = shoot((-200, 22), [True, False])
    assert not hits.any()
    # Then it ends at the wall, of which its box may touch, but not cross it.
    assert -301 < position[-1, 0, 0] / ONE < -294


def test_a_fireball_ends_at_another_monster_and_hurts_nobody() -> None:
    position, _, hits, _ = shoot((-200, 0), [True, True])
    assert not hits.any()
    assert -81 < position[-1, 0, 0] / ONE < -74


def test_new_ones_take_the_places_of_the_oldest() -> None:
    origin = places((0, 0), (0, 50))
    way = way_to(origin, places((-200, 0)))
    balls = no_projectiles(3)
    for _ in range(2):
        balls = throw(balls, jnp.array([True, True]), origin, way, 10)
    assert balls.owner.tolist() == [1, 1, 0]
    assert int(balls.next) == 1
    assert balls.flies.all()


def test_imps_wake_throw_hurt_and_join() -> None:
    env, params = make("doom-take-cover")
    params = params.replace(damage_factor=0.5)
    state = env.init_state(jax.random.key(5), params)
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
