"""Several weapons: which of them the player has, which it holds, and how it changes between them.

Numbers are those of the game's own tables (ViZDoom 1.3.2, wadsrc/static/actors/doom), and the tics
were held against the running game.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, cast

import jax
import jax.numpy as jnp
import numpy as np

from ...pytree import PyTreeNode
from .weapons import PISTOL, ROCKET_LAUNCHER, Trigger, Weapon, pull

BULLETS, SHELLS, ROCKETS = range(3)
MOST = np.array((200, 50, 50), np.int32)
"""The most of each ammunition."""
CHANGE, RAISE = 30, 15
"""Tics from wanting another weapon to shooting with it, and of them those after it has come."""
# The numbers of a weapon that a program looks up, and one beyond all distances, in map units.
_NUMBERS = tuple(f.name for f in fields(Weapon) if f.type != "str" and f.name != "locks")
_FAR = 1 << 20


@dataclass(frozen=True)
class Stock:
    """A weapon in its place.

    Attributes:
        weapon: it.
        button: the number by which it is selected; of two with the same one the other is taken.
        order: the lower, the sooner it is taken up when another one is empty.
        ammunition: what it shoots.
    """

    weapon: Weapon
    button: int
    order: int
    ammunition: int = BULLETS


FIST = Weapon("fist", 8, 17, 22, 2, 10, spread=18, uses=0, loose=True, reach=64)
CHAINSAW = Weapon("chainsaw", 0, 8, 8, 2, 10, spread=18, second=4, uses=0, loose=True, reach=65)
SHOTGUN = Weapon("shotgun", 3, 37, 44, 5, 3, spread=18, rays=7, loose=True)
SUPER_SHOTGUN = Weapon("super shotgun", 3, 51, 62, 5, 3, spread=19, rays=20, uses=2, loose=True)
CHAINGUN = Weapon("chaingun", 0, 8, 8, 5, 3, spread=18, second=4)
WEAPONS = (
    Stock(FIST, 1, 3700),
    Stock(CHAINSAW, 1, 2200),
    Stock(PISTOL, 2, 1900, BULLETS),
    Stock(SHOTGUN, 3, 1300, SHELLS),
    Stock(SUPER_SHOTGUN, 3, 400, SHELLS),
    Stock(CHAINGUN, 4, 700, BULLETS),
    Stock(ROCKET_LAUNCHER, 5, 2500, ROCKETS),
)
"""All of them, in the order in which they are stepped through."""


class Arms(PyTreeNode):
    """What a player has of W weapons.

    Attributes:
        selected: int32[], the one in its hands.
        pending: int32[], the one that it wants; W for none.
        owned: bool[W].
        ammo: int32[3], of each ammunition.
        asked: int32[], the selecting buttons held in the tic before, as bits.
    """

    selected: jax.Array
    pending: jax.Array
    owned: jax.Array
    ammo: jax.Array
    asked: jax.Array


class Arsenal:
    """The tables of W weapons; constants of a program.

    Attributes:
        stocks: the weapons.
        ammunition: int32[W], what each shoots.
        uses: int32[W], how much of it a shot takes.
        buttons: int32[W], the number by which each is selected.
        rays: the most bullets of a shot.
    """

    def __init__(self, stocks: Sequence[Stock] = WEAPONS) -> None:
        """Lay out the tables."""
        self.stocks = tuple(stocks)
        self.ammunition = np.array([stock.ammunition for stock in stocks], np.int32)
        self.buttons = np.array([stock.button for stock in stocks], np.int32)
        self.uses = np.array([stock.weapon.uses for stock in stocks], np.int32)
        self.rays = max(stock.weapon.rays for stock in stocks)
        self._order = np.array([stock.order for stock in stocks], np.int32)
        rows = [[min(getattr(s.weapon, name), _FAR) for name in _NUMBERS] for s in stocks]
        self._rows = np.array(rows, np.int32)

    def __len__(self) -> int:
        """How many weapons there are."""
        return len(self.stocks)

    def index_of(self, weapon: Weapon) -> int:
        """The place of a weapon."""
        return [stock.weapon for stock in self.stocks].index(weapon)

    def __getitem__(self, index: jax.Array) -> Any:
        """The weapon at int32[], whose numbers are those of a program: a `Weapon` of arrays."""
        row = jnp.asarray(self._rows)[index]
        return Weapon("", **{name: cast(Any, row[i]) for i, name in enumerate(_NUMBERS)})

    def usable(self, arms: Arms) -> jax.Array:
        """bool[W]: those that the player has and has ammunition for."""
        return arms.owned & (arms.ammo[self.ammunition] >= self.uses)

    def chosen(self, arms: Arms, asked: jax.Array) -> Arms:
        """The arms after a tic in which selecting buttons are held.

        A button counts in its first tic alone.

        Args:
            arms: before it.
            asked: int32[], bit i for the weapons of button i + 1, the next two bits after those
                of six buttons for the next weapon and the one before.
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
    ) -> tuple[Arms, Trigger, jax.Array]:
        """Arms and trigger after a tic in which ATTACK was held or not, and whether a shot left."""
        count = len(self)
        comes = (trigger.wait == RAISE) & (arms.pending < count)
        selected = jnp.where(comes, arms.pending, arms.selected)
        pending = jnp.where(comes, count, arms.pending)
        weapon = self[selected]
        tics = jnp.where(comes, weapon.ready, trigger.tics)
        kind = jnp.asarray(self.ammunition)[selected]
        # One that is empty is put away once its shot is over.
        empty = (arms.ammo[kind] < weapon.uses) & (tics + 1 >= weapon.again) & (pending == count)
        best = jnp.argmin(jnp.where(self.usable(arms), self._order, 1 << 16)).astype(jnp.int32)
        pending = jnp.where(empty, best, pending)
        leaves = (pending < count) & (trigger.wait == 0) & (tics + 1 >= weapon.ready)
        trigger = Trigger(
            tics=tics,
            held=trigger.held & ~comes,
            ammo=arms.ammo[kind],
            wait=jnp.where(leaves, CHANGE, trigger.wait),
        )
        trigger, fires = pull(weapon, trigger, attack & (pending == count))
        ammo = arms.ammo.at[kind].set(trigger.ammo)
        return arms.replace(selected=selected, pending=pending, ammo=ammo), trigger, fires


def first_arms(arsenal: Arsenal, owned: Sequence[Weapon], selected: Weapon, bullets: int) -> Arms:
    """Arms with some weapons, one of them in hand, and bullets."""
    mine = np.array([stock.weapon in owned for stock in arsenal.stocks])
    ammo = np.array((bullets, 0, 0), np.int32)
    return Arms(
        selected=jnp.int32(arsenal.index_of(selected)),
        pending=jnp.int32(len(arsenal)),
        owned=jnp.asarray(mine),
        ammo=jnp.asarray(ammo),
        asked=jnp.int32(0),
    )
