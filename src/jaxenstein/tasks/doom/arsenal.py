"""The player's weapons, one or several: their triggers, and how the player changes weapons."""

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
from .fixed import byte, spread
from .parts import Game, Part
from .weapons import Slot, Trigger, Weapon, pull

SWITCH_TICS, RAISE_TICS = 30, 15
"""Tics from asking for another weapon to shooting with it, and of them those of its raising."""
SELECT = tuple(f"weapon {number}" for number in range(1, 7))
NEXT_WEAPON, PREVIOUS_WEAPON = "next weapon", "previous weapon"
SWITCHING = (*SELECT, NEXT_WEAPON, PREVIOUS_WEAPON)
"""The buttons that change weapons, in this order and at the end of a scenario's buttons."""
# What the game calls the ammunition, kind by kind, and how many weapons there are of each button.
_AMMO_NAMES = ("AMMO2", "AMMO3", "AMMO5")
_SLOT_NAMES = tuple(f"WEAPON{number}" for number in range(1, 6))
# Beyond all distances, in map units. Of a batch that fires, one in so many is computed at a time.
_FAR, _FEW = 1 << 20, 8
# The numbers of a weapon that a program looks up.
_NUMBERS = tuple(
    field.name
    for field in fields(Weapon)
    if field.type in ("int", "float", "bool") and field.name != "locks"
)


class Arms(PyTreeNode):
    """Which of W weapons the player has.

    Attributes:
        selected: int32[], the one in its hands.
        pending: int32[], the one that it changes to; W for none.
        owned: bool[W].
        ammo: int32[3], of each ammunition.
        asked: int32[], the selecting buttons held in the tic before, as bits.
    """

    selected: jax.Array
    pending: jax.Array
    owned: jax.Array
    ammo: jax.Array
    asked: jax.Array


class Arsenal(Part):
    """The player's weapons, one or several: `state.trigger`, and of several `state.arms`.

    Attributes:
        slots: the weapons.
        ammo: int32[W], the kind of ammunition that each shoots.
        uses: int32[W], how much of it a shot takes.
        buttons: int32[W], the number by which each is selected.
        rays: the most bullets of a shot.
        most: the most shots that there can be.
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
        """Lay out the tables.

        Args:
            slots: the weapons; with only one of them the player cannot change.
            shots: there are at first, of bullets.
            most: there can be, if that is more.
            raise_tics: tics until the first weapon is raised.
            first_button: the number of the first button of `SWITCHING`, of several weapons.
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
        """How many weapons there are."""
        return len(self.slots)

    def index_of(self, weapon: Weapon) -> int:
        """The place of a weapon."""
        return [slot.weapon for slot in self.slots].index(weapon)

    def __getitem__(self, index: jax.Array) -> Any:
        """The weapon at int32[], whose numbers are those of a program: a `Weapon` of arrays."""
        row = jnp.asarray(self._rows)[index]
        return Weapon("", **{name: cast(Any, row[i]) for i, name in enumerate(_NUMBERS)})

    def trigger(self, weapon: Weapon | None = None) -> Trigger:
        """The first state of a weapon, by default of the first one."""
        weapon = weapon or self.slots[0].weapon
        wait = jnp.int32(self.raise_tics)
        return Trigger(jnp.int32(weapon.ready), jnp.bool_(False), jnp.int32(self._shots), wait)

    def locked(self, time: jax.Array) -> jax.Array | bool:
        """bool[]: whether ATTACK must not be held yet, since the weapon would stay locked."""
        return self.slots[0].weapon.locks & (time <= self.raise_tics)

    def arms(self, owned: Sequence[Weapon], selected: Weapon) -> Arms:
        """The first state of several weapons: those owned, one of them in hand, and bullets."""
        mine = np.array([slot.weapon in owned for slot in self.slots])
        return Arms(
            selected=jnp.int32(self.index_of(selected)),
            pending=jnp.int32(len(self)),
            owned=jnp.asarray(mine),
            ammo=jnp.asarray(np.array((self._shots, 0, 0), np.int32)),
            asked=jnp.int32(0),
        )

    def usable(self, arms: Arms) -> jax.Array:
        """bool[W]: those that the player has and has ammunition for."""
        return arms.owned & (arms.ammo[self.ammo] >= self.uses)

    def tic(self, state: Any, attack: jax.Array, held: jax.Array) -> tuple[Any, jax.Array]:
        """The state after a tic of the weapons, and bool[] whether a shot left.

        Args:
            state: before it.
            attack: bool[], whether ATTACK is held.
            held: int32[], the buttons that are held, bit i for button i.
        """
        if len(self) == 1:
            trigger, fires = pull(self.slots[0].weapon, state.trigger, attack)
            return state.replace(trigger=trigger), fires
        arms = self.chosen(state.arms, held >> self._first_button)
        trigger, arms, fires = self.pulled(arms, state.trigger, attack)
        return state.replace(trigger=trigger, arms=arms), fires

    def chosen(self, arms: Arms, asked: jax.Array) -> Arms:
        """The arms after a tic in which selecting buttons are held; each counts in its first tic.

        Args:
            arms: before it.
            asked: int32[], the buttons of `SWITCHING` that are held, bit i for the i-th.
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
        """Trigger and arms after a tic in which ATTACK was held or not, and whether a shot left."""
        count = len(self)
        comes = (trigger.wait == RAISE_TICS) & (arms.pending < count)
        selected = jnp.where(comes, arms.pending, arms.selected)
        pending = jnp.where(comes, count, arms.pending)
        weapon = self[selected]
        tics = jnp.where(comes, weapon.ready, trigger.tics)
        kind = jnp.asarray(self.ammo)[selected]
        # One that is empty is put away once its shot is over.
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
        """int32[N]: the damage that the bullets of a shot do to each body, zero without a shot.

        Args:
            state: after the tic in which the shot may leave; it goes along the player's angle.
            shot: bool[] whether it leaves, int32[2] from where.
            bodies: int32[N, 2] places, int32[N] half-widths, bool[N] which can be hit.
            walls: float32[L, 4] that stop bullets.
            bits: uint32[R], random, of each bullet.
        """
        (fires, origin), (places, widths, there) = shot, bodies
        if all(slot.weapon.speed for slot in self.slots):
            return jnp.zeros(there.shape, jnp.int32)
        hand = state.arms.selected if len(self) > 1 else None, state.trigger.held
        damage = where_few(partial(self._damage, widths, walls), _FEW)(
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
        """int32[N]: what they do, by the weapon in hand and whether its trigger has been held."""
        (selected, held), (origin, angle), (places, there) = hand, line, bodies
        weapon = self.slots[0].weapon if selected is None else self[selected]
        scatters = ((weapon.loose == 1) | held) & (weapon.spread > 0)
        angles = angle + jnp.where(scatters, spread(bits, weapon.spread), jnp.uint32(0))
        origins = jnp.broadcast_to(origin[None], (self.rays, 2))
        hit = first_body(origins, along(angles), places, widths, there[None], walls, weapon.reach)
        flies = (np.arange(self.rays) < weapon.rays) & (weapon.speed == 0)
        damage = jnp.where(flies, weapon.damage(byte(bits, 2)), 0)
        return jnp.sum(jnp.where(hit, damage[:, None], 0), axis=0, dtype=jnp.int32)

    def show(self, image: jax.Array, state: Any, kind: ImageKind) -> jax.Array:
        """An image with the weapon in the player's hands."""
        images = [slot.weapon.show(image, state.trigger, kind) for slot in self.slots]
        return images[0] if len(images) == 1 else jnp.stack(images)[state.arms.selected]

    def describe(self, state: Any) -> Info:
        """Shots left, and of several weapons the number of the button that selects this one."""
        shots = {"ammo": state.trigger.ammo}
        if len(self) == 1:
            return shots
        return shots | {"weapon": jnp.asarray(self.buttons)[state.arms.selected]}

    def from_game(self, state: Any, game: Game) -> Any:
        """The game's ammunition and weapons; of a button it tells only how many weapons it has."""
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
