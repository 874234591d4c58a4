"""Things to pick up: health, armour, ammunition and weapons, and what each of them gives.

Numbers are those of the game's own tables (ViZDoom 1.3.2, wadsrc/static/actors/doom).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ...about import Event
from ...environment import Info
from ...maps import things
from ...maps.things import RGB
from ..health import FULL_HEALTH
from .arsenal import Arms, Arsenal
from .game_things import LYING, Animation, Shown, looks_at
from .parts import Game, GameObject, Part, Sprites
from .view import MEDKIT_BOX, VEST, Picture
from .weapons import (
    BULLETS,
    CHAINGUN,
    CHAINSAW,
    MOST_AMMO,
    ROCKET_LAUNCHER,
    ROCKETS,
    SHELLS,
    SUPER_SHOTGUN,
    Weapon,
)

MOST_HEALTH, MOST_ARMOUR = 200, 200
"""The maximum that bonuses lead to."""
THIRD, HALF = 21846, 32768
"""The fraction of damage that armour absorbs, in 65536ths."""
TAKING = {
    "took_health": Event("took health", "took health {} times"),
    "took_armour": Event("took armour", "took armour {} times"),
    "took_weapon": Event("took a weapon", "took {} weapons"),
    "took_ammunition": Event("took ammunition", "took {} boxes of ammunition"),
}
"""The events of picking things up."""


@dataclass(frozen=True)
class ItemKind:
    """A kind of thing to pick up.

    Attributes:
        game_name: the game's name.
        label: its label id.
        picture: its picture.
        health: the health that it gives.
        armour: the armour that it gives.
        share: the fraction of damage that the armour absorbs, in 65536ths.
        bonus: whether it always adds to health and armour, up to 200. Otherwise it gives health
            below 100, and replaces weaker armour.
        ammo: the kind of ammunition that it gives; -1 for none.
        amount: the amount of ammunition.
        weapon: the weapon that it is.
    """

    game_name: str
    label: int
    picture: Picture
    health: int = 0
    armour: int = 0
    share: int = 0
    bonus: bool = False
    ammo: int = -1
    amount: int = 0
    weapon: Weapon | None = None


def _health(name: str, picture: Picture, health: int, bonus: bool = False) -> ItemKind:
    return ItemKind(name, things.MEDKIT.label, picture, health=health, bonus=bonus)


def _armour(
    name: str, side: float, colours: tuple[RGB, RGB], armour: int, share: int, bonus: bool = False
) -> ItemKind:
    picture = Picture("vest", side, *colours)
    label = things.ARMOUR.label
    return ItemKind(name, label, picture, armour=armour, share=share, bonus=bonus)


def _ammunition(
    name: str, side: float, colours: tuple[RGB, RGB], ammo: int, amount: int
) -> ItemKind:
    picture = Picture("ammunition", side, *colours)
    return ItemKind(name, things.AMMUNITION.label, picture, ammo=ammo, amount=amount)


def _weapon(
    name: str,
    side: float,
    colours: tuple[RGB, RGB],
    weapon: Weapon,
    ammo: int = -1,
    amount: int = 0,
) -> ItemKind:
    picture = Picture("gun", side, *colours)
    return ItemKind(name, things.WEAPON.label, picture, ammo=ammo, amount=amount, weapon=weapon)


_MEDKIT_COLOURS, _VEST_COLOURS = (MEDKIT_BOX.shape, MEDKIT_BOX.detail), (VEST.shape, VEST.detail)
ITEMS: dict[int, ItemKind] = {
    2012: _health("Medikit", MEDKIT_BOX, 25),
    2011: _health("Stimpack", Picture("medkit-box", 17, *_MEDKIT_COLOURS), 10),
    2014: _health("HealthBonus", Picture("bottle", 15.3, (48, 72, 160), (110, 140, 66)), 1, True),
    2015: _armour("ArmorBonus", 17, ((72, 84, 64), (47, 52, 40)), 1, THIRD, True),
    2018: _armour("GreenArmor", 37, _VEST_COLOURS, 100, THIRD),
    2019: _armour("BlueArmor", 37, ((52, 60, 130), (40, 44, 60)), 200, HALF),
    2048: _ammunition("ClipBox", 28, ((98, 104, 74), (226, 180, 76)), BULLETS, 50),
    2049: _ammunition("ShellBox", 28, ((120, 90, 60), (190, 40, 36)), SHELLS, 20),
    2046: _ammunition("RocketBox", 40, ((92, 72, 48), (150, 146, 140)), ROCKETS, 5),
    2005: _weapon("Chainsaw", 52, ((150, 90, 40), (120, 124, 130)), CHAINSAW),
    82: _weapon("SuperShotgun", 56, ((60, 60, 66), (120, 84, 50)), SUPER_SHOTGUN, SHELLS, 8),
    2002: _weapon("Chaingun", 58, ((92, 94, 100), (52, 54, 60)), CHAINGUN, BULLETS, 20),
    2003: _weapon(
        "RocketLauncher", 60, ((72, 84, 64), (140, 120, 60)), ROCKET_LAUNCHER, ROCKETS, 2
    ),
}
"""The kinds by their numbers in the game's maps."""
# Things in the game's map that our states leave out.
_LEFT_OUT = (
    GameObject("PlasmaRifle", things.WEAPON.label),
    GameObject("CellPack", things.AMMUNITION.label),
)


class Armour(Part):
    """The player's armour: `state.armour`, int32[], the damage that it can still absorb.

    Also `state.armour_share`, int32[], the fraction of damage that it absorbs, in 65536ths.
    """

    game_variables = ("ARMOR",)

    def absorbed(self, state: Any, lost: jax.Array) -> tuple[Any, jax.Array]:
        """The state after damage int32[N]; int32[], the part that reaches the player."""
        spared = (jnp.minimum(lost, 32767) * state.armour_share) >> 16
        saved = jnp.minimum(jnp.sum(spared, dtype=jnp.int32), state.armour)
        felt = jnp.sum(lost, dtype=jnp.int32) - saved
        return state.replace(armour=state.armour - saved), felt

    def describe(self, state: Any) -> Info:
        """The armour."""
        return {"armour": state.armour}

    def from_game(self, state: Any, game: Game) -> Any:
        """Read the game's armour."""
        return state.replace(armour=np.int32(game.variables["ARMOR"]))


class Items(Part):
    """M things to pick up: `state.items`, bool[M], which of them are left.

    The state also has `health`, `armour`, `armour_share` and `arms`.

    Attributes:
        places: int32[M, 2], their positions, map units in 16.16.
        health, armour, share, ammo, amount: int32[M], as in `ItemKind`.
        weapon: int32[M], index into the arsenal, or -1.
        bonus: bool[M].
    """

    def __init__(self, items: Sequence[ItemKind], places: np.ndarray, arsenal: Arsenal) -> None:
        """Build the tables."""
        self._arsenal, self._items, self.places = arsenal, items, places
        kinds = tuple(dict.fromkeys(items))
        shown = (GameObject(kind.game_name, kind.label, (kind.picture,)) for kind in kinds)
        self.objects = (*shown, *_LEFT_OUT)
        self._pictures = np.array([kinds.index(item) for item in items], np.int32)
        self.health, self.armour, self.share, self.ammo, self.amount = (
            np.array([getattr(item, name) for item in items], np.int32)
            for name in ("health", "armour", "share", "ammo", "amount")
        )
        self.bonus = np.array([item.bonus for item in items], bool)
        slots = [-1 if one.weapon is None else arsenal.index_of(one.weapon) for one in items]
        self.weapon = np.array(slots, np.int32)

    def sprites(self, state: Any) -> Sprites:
        """The things that are left."""
        return Sprites(jnp.asarray(self.places), jnp.asarray(self._pictures), state.items)

    @property
    def animations(self) -> list[Animation]:
        """The pictures of the kinds of things."""
        return [LYING[thing.name] for thing in self.objects if thing.pictures]

    def shown(self, state: Any, tic: jax.Array) -> Shown:
        """The things that are left in the game's pictures, alike for all of a kind."""
        kinds = np.arange(len(self.animations), dtype=np.int32)
        ages = jnp.broadcast_to(tic, kinds.shape)
        looks = looks_at(self.animations, ages, jnp.asarray(kinds))
        return Shown(jnp.asarray(self.places), looks[self._pictures], state.items)

    def from_game(self, state: Any, game: Game) -> Any:
        """Read which things are left in the game."""
        lying = [
            np.any(np.all(game.of(item.game_name)[:, :2] == place, axis=1))
            for item, place in zip(self._items, self.places, strict=True)
        ]
        return state.replace(items=np.array(lying, bool))

    def taken(self, state: Any, reach: jax.Array) -> tuple[Any, dict[str, jax.Array]]:
        """The state after the player has taken what it needs, and the events of `TAKING`.

        Args:
            state: the state before.
            reach: bool[M], the things in reach.
        """
        health, healing = self._healed(state.health, reach)
        armour, share, clothing = self._clothed(state, reach)
        arms, loading = self._loaded(state.arms, reach)
        taken = healing | clothing | loading
        state = state.replace(
            health=health, armour=armour, armour_share=share, arms=arms, items=state.items & ~taken
        )
        sorts = {
            "took_health": self.health > 0,
            "took_armour": self.armour > 0,
            "took_weapon": self.weapon >= 0,
            "took_ammunition": (self.weapon < 0) & (self.ammo >= 0),
        }
        counts = {name: jnp.sum(taken & sort, dtype=jnp.int32) for name, sort in sorts.items()}
        return state, counts

    def _healed(self, health: jax.Array, reach: jax.Array) -> tuple[jax.Array, jax.Array]:
        heals = reach & (self.health > 0)
        bonus, plain = heals & self.bonus, heals & ~self.bonus & (health < FULL_HEALTH)
        after = jnp.minimum(health + _total(plain, self.health), FULL_HEALTH)
        after = jnp.where(jnp.any(plain), after, health)
        more = jnp.minimum(after + _total(bonus, self.health), MOST_HEALTH)
        return jnp.where(jnp.any(bonus), more, after), bonus | plain

    def _clothed(self, state: Any, reach: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
        dresses = reach & (self.armour > 0)
        bonus, suits = dresses & self.bonus, dresses & ~self.bonus & (state.armour < self.armour)
        best = jnp.argmax(jnp.where(suits, self.armour, 0))
        changes = jnp.any(suits)
        armour = jnp.where(changes, jnp.asarray(self.armour)[best], state.armour)
        share = jnp.where(changes, jnp.asarray(self.share)[best], state.armour_share)
        share = jnp.where(jnp.any(bonus) & (armour == 0), THIRD, share)
        more = jnp.minimum(armour + _total(bonus, self.armour), MOST_ARMOUR)
        return jnp.where(jnp.any(bonus), more, armour), share, bonus | suits

    def _loaded(self, arms: Arms, reach: jax.Array) -> tuple[Arms, jax.Array]:
        room = arms.ammo < MOST_AMMO
        new = reach & (self.weapon >= 0) & ~arms.owned[np.maximum(self.weapon, 0)]
        loading = reach & (((self.ammo >= 0) & room[np.maximum(self.ammo, 0)]) | new)
        gains = [_total(loading & (self.ammo == i), self.amount) for i in range(len(MOST_AMMO))]
        ammo = jnp.minimum(arms.ammo + jnp.stack(gains), MOST_AMMO)
        count = len(self._arsenal)
        index = np.arange(count, dtype=np.int32)
        fresh = jnp.any(new[:, None] & (self.weapon[:, None] == index[None]), axis=0)
        latest = count - 1 - jnp.argmax(fresh[::-1]).astype(jnp.int32)
        pending = jnp.where(jnp.any(fresh), latest, arms.pending)
        return arms.replace(owned=arms.owned | fresh, ammo=ammo, pending=pending), loading


class Goal(Part):
    """The green armour as a goal: `state.taken`, bool[], whether it was reached."""

    objects = (GameObject("GreenArmor", things.GOAL.label, (VEST,)),)

    def __init__(self, place: np.ndarray) -> None:
        """Store its position: int32[2], map units in 16.16."""
        self.place = place

    def sprites(self, state: Any) -> Sprites:
        """The armour, until it is reached."""
        return Sprites(jnp.asarray(self.place)[None], jnp.zeros(1, jnp.int32), ~state.taken[None])


def _total(which: jax.Array, amounts: np.ndarray) -> jax.Array:
    return jnp.sum(jnp.where(which, amounts, 0), dtype=jnp.int32)
