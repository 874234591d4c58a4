"""The player's weapons: their triggers, and how the player changes weapons."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from functools import partial
from typing import Any, cast

import jax
import jax.numpy as jnp
import numpy as np

from ..._jax.batching import where_few
from ...engine.shade import ImageKind
from ...environment import Info
from ...pytree import PyTreeNode
from .collision import along, first_body
from .fixed import FEW, byte, spread
from .game_weapon import RAISE_TICS, SWITCH_TICS, WEAPON_LOOKS, WeaponLook
from .parts import Game, Part
from .weapons import Slot, Trigger, Weapon, pull

SELECT = tuple(f"weapon {number}" for number in range(1, 7))
NEXT_WEAPON, PREVIOUS_WEAPON = "next weapon", "previous weapon"
SWITCHING = (*SELECT, NEXT_WEAPON, PREVIOUS_WEAPON)
"""The buttons that change weapons, in this order at the end of a scenario's buttons."""
# The game's names of the kinds of ammunition, and the number of weapons on each button.
_AMMO_NAMES = ("AMMO2", "AMMO3", "AMMO5")
_SLOT_NAMES = tuple(f"WEAPON{number}" for number in range(1, 6))
# Beyond all distances, in map units.
_FAR = 1 << 20
# The numbers of a weapon that a program looks up.
_NUMBERS = tuple(
    field.name
    for field in fields(Weapon)
    if field.type in ("int", "float", "bool") and field.name != "locks"
)


class Arms(PyTreeNode):
    """Which of W weapons the player has.

    Attributes:
        selected: int32[], the weapon in hand.
        pending: int32[], the weapon to change to; W for none.
        owned: bool[W].
        ammo: int32[3], shots of each kind of ammunition.
        asked: int32[], the selecting buttons that were held in the previous tic, as bits.
    """

    selected: jax.Array
    pending: jax.Array
    owned: jax.Array
    ammo: jax.Array
    asked: jax.Array


class Arsenal(Part):
    """The player's weapons: `state.trigger`, and `state.arms` if there are several weapons.

    Attributes:
        slots: the weapons.
        ammo: int32[W], the kind of ammunition of each weapon.
        uses: int32[W], the ammunition that a shot uses.
        buttons: int32[W], the button that selects each weapon.
        rays: the largest number of bullets in a shot.
        most: the largest number of shots that the player can have.
    """

    def __init__(
        self,
        slots: Sequence[Slot],
        *,
        shots: int = 50,
        most: int = 0,
        raise_tics: int = 0,
        first_button: int = 0,
    ) -> None:
        """Build the tables.

        Args:
            slots: the weapons; with a single weapon the player cannot change weapons.
            shots: bullets at the start.
            most: the most bullets, if larger.
            raise_tics: tics until the first weapon is raised.
            first_button: the index of the first button of `SWITCHING`, if there are several
                weapons.
        """
        self.slots = tuple(slots)
        self.ammo = np.array([slot.ammo for slot in slots], np.int32)
        self.buttons = np.array([slot.button for slot in slots], np.int32)
        self.uses = np.array([slot.weapon.uses for slot in slots], np.int32)
        self.rays = max(slot.weapon.rays for slot in slots)
        self.most = max(shots, most)
        self.limits = {"ammo": self.most} if self.most else {}
        self._shots, self._first_button, self.raise_tics = shots, first_button, raise_tics
        self._order = np.array([slot.order for slot in slots], np.int32)
        rows = [[min(getattr(s.weapon, name), _FAR) for name in _NUMBERS] for s in slots]
        self._rows = np.array(rows, np.int32)
        several = ("SELECTED_WEAPON", *_AMMO_NAMES, *_SLOT_NAMES)
        self.game_variables = several if len(slots) > 1 else (slots[0].weapon.game_ammo,)

    def __len__(self) -> int:
        """The number of weapons."""
        return len(self.slots)

    def index_of(self, weapon: Weapon) -> int:
        """The index of a weapon."""
        return [slot.weapon for slot in self.slots].index(weapon)

    def __getitem__(self, index: jax.Array) -> Any:
        """The weapon with index int32[]: a `Weapon` of arrays."""
        row = jnp.asarray(self._rows)[index]
        return Weapon("", **{name: cast(Any, row[i]) for i, name in enumerate(_NUMBERS)})

    def trigger(self, weapon: Weapon | None = None) -> Trigger:
        """The first state of a weapon's trigger, by default of the first weapon."""
        weapon = weapon or self.slots[0].weapon
        wait = jnp.int32(self.raise_tics)
        return Trigger(jnp.int32(weapon.ready), jnp.bool_(False), jnp.int32(self._shots), wait)

    def locked(self, time: jax.Array) -> jax.Array | bool:
        """bool[]: whether ATTACK must not be held yet, because the weapon would stay locked."""
        return self.slots[0].weapon.locks & (time <= self.raise_tics)

    def arms(self, owned: Sequence[Weapon], selected: Weapon) -> Arms:
        """The first state of several weapons: those owned, the one in hand, and the bullets."""
        mine = np.array([slot.weapon in owned for slot in self.slots])
        return Arms(
            selected=jnp.int32(self.index_of(selected)),
            pending=jnp.int32(len(self)),
            owned=jnp.asarray(mine),
            ammo=jnp.asarray(np.array((self._shots, 0, 0), np.int32)),
            asked=jnp.int32(0),
        )

    def usable(self, arms: Arms) -> jax.Array:
        """bool[W]: the weapons that the player has and has ammunition for."""
        return arms.owned & (arms.ammo[self.ammo] >= self.uses)

    def tic(self, state: Any, attack: jax.Array, held: jax.Array) -> tuple[Any, jax.Array]:
        """The state after a tic of the weapons, and bool[], whether a shot was fired.

        Args:
            state: the state before the tic.
            attack: bool[], whether ATTACK is held.
            held: int32[], the held buttons, bit i for button i.
        """
        if len(self) == 1:
            trigger, fires = pull(self.slots[0].weapon, state.trigger, attack)
            return state.replace(trigger=trigger), fires
        arms = self.chosen(state.arms, held >> self._first_button)
        trigger, arms, fires = self.pulled(arms, state.trigger, attack)
        return state.replace(trigger=trigger, arms=arms), fires

    def chosen(self, arms: Arms, asked: jax.Array) -> Arms:
        """The arms after a tic with selecting buttons; a button acts in the first tic of a press.

        Args:
            arms: the arms before the tic.
            asked: int32[], the held buttons of `SWITCHING`, bit i for the i-th.
        """
        count = len(self)
        new = asked & ~arms.asked
        current = jnp.where(arms.pending < count, arms.pending, arms.selected)
        index = np.arange(count, dtype=np.int32)
        other = self.usable(arms) & (index != current)
        wanted = other & ((new >> (self.buttons - 1)) & 1 == 1)
        onwards = jnp.where(other, (index - current) % count, count)
        backwards = jnp.where(other, (current - index) % count, count)
        pending = jnp.where(jnp.any(wanted), count - 1 - jnp.argmax(wanted[::-1]), arms.pending)
        stepping = jnp.any(other)
        nearest, before = jnp.argmin(onwards), jnp.argmin(backwards)
        pending = jnp.where((new >> 6 & 1 == 1) & stepping, nearest, pending)
        pending = jnp.where((new >> 7 & 1 == 1) & stepping, before, pending)
        return arms.replace(pending=pending.astype(jnp.int32), asked=asked)

    def pulled(
        self, arms: Arms, trigger: Trigger, attack: jax.Array
    ) -> tuple[Trigger, Arms, jax.Array]:
        """Trigger and arms after a tic with or without ATTACK, and whether a shot was fired."""
        count = len(self)
        comes = (trigger.wait == RAISE_TICS) & (arms.pending < count)
        selected = jnp.where(comes, arms.pending, arms.selected)
        pending = jnp.where(comes, count, arms.pending)
        weapon = self[selected]
        tics = jnp.where(comes, weapon.ready, trigger.tics)
        kind = jnp.asarray(self.ammo)[selected]
        # An empty weapon is put away once its shot is over.
        empty = (arms.ammo[kind] < weapon.uses) & (tics + 1 >= weapon.again) & (pending == count)
        best = jnp.argmin(jnp.where(self.usable(arms), self._order, 1 << 16)).astype(jnp.int32)
        pending = jnp.where(empty, best, pending)
        leaves = (pending < count) & (trigger.wait == 0) & (tics + 1 >= weapon.ready)
        trigger = Trigger(
            tics=tics,
            held=trigger.held & ~comes,
            ammo=arms.ammo[kind],
            wait=jnp.where(leaves, SWITCH_TICS, trigger.wait),
        )
        trigger, fires = pull(weapon, trigger, attack & (pending == count))
        ammo = arms.ammo.at[kind].set(trigger.ammo)
        return trigger, arms.replace(selected=selected, pending=pending, ammo=ammo), fires

    def bullets(
        self,
        state: Any,
        shot: tuple[jax.Array, jax.Array],
        bodies: tuple[jax.Array, np.ndarray, jax.Array],
        walls: np.ndarray,
        bits: jax.Array,
    ) -> jax.Array:
        """int32[N]: the damage of a shot's bullets to each body, zero without a shot.

        Args:
            state: the state after the tic of the shot, which goes along the player's angle.
            shot: bool[], whether there is a shot; int32[2], its origin.
            bodies: int32[N, 2] positions, int32[N] half-widths, bool[N] which can be hit.
            walls: float32[L, 4], the walls that stop bullets.
            bits: uint32[R], random, for each bullet.
        """
        (fires, origin), (places, widths, there) = shot, bodies
        if all(slot.weapon.speed for slot in self.slots):
            return jnp.zeros(there.shape, jnp.int32)
        hand = state.arms.selected if len(self) > 1 else None, state.trigger.held
        damage = where_few(partial(self._damage, widths, walls), FEW)(
            fires, hand, (origin, state.angle), (places, there), bits
        )
        return jnp.where(fires, damage, 0)

    def _damage(
        self,
        widths: np.ndarray,
        walls: np.ndarray,
        hand: tuple[jax.Array | None, jax.Array],
        line: tuple[jax.Array, jax.Array],
        bodies: tuple[jax.Array, jax.Array],
        bits: jax.Array,
    ) -> jax.Array:
        """int32[N]: the damage, for the weapon in hand and whether its trigger was held."""
        (selected, held), (origin, angle), (places, there) = hand, line, bodies
        weapon = self.slots[0].weapon if selected is None else self[selected]
        scatters = ((weapon.loose == 1) | held) & (weapon.spread > 0)
        angles = angle + jnp.where(scatters, spread(bits, weapon.spread), jnp.uint32(0))
        origins = jnp.broadcast_to(origin[None], (self.rays, 2))
        hit = first_body(origins, along(angles), places, widths, there[None], walls, weapon.reach)
        flies = (np.arange(self.rays) < weapon.rays) & (weapon.speed == 0)
        damage = jnp.where(flies, weapon.damage(byte(bits, 2)), 0)
        return jnp.sum(jnp.where(hit, damage[:, None], 0), axis=0, dtype=jnp.int32)

    @property
    def weapon_looks(self) -> tuple[WeaponLook, ...]:
        """The game's pictures of its weapons; none of one that never fires."""
        names = [slot.weapon.name for slot in self.slots if self.most]
        return tuple(WEAPON_LOOKS[name] for name in names)

    def show(self, image: jax.Array, state: Any, kind: ImageKind) -> jax.Array:
        """Draw the weapon in the player's hands onto an image."""
        images = [slot.weapon.show(image, state.trigger, kind) for slot in self.slots]
        return images[0] if len(images) == 1 else jnp.stack(images)[state.arms.selected]

    def describe(self, state: Any) -> Info:
        """Shots left and, with several weapons, the button that selects the current one."""
        if len(self) == 1:
            return {"ammo": state.trigger.ammo}
        # The trigger does not know what the player has picked up in this tic.
        selected, stock = state.arms.selected, state.arms.ammo
        button = jnp.asarray(self.buttons)[selected]
        return {"ammo": stock[jnp.asarray(self.ammo)[selected]], "weapon": button}

    def from_game(self, state: Any, game: Game) -> Any:
        """Read the game's ammunition and weapons; it only reports how many a button has."""
        values = game.variables
        if len(self) == 1:
            shots = min(max(values[self.slots[0].weapon.game_ammo], 0), self.most)
            return state.replace(trigger=state.trigger.replace(ammo=np.int32(shots)))
        buttons = self.buttons
        rank = np.array([np.sum(buttons[:i] == number) for i, number in enumerate(buttons)])
        owned = np.array([values.get(f"WEAPON{number}", 0) for number in buttons]) > rank
        held = np.flatnonzero(owned & (buttons == values["SELECTED_WEAPON"]))
        selected = np.int32(held[-1] if len(held) else 0)
        ammo = np.array([values[name] for name in _AMMO_NAMES], np.int32)
        trigger = state.trigger.replace(ammo=ammo[self.ammo[selected]])
        arms = state.arms.replace(selected=selected, owned=owned, ammo=ammo)
        return state.replace(arms=arms, trigger=trigger)
