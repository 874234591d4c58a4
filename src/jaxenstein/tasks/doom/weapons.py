"""Weapons of the player: when a shot leaves, what it does, and how well it is aimed.

The tics are those of the game's tables of states, in which ATTACK is looked at while the weapon is
ready, and once more after a shot, when a held trigger fires again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import jax
import jax.numpy as jnp

from ...pytree import PyTreeNode
from .dice import roll, spread


@dataclass(frozen=True)
class Weapon:
    """A weapon.

    Attributes:
        name: what it is called.
        shot: tics from pressing ATTACK to the shot.
        again: tics from pressing to the next shot's pressing, if it is held.
        ready: tics from pressing until it can be pressed anew.
        dice: the damage of a bullet is this times a die.
        sides: of that die.
        spread: bits by which the sum of two bytes is shifted to be the error of the angle of
            all shots of a held trigger but the first; 0 if there is none.
        speed: of the rockets that it fires, map units a tic; 0 if it fires bullets.
        locks: whether it stays locked until ATTACK is released once it is drawn.
        look: what it looks like in the player's hands, one of `hands.LOOKS`.
        game_ammo: what the game calls its ammunition.
        second: tics from pressing to a second shot; -1 if there is none.
        rays: bullets of a shot.
        uses: ammunition that a shot takes.
        loose: whether first shots, too, have an error.
        reach: how far shots go, in map units.
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
    look: str = "pistol"
    game_ammo: str = "AMMO2"
    second: int = -1
    rays: int = 1
    uses: int = 1
    loose: bool = False
    reach: float = math.inf

    def damage(self, byte: jax.Array) -> jax.Array:
        """int32[]: of one hit, from a random byte."""
        return roll(self.dice, self.sides, byte)


PISTOL = Weapon("pistol", shot=4, again=14, ready=19, dice=5, sides=3, spread=18)
ROCKET_LAUNCHER = Weapon(
    "rocket launcher",
    shot=8,
    again=20,
    ready=20,
    dice=20,
    sides=8,
    speed=20,
    locks=True,
    look="rocket launcher",
    game_ammo="AMMO5",
)


class Trigger(PyTreeNode):
    """What the weapon does.

    Attributes:
        tics: int32[], since ATTACK was taken up; from the weapon's `ready` on it is ready.
        held: bool[], whether the shot before was followed by this one without a release.
        ammo: int32[], shots left.
        wait: int32[], tics until it is drawn and takes up ATTACK at all.
    """

    tics: jax.Array
    held: jax.Array
    ammo: jax.Array
    wait: jax.Array


def drawn_weapon(weapon: Weapon, ammo: int, wait: int = 0) -> Trigger:
    """A weapon that takes up ATTACK at once, or after so many tics."""
    return Trigger(jnp.int32(weapon.ready), jnp.bool_(False), jnp.int32(ammo), jnp.int32(wait))


def pull(weapon: Weapon, trigger: Trigger, attack: jax.Array) -> tuple[Trigger, jax.Array]:
    """The weapon after a tic in which ATTACK was held or not, and bool[] whether a shot left."""
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


def shot_angle(weapon: Weapon, trigger: Trigger, angle: jax.Array, bits: jax.Array) -> jax.Array:
    """uint32[]: where a shot goes that is aimed along `angle`, from random bits uint32[]."""
    if not weapon.spread:
        return angle
    return angle + jnp.where(trigger.held, spread(bits, weapon.spread), jnp.uint32(0))
