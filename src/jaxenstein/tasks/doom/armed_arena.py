"""Scenarios with several weapons, armour, and things that are taken by walking into them."""

from __future__ import annotations

import abc
import dataclasses
import functools
from collections.abc import Mapping
from typing import ClassVar, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from ..._jax.batching import where_few
from ...about import Event
from ...engine.shade import ImageKind
from ...environment import Info
from ...maps.things import AMMUNITION, FIREBALL, ROCKET, WEAPON
from . import hands
from .arena import DoomArenaParams
from .arsenal import WEAPONS, Arms, Arsenal, Stock
from .creatures import FEW
from .dice import byte, spread
from .items import MOST_ARMOUR, MOST_HEALTH, Belongings, Goods, Item, shielded
from .look import ROCKETS, Picture
from .projectiles import in_the_air
from .rocket_arena import DoomRocketArena, DoomRocketState
from .shots import along, first_body

SELECT = tuple(f"weapon {number}" for number in range(1, 7))
NEXT_WEAPON, PREVIOUS_WEAPON = "next weapon", "previous weapon"
TAKING = {
    "took_health": Event("took health", "took health {} times"),
    "took_armour": Event("took armour", "took armour {} times"),
    "took_weapon": Event("took a weapon", "took {} weapons"),
    "took_ammunition": Event("took ammunition", "took {} boxes of ammunition"),
}
# What the game calls the ammunition, kind by kind, and how many weapons there are of each button.
_AMMUNITION = ("AMMO2", "AMMO3", "AMMO5")
_SLOTS = tuple(f"WEAPON{number}" for number in range(1, 6))
# The most kills that a variable can tell.
_MOST_KILLS = 10_000


class DoomArmedState(DoomRocketState):
    """State of a player with weapons and armour, among M things to take.

    Attributes:
        arms: weapons and ammunition.
        armour: int32[], what it can still take, 0 to 200.
        share: int32[], of a blow that it takes off, in 65536ths.
        left: bool[M], what is there to be taken.
    """

    arms: Arms
    armour: jax.Array
    share: jax.Array
    left: jax.Array


S = TypeVar("S", bound=DoomArmedState)
P = TypeVar("P", bound=DoomArenaParams)


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoomArmedArena(DoomRocketArena[S, P]):
    """Base of scenarios with several weapons and things to take.

    Those select weapons by the buttons of `SELECT`, `NEXT_WEAPON` and `PREVIOUS_WEAPON`, in this
    order and at the end of `button_names`.
    """

    stocks: ClassVar[tuple[Stock, ...]] = WEAPONS

    @property
    @abc.abstractmethod
    def items(self) -> tuple[Item, ...]:
        """What there is to take, one by one."""

    @property
    @abc.abstractmethod
    def supplies(self) -> np.ndarray:
        """int32[M, 2]: where it lies, map units in 16.16."""

    @functools.cached_property
    def arsenal(self) -> Arsenal:
        """The weapons."""
        return Arsenal(self.stocks)

    @functools.cached_property
    def goods(self) -> Goods:
        """The tables of that."""
        return Goods(self.items, self.arsenal)

    @functools.cached_property
    def _pictures(self) -> tuple[Picture, ...]:
        """Of the things to take, without repetition."""
        return tuple(dict.fromkeys(item.picture for item in self.items))

    @property
    def pictures(self) -> tuple[Picture, ...]:
        """Of monsters and fireballs, of what is there to be taken, and of rockets."""
        return (*super().pictures, *self._pictures, *ROCKETS)

    @functools.cached_property
    def _labels(self) -> dict[str, int]:
        """The label of each kind of thing to take, by what the game calls it."""
        return {item.game_name: item.picture.label for item in self.items}

    @property
    def game_things(self) -> tuple[str, ...]:
        """Monsters and their fireballs, things to take, and rockets."""
        return (*super().game_things, *self._labels, "BaronBall", "Rocket")

    @property
    def thing_labels(self) -> tuple[int, ...]:
        """Their labels."""
        return (*super().thing_labels, *self._labels.values(), FIREBALL.label, ROCKET.label)

    @functools.cached_property
    def game_labels(self) -> dict[str, int]:
        """Those, and of what our states leave out."""
        plasma = {"PlasmaRifle": WEAPON.label, "CellPack": AMMUNITION.label}
        return super().game_labels | plasma

    @property
    def game_variables(self) -> tuple[str, ...]:
        """Kills, armour, ammunition, and the weapons by the buttons that select them."""
        return ("KILLCOUNT", "ARMOR", "SELECTED_WEAPON", *_AMMUNITION, *_SLOTS)

    def supply_places(self, state: S) -> jax.Array:
        """int32[M, 2]: where there is something to take, or was."""
        del state
        return jnp.asarray(self.supplies)

    def take(self, state: S, reach: jax.Array) -> tuple[S, dict[str, jax.Array]]:
        """The state after the player has taken what it needs of bool[M]; and how much."""
        mine = Belongings(state.health, state.armour, state.share, state.arms)
        mine, taken = self.goods.taken(mine, reach)
        goods = self.goods
        counts = {
            "took_health": goods.health > 0,
            "took_armour": goods.armour > 0,
            "took_weapon": goods.weapon >= 0,
            "took_ammunition": (goods.weapon < 0) & (goods.ammunition >= 0),
        }
        state = state.replace(
            health=mine.health,
            armour=mine.armour,
            share=mine.share,
            arms=mine.arms,
            left=state.left & ~taken,
        )
        return state, {
            name: jnp.sum(taken & which, dtype=jnp.int32) for name, which in counts.items()
        }

    def shoot(
        self, state: S, angle: jax.Array, action: jax.Array, bits: jax.Array
    ) -> tuple[S, jax.Array, jax.Array]:
        """The weapons' tic: as of all shooters, and changing from one to another."""
        del bits
        asked = self.held(action) >> self.button_names.index(SELECT[0])
        arms = self.arsenal.chosen(state.arms, asked)
        attack = jnp.asarray(self.pressed(action).attack)
        arms, trigger, fires = self.arsenal.pulled(arms, state.trigger, attack)
        return state.replace(arms=arms, trigger=trigger), fires, angle

    def volley(
        self,
        key: jax.Array,
        state: S,
        origin: jax.Array,
        shot: tuple[jax.Array, jax.Array],
        bits: jax.Array,
    ) -> jax.Array:
        """int32[N]: what the bullets of a shot, each with its own error, do to each monster."""
        del bits
        fires, towards = shot
        drawn = jax.random.bits(jax.random.fold_in(key, 1), (self.arsenal.rays,), jnp.uint32)
        hand = state.arms.selected, state.trigger.held
        bodies = state.creatures.position, state.creatures.living
        damage = where_few(self._pellets, FEW)(fires, hand, origin, towards, bodies, drawn)
        return jnp.where(fires, damage, 0)

    def _pellets(
        self,
        hand: tuple[jax.Array, jax.Array],
        origin: jax.Array,
        towards: jax.Array,
        bodies: tuple[jax.Array, jax.Array],
        bits: jax.Array,
    ) -> jax.Array:
        """int32[N]: what they do.

        Args:
            hand: int32[] which weapon, bool[] whether its trigger is held.
            origin: int32[2].
            towards: uint32[].
            bodies: int32[N, 2] and bool[N], the monsters.
            bits: uint32[R], random.
        """
        (selected, held), (places, living) = hand, bodies
        weapon, rays = self.arsenal[selected], self.arsenal.rays
        error = spread(bits, weapon.spread)
        angle = towards + jnp.where((weapon.loose == 1) | held, error, jnp.uint32(0))
        hit = first_body(
            jnp.broadcast_to(origin[None], (rays, 2)),
            along(angle),
            places,
            self.half_widths,
            living[None],
            self.opaque_walls,
            weapon.reach,
        )
        flies = (np.arange(rays) < weapon.rays) & (weapon.speed == 0)
        damage = jnp.where(flies, weapon.damage(byte(bits, 2)), 0)
        return jnp.sum(jnp.where(hit, damage[:, None], 0), axis=0, dtype=jnp.int32)

    def shielded(self, state: S, lost: jax.Array) -> tuple[S, jax.Array]:
        """The state after blows, of which the armour takes a share, and what of them is felt."""
        armour, felt = shielded(state.armour, state.share, lost)
        return state.replace(armour=armour), felt

    def in_hands(self, image: jax.Array, state: S, kind: ImageKind) -> jax.Array:
        """The image with the weapon over it."""
        looks = [
            hands.show(image, stock.weapon, state.trigger, kind) for stock in self.arsenal.stocks
        ]
        return jnp.stack(looks)[state.arms.selected]

    def things(self, state: S) -> tuple[jax.Array, jax.Array, jax.Array]:
        """Monsters and fireballs, what is there to be taken, rockets."""
        places, looks, present = super().things(state)
        first, rockets = len(super().pictures), state.rockets
        kinds = np.array([self._pictures.index(item.picture) for item in self.items], np.int32)
        rocket = np.int32(first + len(self._pictures))
        flying = jnp.where(rockets.flies, rocket, rocket + 1)
        return (
            jnp.concatenate([places, self.supply_places(state), rockets.position]),
            jnp.concatenate([looks, jnp.asarray(kinds + np.int32(first)), flying]),
            jnp.concatenate([present, state.left, rockets.flies | (rockets.bursts > 0)]),
        )

    def with_variables(self, state: S, values: Mapping[str, int]) -> S:
        """The state with that; of a button's weapons the game tells only how many there are."""
        buttons = self.arsenal.buttons
        rank = np.array([np.sum(buttons[:i] == number) for i, number in enumerate(buttons)])
        counts = np.array([values.get(f"WEAPON{number}", 0) for number in buttons])
        ammo = np.array([values[name] for name in _AMMUNITION], np.int32)
        owned = counts > rank
        held = np.flatnonzero(owned & (buttons == values["SELECTED_WEAPON"]))
        selected = np.int32(held[-1] if len(held) else 0)
        arms = state.arms.replace(selected=selected, owned=owned, ammo=ammo)
        shots = ammo[self.arsenal.ammunition[selected]]
        return state.replace(
            arms=arms,
            trigger=state.trigger.replace(ammo=shots),
            armour=np.int32(values["ARMOR"]),
            kills=np.int32(values["KILLCOUNT"]),
        )

    def with_things(self, state: S, health: int, things: np.ndarray) -> S:
        """The state with the monsters, what flies, and what is there to be taken."""
        names = self.game_things
        # Those of hell knights are fireballs like all.
        ball = names.index("BaronBall"), len(self.roster.kinds)
        things = np.where((things[:, :1] == ball[0]) & (np.arange(6) == 0), ball[1], things)
        state = super().with_things(state, health, things)
        kinds = [names.index(item.game_name) for item in self.items]
        lying = np.column_stack([kinds, self.supplies])
        left = np.any(np.all(lying[:, None] == things[None, :, :3], axis=-1), axis=1)
        rockets = in_the_air(state.rockets, things[things[:, 0] == names.index("Rocket")])
        return state.replace(left=left, rockets=rockets)

    def describe(self, state: S, params: P) -> Info:
        """Add armour and the number of the weapon."""
        more = {"armour": state.armour, "weapon": self._number(state)}
        return super().describe(state, params) | more

    def variables(self, state: S) -> dict[str, jax.Array]:
        """What the game tells: float32[1] each."""
        values = {
            "killed": state.kills,
            "health": state.health,
            "armour": state.armour,
            "weapon": self._number(state),
            "ammo": state.trigger.ammo,
        }
        return {name: value.astype(jnp.float32)[None] for name, value in values.items()}

    @property
    def _most(self) -> dict[str, int]:
        """The most that each variable can be."""
        return {
            "killed": _MOST_KILLS,
            "health": MOST_HEALTH,
            "armour": MOST_ARMOUR,
            "weapon": len(SELECT),
            "ammo": self.most_ammo,
        }

    def _number(self, state: S) -> jax.Array:
        return jnp.asarray(self.arsenal.buttons)[state.arms.selected]
