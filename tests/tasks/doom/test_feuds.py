"""Monsters that turn on each other, by exact small cases."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxenstein.tasks.doom.creatures import Creatures, act, hurt, placed
from jaxenstein.tasks.doom.feuds import STUBBORN, Feud
from jaxenstein.tasks.doom.fixed import ONE, to_fixed
from jaxenstein.tasks.doom.kinds import DEMON, SHOTGUN_GUY, ZOMBIE, Roster
from jaxenstein.tasks.doom.strikes import strike

THREE = Roster([DEMON, ZOMBIE, SHOTGUN_GUY], feuds=True)
NO_WALLS = np.zeros((0, 4), np.float32)
PLAYER, CALM = 3, jnp.full(3, 255 << 24, jnp.uint32)


def places(*spots: tuple[float, float]) -> jax.Array:
    return jnp.array([[to_fixed(x), to_fixed(y)] for x, y in spots], jnp.int32)


def monsters(*spots: tuple[float, float], target: tuple[int, ...] = (3, 3, 3)) -> Creatures:
    """All three, who walk, are healthy, and have been after somebody for a while."""
    new = placed(
        THREE,
        places(*spots),
        jnp.zeros(3, jnp.uint32),
        jnp.ones(3, bool),
        jnp.asarray(THREE.health),
    )
    feud = Feud(jnp.array(target, jnp.int32), jnp.zeros(3, jnp.int32))
    return new.replace(frame=jnp.asarray(THREE.walk), tics=jnp.ones(3, jnp.int32), feud=feud)


APART = (0, 0), (200, 0), (0, 200)


@jax.jit
def blow(creatures: Creatures, damage: jax.Array, source: jax.Array) -> Creatures:
    return hurt(THREE, creatures, damage, CALM, source)


@jax.jit
def tics(creatures: Creatures, player: jax.Array) -> tuple[Creatures, jax.Array]:
    """Forty tics: the monsters after them, and int32[40, 3, 2] where they went."""

    def tic(creatures: Creatures, key: jax.Array) -> Any:
        bits = jax.random.bits(key, (3, 2), jnp.uint32)
        noise = jnp.bool_(False)
        after, _ = act(THREE, creatures, player, noise, bits, opaque=NO_WALLS, walls=NO_WALLS)
        return after, after.position

    return jax.lax.scan(tic, creatures, jax.random.split(jax.random.key(1), 40))


@pytest.mark.parametrize(
    ("damage", "source", "target"),
    [
        ([9, 0, 0], [1, 0, 0], [1, 3, 3]),
        ([9, 9, 9], [2, 0, 0], [2, 0, 0]),
        # What kills, and what oneself does, makes no enemy; the player is one as others are.
        ([150, 20, 9], [1, 0, 3], [3, 3, 3]),
        ([9, 9, 0], [0, 1, 0], [3, 3, 3]),
    ],
)
def test_who_is_hurt_and_lives_turns_on_who_did_it(
    damage: list[int], source: list[int], target: list[int]
) -> None:
    after = blow(monsters(*APART), jnp.array(damage), jnp.array(source))
    assert after.feud is not None
    assert after.feud.target.tolist() == target
    struck = (np.array(damage) > 0) & (np.array(damage) < THREE.health)
    struck &= np.array(source) != np.arange(3)
    assert after.feud.anger.tolist() == np.where(struck, STUBBORN, 0).tolist()


def test_a_monster_keeps_to_its_enemy_for_a_hundred_steps() -> None:
    creatures = monsters(*APART, target=(1, 3, 3))
    once = jnp.array([5, 0, 0])
    stubborn = creatures.replace(feud=Feud(jnp.array([1, 3, 3]), jnp.array([1, 0, 0])))
    after = blow(stubborn, once, jnp.array([2, 0, 0]))
    assert (int(after.feud.target[0]), int(after.feud.anger[0])) == (1, 1)
    after = blow(stubborn, once, jnp.array([1, 0, 0]))
    assert (int(after.feud.target[0]), int(after.feud.anger[0])) == (1, STUBBORN)
    # A demon steps every other tic: so many steps nearer to being calm.
    calmed, _ = tics(after, places((900, 900))[0])
    assert 0 < STUBBORN - int(calmed.feud.anger[0]) <= 20
    assert calmed.feud.anger[1:].tolist() == [0, 0]
    after = blow(creatures, once, jnp.array([2, 0, 0]))
    assert int(after.feud.target[0]) == 2


def test_it_walks_to_its_enemy_and_back_to_the_player_when_that_is_dead() -> None:
    player = places((0, -900))[0]
    creatures = monsters((0, 0), (900, 0), (-900, 900), target=(1, 3, 3))
    after, path = tics(creatures, player)
    demon = np.asarray(path)[:, 0] / ONE
    assert demon[-1, 0] > 120
    assert demon[-1, 0] > abs(demon[-1, 1])
    dead = creatures.replace(health=creatures.health.at[1].set(0))
    after, path = tics(dead, player)
    demon = np.asarray(path)[:, 0] / ONE
    assert demon[-1, 1] < -120
    assert after.feud.target.tolist() == [PLAYER] * 3


@pytest.mark.parametrize(("distance", "hurts"), [(63.9, True), (64, False)])
def test_a_bite_is_the_enemys_and_reaches_to_its_side(distance: float, hurts: bool) -> None:
    """44 map units and the half-width of a zombie, 20; the player beside it feels nothing."""
    creatures = monsters((0, 0), (distance, 0), (0, 500), target=(1, 3, 3))
    creatures = creatures.replace(frame=jnp.asarray(THREE.melee) + jnp.array([2, 1, 1]))
    bits = jnp.full((3, 3), 3 << 16, jnp.uint32)
    first = jnp.array([True, False, False])
    blows = strike(THREE, creatures, first, places((0, 40))[0], bits, NO_WALLS)
    assert blows.lost.tolist() == [0, 0, 0]
    assert blows.dealt.tolist() == [0, 16 if hurts else 0, 0]
    assert blows.bitten.tolist() == [hurts, False, False]
    assert int(blows.source[1]) == 0


def test_bullets_go_to_the_enemy_and_tell_whose_they_are() -> None:
    creatures = monsters((0, 300), (0, 0), (200, 0), target=(3, 2, 3))
    creatures = creatures.replace(frame=jnp.asarray(THREE.missile) + jnp.array([0, 1, 0]))
    shoots = jnp.array([False, True, False])
    bits = jnp.full((3, 3), 4 << 16, jnp.uint32)
    blows = strike(THREE, creatures, shoots, places((-200, 0))[0], bits, NO_WALLS)
    assert blows.lost.tolist() == [0, 0, 0]
    assert blows.dealt.tolist() == [0, 0, 15]
    assert int(blows.source[2]) == 1
