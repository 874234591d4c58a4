"""What lies there to be taken: health, armour, ammunition and weapons, and what each of it gives.

Numbers are those of the game's own tables (ViZDoom 1.3.2, wadsrc/static/actors/doom).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np

from ...pytree import PyTreeNode
from ..health import FULL_HEALTH
from .arsenal import (
    BULLETS,
    CHAINGUN,
    CHAINSAW,
    MOST,
    ROCKETS,
    SHELLS,
    SUPER_SHOTGUN,
    Arms,
    Arsenal,
)
from .look import (
    ARMOUR_BONUS,
    BLUE_ARMOUR,
    BULLET_BOX,
    GREEN_ARMOUR,
    GUN,
    HEALTH_BONUS,
    HEAVY_GUN,
    LAUNCHER,
    MEDKIT_BOX,
    ROCKET_BOX,
    SAW,
    SHELL_BOX,
    STIMPACK,
    Picture,
)
from .weapons import ROCKET_LAUNCHER, Weapon

MOST_HEALTH, MOST_ARMOUR = 200, 200
"""What bonuses lead to."""
# What armour takes off a blow, in 65536ths: a third, and a half.
THIRD, HALF = 21846, 32768


@dataclass(frozen=True)
class Item:
    """A kind of thing to take.

    Attributes:
        picture: what it looks like.
        game_name: what the game calls it.
        health: what it gives.
        armour: likewise.
        share: of a blow that the armour takes off, in 65536ths.
        bonus: whether it always adds to health and armour, up to 200; else health is given below
            100, and armour replaces one that is less.
        ammunition: what it gives of which ammunition; -1 for none.
        amount: how much.
        weapon: the weapon that it is.
    """

    picture: Picture
    game_name: str
    health: int = 0
    armour: int = 0
    share: int = 0
    bonus: bool = False
    ammunition: int = -1
    amount: int = 0
    weapon: Weapon | None = None


ITEMS: dict[int, Item] = {
    2012: Item(MEDKIT_BOX, "Medikit", health=25),
    2011: Item(STIMPACK, "Stimpack", health=10),
    2014: Item(HEALTH_BONUS, "HealthBonus", health=1, bonus=True),
    2015: Item(ARMOUR_BONUS, "ArmorBonus", armour=1, share=THIRD, bonus=True),
    2018: Item(GREEN_ARMOUR, "GreenArmor", armour=100, share=THIRD),
    2019: Item(BLUE_ARMOUR, "BlueArmor", armour=200, share=HALF),
    2048: Item(BULLET_BOX, "ClipBox", ammunition=BULLETS, amount=50),
    2049: Item(SHELL_BOX, "ShellBox", ammunition=SHELLS, amount=20),
    2046: Item(ROCKET_BOX, "RocketBox", ammunition=ROCKETS, amount=5),
    2005: Item(SAW, "Chainsaw", weapon=CHAINSAW),
    82: Item(GUN, "SuperShotgun", ammunition=SHELLS, amount=8, weapon=SUPER_SHOTGUN),
    2002: Item(HEAVY_GUN, "Chaingun", ammunition=BULLETS, amount=20, weapon=CHAINGUN),
    2003: Item(LAUNCHER, "RocketLauncher", ammunition=ROCKETS, amount=2, weapon=ROCKET_LAUNCHER),
}
"""By the numbers of the game's maps."""


class Belongings(PyTreeNode):
    """What a player has.

    Attributes:
        health: int32[].
        armour: int32[], what it can still take.
        share: int32[], of a blow that it takes off, in 65536ths.
        arms: weapons and ammunition.
    """

    health: jax.Array
    armour: jax.Array
    share: jax.Array
    arms: Arms


class Goods:
    """The tables of M things to take; constants of a program.

    Attributes:
        health, armour, share, ammunition, amount, weapon: int32[M], as of `Item`; the weapon is
            its place in the arsenal, or -1.
        bonus: bool[M].
    """

    def __init__(self, items: Sequence[Item], arsenal: Arsenal) -> None:
        """Lay out the tables."""
        self._arsenal = arsenal
        self.health, self.armour, self.share, self.ammunition, self.amount = (
            np.array([getattr(item, name) for item in items], np.int32)
            for name in ("health", "armour", "share", "ammunition", "amount")
        )
        self.bonus = np.array([item.bonus for item in items], bool)
        places = [-1 if one.weapon is None else arsenal.index_of(one.weapon) for one in items]
        self.weapon = np.array(places, np.int32)

    def taken(self, mine: Belongings, reach: jax.Array) -> tuple[Belongings, jax.Array]:
        """What the player has after it has taken what it needs, and bool[M] what that is.

        Args:
            mine: before it.
            reach: bool[M], what is in reach.
        """
        health, healing = self._healed(mine.health, reach)
        armour, share, clothing = self._clothed(mine, reach)
        arms, loading = self._loaded(mine.arms, reach)
        return Belongings(health, armour, share, arms), healing | clothing | loading

    def _healed(self, health: jax.Array, reach: jax.Array) -> tuple[jax.Array, jax.Array]:
        heals = reach & (self.health > 0)
        bonus, plain = heals & self.bonus, heals & ~self.bonus & (health < FULL_HEALTH)
        after = jnp.minimum(health + _total(plain, self.health), FULL_HEALTH)
        after = jnp.where(jnp.any(plain), after, health)
        after = jnp.where(
            jnp.any(bonus), jnp.minimum(after + _total(bonus, self.health), MOST_HEALTH), after
        )
        return after, bonus | plain

    def _clothed(
        self, mine: Belongings, reach: jax.Array
    ) -> tuple[jax.Array, jax.Array, jax.Array]:
        dresses = reach & (self.armour > 0)
        bonus, suits = dresses & self.bonus, dresses & ~self.bonus & (mine.armour < self.armour)
        best = jnp.argmax(jnp.where(suits, self.armour, 0))
        changes = jnp.any(suits)
        armour = jnp.where(changes, jnp.asarray(self.armour)[best], mine.armour)
        share = jnp.where(changes, jnp.asarray(self.share)[best], mine.share)
        share = jnp.where(jnp.any(bonus) & (armour == 0), THIRD, share)
        more = jnp.minimum(armour + _total(bonus, self.armour), MOST_ARMOUR)
        return jnp.where(jnp.any(bonus), more, armour), share, bonus | suits

    def _loaded(self, arms: Arms, reach: jax.Array) -> tuple[Arms, jax.Array]:
        room = arms.ammo < MOST
        loads = self.ammunition >= 0
        here = self.weapon >= 0
        new = reach & here & ~arms.owned[np.maximum(self.weapon, 0)]
        loading = reach & ((loads & room[np.maximum(self.ammunition, 0)]) | new)
        gains = [_total(loading & (self.ammunition == i), self.amount) for i in range(len(MOST))]
        ammo = jnp.minimum(arms.ammo + jnp.stack(gains), MOST)
        count = len(self._arsenal)
        index = np.arange(count, dtype=np.int32)
        fresh = jnp.any(new[:, None] & (self.weapon[:, None] == index[None]), axis=0)
        latest = count - 1 - jnp.argmax(fresh[::-1]).astype(jnp.int32)
        pending = jnp.where(jnp.any(fresh), latest, arms.pending)
        return arms.replace(owned=arms.owned | fresh, ammo=ammo, pending=pending), loading


def _total(which: jax.Array, amounts: np.ndarray) -> jax.Array:
    return jnp.sum(jnp.where(which, amounts, 0), dtype=jnp.int32)


def shielded(armour: jax.Array, share: jax.Array, lost: jax.Array) -> tuple[jax.Array, jax.Array]:
    """int32[] what is left of armour, and int32[] what is felt of blows.

    Args:
        armour: int32[], what it can still take.
        share: int32[], that it takes off each blow, in 65536ths.
        lost: int32[N].
    """
    spared = (jnp.minimum(lost, 32767) * share) >> 16
    saved = jnp.minimum(jnp.sum(spared, dtype=jnp.int32), armour)
    return armour - saved, jnp.sum(lost, dtype=jnp.int32) - saved
