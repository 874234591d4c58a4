"""Monsters that turn on each other, by exact small cases."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxenstein.tasks.doom.fixed import ONE
from jaxenstein.tasks.doom.monster_attacks import attack
from jaxenstein.tasks.doom.monster_kinds import DEMON, SHOTGUN_GUY, ZOMBIE
from jaxenstein.tasks.doom.monsters import STUBBORN, Horde, Infighting, Monsters
from jaxenstein.tasks.doom.respawn import invaded, words
from tests.tasks.doom.cases import NO_WALLS, place, places, walked

THREE = Horde([DEMON, ZOMBIE, SHOTGUN_GUY], walls=NO_WALLS, infighting=True)
PLAYER, CALM = 3, jnp.full(3, 255 << 24, jnp.uint32)


def some(*spots: tuple[float, float], target: tuple[int, ...] = (3, 3, 3)) -> Monsters:
    """All three walk, are healthy, and have had a target for a while."""
    new = THREE.placed(
        places(*spots), jnp.zeros(3, jnp.uint32), jnp.ones(3, bool), jnp.asarray(THREE.health)
    )
    enemies = Infighting(jnp.array(target, jnp.int32), jnp.zeros(3, jnp.int32))
    return new.replace(
        frame=jnp.asarray(THREE.walk), tics=jnp.ones(3, jnp.int32), infighting=enemies
    )


APART = (0, 0), (200, 0), (0, 200)


@jax.jit
def blow(monsters: Monsters, damage: jax.Array, source: jax.Array) -> Monsters:
    return THREE.hurt(monsters, damage, CALM, source)


def tics(monsters: Monsters, player: tuple[float, float]) -> tuple[Any, np.ndarray]:
    """Forty tics: the monsters at the end, and their paths, float[40, 3, 2]."""
    noises = jnp.zeros(40, bool)
    after, _ = walked(THREE, monsters, place(*player), noises, jax.random.key(1))
    return jax.tree.map(lambda leaf: leaf[-1], after), np.asarray(after.position) / ONE


@pytest.mark.parametrize(
    ("damage", "source", "target"),
    [
        ([9, 0, 0], [1, 0, 0], [1, 3, 3]),
        ([9, 9, 9], [2, 0, 0], [2, 0, 0]),
        # A deadly hit and a hit by oneself make no enemy; the player is an enemy like others.
        ([150, 20, 9], [1, 0, 3], [3, 3, 3]),
        ([9, 9, 0], [0, 1, 0], [3, 3, 3]),
    ],
)
def test_hurt_survivor_turns_on_its_attacker(
    damage: list[int], source: list[int], target: list[int]
) -> None:
    after = blow(some(*APART), jnp.array(damage), jnp.array(source))
    assert after.infighting is not None
    assert after.infighting.target.tolist() == target
    struck = (np.array(damage) > 0) & (np.array(damage) < THREE.health)
    struck &= np.array(source) != np.arange(3)
    assert after.infighting.anger.tolist() == np.where(struck, STUBBORN, 0).tolist()


def test_monster_keeps_its_target_for_a_hundred_steps() -> None:
    monsters = some(*APART, target=(1, 3, 3))
    once = jnp.array([5, 0, 0])
    stubborn = monsters.replace(infighting=Infighting(jnp.array([1, 3, 3]), jnp.array([1, 0, 0])))
    after = blow(stubborn, once, jnp.array([2, 0, 0]))
    assert (int(after.infighting.target[0]), int(after.infighting.anger[0])) == (1, 1)
    after = blow(stubborn, once, jnp.array([1, 0, 0]))
    assert (int(after.infighting.target[0]), int(after.infighting.anger[0])) == (1, STUBBORN)
    # A demon steps every other tic: so many steps nearer to being calm.
    calmed, _ = tics(after, (900, 900))
    assert 0 < STUBBORN - int(calmed.infighting.anger[0]) <= 20
    assert calmed.infighting.anger[1:].tolist() == [0, 0]
    after = blow(monsters, once, jnp.array([2, 0, 0]))
    assert int(after.infighting.target[0]) == 2


def test_monster_walks_to_its_target_then_back_to_the_player() -> None:
    player = 0, -900
    monsters = some((0, 0), (900, 0), (-900, 900), target=(1, 3, 3))
    after, path = tics(monsters, player)
    demon = path[:, 0]
    assert demon[-1, 0] > 120
    assert demon[-1, 0] > abs(demon[-1, 1])
    dead = monsters.replace(health=monsters.health.at[1].set(0))
    after, path = tics(dead, player)
    demon = path[:, 0]
    assert demon[-1, 1] < -120
    assert after.infighting.target.tolist() == [PLAYER] * 3


def test_new_monster_does_not_inherit_the_enemies_of_the_dead_one() -> None:
    """A zombie appears in the tic in which the one that a demon and a shotgun guy fought dies."""
    monsters = some(*APART, target=(1, 3, 1))
    dead = monsters.replace(
        health=monsters.health.at[1].set(0), present=monsters.present.at[1].set(False)
    )
    bits = jax.random.bits(jax.random.key(2), words(THREE), jnp.uint32)
    chances, health = [0.0, 65537.0, 0.0], jnp.asarray(THREE.health)
    after, comes = invaded(THREE, dead, place(900, 0), chances, (400, 640), health, bits)
    assert comes.tolist() == [False, True, False]
    assert after.infighting is not None
    assert after.infighting.target.tolist() == [PLAYER] * 3


@pytest.mark.parametrize(("distance", "hurts"), [(63.9, True), (64, False)])
def test_bite_hits_the_target_within_reach_of_its_side(distance: float, hurts: bool) -> None:
    """44 map units and the half-width of a zombie, 20; the player beside it feels nothing."""
    monsters = some((0, 0), (distance, 0), (0, 500), target=(1, 3, 3))
    monsters = monsters.replace(frame=jnp.asarray(THREE.melee) + jnp.array([2, 1, 1]))
    bits = jnp.full((3, 3), 3 << 16, jnp.uint32)
    first = jnp.array([True, False, False])
    blows = attack(THREE, monsters, first, place(0, 40), bits)
    assert blows.lost.tolist() == [0, 0, 0]
    assert blows.dealt.tolist() == [0, 16 if hurts else 0, 0]
    assert blows.bitten.tolist() == [hurts, False, False]
    assert int(blows.source[1]) == 0


def test_bullets_hit_the_target_and_keep_their_owner() -> None:
    monsters = some((0, 300), (0, 0), (200, 0), target=(3, 2, 3))
    monsters = monsters.replace(frame=jnp.asarray(THREE.missile) + jnp.array([0, 1, 0]))
    shoots = jnp.array([False, True, False])
    bits = jnp.full((3, 3), 4 << 16, jnp.uint32)
    blows = attack(THREE, monsters, shoots, place(-200, 0), bits)
    assert blows.lost.tolist() == [0, 0, 0]
    assert blows.dealt.tolist() == [0, 0, 15]
    assert int(blows.source[2]) == 1
