"""Pickups and their effects, and the effect of armour on damage, by exact small cases."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxenstein.maps.things import WEAPON
from jaxenstein.pytree import PyTreeNode
from jaxenstein.tasks.doom.arsenal import Arms, Arsenal
from jaxenstein.tasks.doom.items import HALF, ITEMS, THIRD, Armour, ItemKind, Items
from jaxenstein.tasks.doom.weapons import FIST, PISTOL, SHOTGUN, SLOTS, SUPER_SHOTGUN

ARSENAL = Arsenal(SLOTS)
NUMBERS = tuple(ITEMS)
MEDKIT, STIMPACK, VIAL, HELMET = 2012, 2011, 2014, 2015
GREEN, BLUE, BULLETS, SHELLS = 2018, 2019, 2048, 2049
GUN = 82
# The drop of a dead man, as elsewhere in the game.
LEFT = ItemKind("Shotgun", WEAPON.label, ITEMS[GUN].picture, ammo=1, amount=4, weapon=SHOTGUN)
GOODS = Items([*ITEMS.values(), LEFT], np.zeros((len(ITEMS) + 1, 2), np.int32), ARSENAL)


class Belongings(PyTreeNode):
    """The parts of a state that a pickup changes."""

    health: jax.Array
    armour: jax.Array
    armour_share: jax.Array
    arms: Arms
    items: jax.Array


@jax.jit
def take(mine: Belongings, reach: jax.Array) -> tuple[Belongings, jax.Array]:
    """The player's inventory afterwards, and bool[M], whether each item was taken."""
    after, _ = GOODS.taken(mine, reach)
    return after, ~after.items


def mine(health: int = 50, armour: int = 0, share: int = 0) -> Belongings:
    arms = ARSENAL.arms((FIST, PISTOL), PISTOL)
    return Belongings(
        jnp.int32(health), jnp.int32(armour), jnp.int32(share), arms, jnp.ones(len(ITEMS) + 1, bool)
    )


def reach(*numbers: int) -> jax.Array:
    return jnp.array([number in numbers for number in (*NUMBERS, None)])


@pytest.mark.parametrize(
    ("health", "numbers", "after", "taken"),
    [
        (50, (MEDKIT,), 75, 1),
        (80, (MEDKIT,), 100, 1),
        (50, (MEDKIT, STIMPACK), 85, 2),
        (100, (MEDKIT, STIMPACK), 100, 0),
        (100, (VIAL,), 101, 1),
        (150, (VIAL, MEDKIT), 151, 1),
        (200, (VIAL,), 200, 1),
        (50, (), 50, 0),
    ],
)
def test_health(health: int, numbers: tuple[int, ...], after: int, taken: int) -> None:
    have, what = take(mine(health), reach(*numbers))
    assert (int(have.health), int(what.sum())) == (after, taken)


@pytest.mark.parametrize(
    ("armour", "share", "number", "after", "taken"),
    [
        (0, 0, HELMET, (1, THIRD), True),
        (100, HALF, HELMET, (101, HALF), True),
        (200, HALF, HELMET, (200, HALF), True),
        (0, 0, GREEN, (100, THIRD), True),
        (99, HALF, GREEN, (100, THIRD), True),
        (100, HALF, GREEN, (100, HALF), False),
        (199, THIRD, BLUE, (200, HALF), True),
        (200, HALF, BLUE, (200, HALF), False),
    ],
)
def test_armour(armour: int, share: int, number: int, after: tuple[int, int], taken: bool) -> None:
    have, what = take(mine(armour=armour, share=share), reach(number))
    assert (int(have.armour), int(have.armour_share)) == after
    assert bool(what.any()) == taken


def test_ammunition_and_weapons() -> None:
    have, what = take(mine(), reach(BULLETS, SHELLS))
    assert have.arms.ammo.tolist() == [100, 20, 0]
    assert int(what.sum()) == 2
    full = mine()
    full = full.replace(arms=full.arms.replace(ammo=jnp.array([200, 45, 0])))
    have, what = take(full, reach(BULLETS, SHELLS))
    assert have.arms.ammo.tolist() == [200, 50, 0]
    assert np.array(NUMBERS)[np.flatnonzero(np.asarray(what))].tolist() == [SHELLS]
    # A new weapon brings shells and is wanted at once; another one has fewer.
    have, what = take(mine(), reach(GUN))
    assert have.arms.ammo.tolist() == [50, 8, 0]
    assert int(have.arms.pending) == ARSENAL.index_of(SUPER_SHOTGUN)
    again, what = take(
        have.replace(items=mine().items, arms=have.arms.replace(pending=jnp.int32(2))), reach(GUN)
    )
    assert (int(again.arms.pending), again.arms.ammo.tolist()) == (2, [50, 16, 0])
    have, what = take(mine(), jnp.append(reach()[:-1], True))
    assert have.arms.ammo.tolist() == [50, 4, 0]
    assert np.flatnonzero(np.asarray(have.arms.owned)).tolist() == [
        ARSENAL.index_of(weapon) for weapon in (FIST, PISTOL, SHOTGUN)
    ]
    assert what.tolist() == [False] * len(NUMBERS) + [True]


@pytest.mark.parametrize(
    ("armour", "share", "lost", "left", "felt"),
    [
        (100, THIRD, [15], 95, 10),
        (100, HALF, [15], 93, 8),
        # Each hit is rounded separately.
        (100, THIRD, [5, 5], 98, 8),
        (3, HALF, [40], 0, 37),
        (0, 0, [40], 0, 40),
        # Impossibly large damage does not turn into health.
        (200, HALF, [1_000_000], 0, 1_000_000 - 200),
    ],
)
def test_armour_absorbs_its_share(
    armour: int, share: int, lost: list[int], left: int, felt: int
) -> None:
    after, rest = Armour().absorbed(mine(armour=armour, share=share), jnp.array(lost))
    assert (int(after.armour), int(rest)) == (left, felt)
