"""Weapons of the player: when a shot is fired, and what it does.

Numbers are those of the game's own tables (ViZDoom 1.3.2, wadsrc/static/actors/doom). ATTACK is
checked while the weapon is ready, and once more after a shot, when a held trigger fires again. The
tics were checked against the running game.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np

from ...about import Event
from ...engine.shade import ImageKind
from ...pytree import PyTreeNode
from .fixed import roll
from .view import FIST as FIST_PICTURE
from .view import FLASH_TICS, Layer, overlay_weapon

BULLETS, SHELLS, ROCKETS = range(3)
MOST_AMMO = np.array((200, 50, 50), np.int32)
"""The most of each kind of ammunition."""
SHOOTING = {
    "shots": Event("fired", "fired {} times"),
    "kills": Event("killed a monster", "killed {} monsters"),
}
"""The events for players with weapons."""
_PISTOL_PICTURE: Layer = "pistol", ((40, 40, 46), (104, 106, 114))
_LAUNCHER_PICTURE: Layer = "rocket-launcher", ((84, 92, 72), (40, 44, 38))


@dataclass(frozen=True)
class Weapon:
    """A weapon.

    Attributes:
        name: its name.
        shot: tics from pressing ATTACK to the shot.
        again: tics from pressing ATTACK to the start of the next shot, if it is held.
        ready: tics from pressing ATTACK until it can be pressed again.
        dice: the damage of a bullet is this times the roll of a die.
        sides: sides of that die.
        spread: bits by which the difference of two bytes is shifted to give the angle error of all
            shots of a held trigger except the first; 0 if there is none.
        speed: speed of its rockets, map units per tic; 0 if it fires bullets.
        locks: whether, once raised, it stays locked until ATTACK is released.
        picture: its picture in the player's hands, farthest layer first.
        game_ammo: the game's name of its ammunition.
        second: tics from pressing ATTACK to a second shot; -1 if there is none.
        rays: bullets per shot.
        uses: ammunition per shot.
        loose: whether first shots have an error too.
        reach: range of shots, in map units.
    """

    name: str
    shot: int
    again: int
    ready: int
    dice: int
    sides: int
    spread: int = 0
    speed: int = 0
    locks: bool = False
    picture: tuple[Layer, ...] = (FIST_PICTURE, _PISTOL_PICTURE)
    game_ammo: str = "AMMO2"
    second: int = -1
    rays: int = 1
    uses: int = 1
    loose: bool = False
    reach: float = math.inf

    def damage(self, byte: jax.Array) -> jax.Array:
        """int32[...]: the damage of one hit, from a random byte."""
        return roll(self.dice, self.sides, byte)

    def show(self, image: jax.Array, trigger: Trigger, kind: ImageKind) -> jax.Array:
        """Draw the weapon in the player's hands onto an image, once it is raised."""
        ends = min(self.shot + FLASH_TICS, self.ready)
        flashes = (trigger.tics >= self.shot) & (trigger.tics < ends)
        return overlay_weapon(image, self.picture, trigger.wait == 0, flashes, kind)


FIST = Weapon("fist", 8, 17, 22, 2, 10, spread=18, uses=0, loose=True, reach=64)
PISTOL = Weapon("pistol", shot=4, again=14, ready=19, dice=5, sides=3, spread=18)
CHAINSAW = Weapon("chainsaw", 0, 8, 8, 2, 10, spread=18, second=4, uses=0, loose=True, reach=65)
SHOTGUN = Weapon("shotgun", 3, 37, 44, 5, 3, spread=18, rays=7, loose=True)
SUPER_SHOTGUN = Weapon("super shotgun", 3, 51, 62, 5, 3, spread=19, rays=20, uses=2, loose=True)
CHAINGUN = Weapon("chaingun", 0, 8, 8, 5, 3, spread=18, second=4)
ROCKET_LAUNCHER = Weapon(
    "rocket launcher",
    shot=8,
    again=20,
    ready=20,
    dice=20,
    sides=8,
    speed=20,
    locks=True,
    picture=(FIST_PICTURE, _LAUNCHER_PICTURE),
    game_ammo="AMMO5",
)


@dataclass(frozen=True)
class Slot:
    """A weapon and how it is selected.

    Attributes:
        weapon: the weapon.
        button: the button that selects it; pressing it again selects the other weapon on it.
        order: when a weapon is empty, the player takes up the one with the lowest order.
        ammo: its kind of ammunition.
    """

    weapon: Weapon
    button: int = 1
    order: int = 0
    ammo: int = BULLETS


SLOTS = (
    Slot(FIST, 1, 3700),
    Slot(CHAINSAW, 1, 2200),
    Slot(PISTOL, 2, 1900, BULLETS),
    Slot(SHOTGUN, 3, 1300, SHELLS),
    Slot(SUPER_SHOTGUN, 3, 400, SHELLS),
    Slot(CHAINGUN, 4, 700, BULLETS),
    Slot(ROCKET_LAUNCHER, 5, 2500, ROCKETS),
)
"""The game's weapons, in the order in which the player steps through them."""


class Trigger(PyTreeNode):
    """The state of the weapon in the player's hands.

    Attributes:
        tics: int32[], since ATTACK was accepted; from the weapon's `ready` on it is ready.
        held: bool[], whether this shot followed the previous one without a release.
        ammo: int32[], shots left.
        wait: int32[], tics until it is raised and accepts ATTACK.
    """

    tics: jax.Array
    held: jax.Array
    ammo: jax.Array
    wait: jax.Array


def pull(weapon: Weapon, trigger: Trigger, attack: jax.Array) -> tuple[Trigger, jax.Array]:
    """The weapon after a tic with or without ATTACK; bool[], whether a shot was fired."""
    tics = trigger.tics + 1
    presses = attack & (trigger.ammo >= weapon.uses) & (trigger.wait == 0)
    again = presses & (tics == weapon.again)
    starts = again | (presses & (tics >= weapon.ready))
    held = again | (trigger.held & (tics < weapon.again))
    tics = jnp.where(starts, 0, jnp.minimum(tics, weapon.ready))
    shoots = (tics == weapon.shot) | (tics == weapon.second)
    fires = shoots & (trigger.ammo >= weapon.uses)
    ammo = trigger.ammo - jnp.where(fires, weapon.uses, 0)
    wait = jnp.maximum(trigger.wait - 1, 0)
    if weapon.locks:
        wait = jnp.where(attack & (trigger.wait == 1), 1, wait)
    return Trigger(tics, held, ammo, wait), fires
