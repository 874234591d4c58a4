"""The game's own pictures of weapons: frames, flash, light, and where they are on the screen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ...engine.scene import Held
from ...engine.textures import Stamps, pack_opaque, sides_of
from .fixed import ONE, direction
from .wad import Picture, Wad

# Rows from the top of a screen of 320 by 200 at which a weapon is held, and while it is raised:
# so many lower in each tic before it is up.
REST, UP, RISE = 32.375, 32, 6
# A weapon swings to either side and down by at most so much, once in so many tics.
SWING, SWING_TICS = 16, 64
# Shades by which a flash lights everything, for each step of its light.
FLASH_SHADES = 4


class Tics(NamedTuple):
    """A picture for some tics: its letter, the tics, and the steps of light that it gives."""

    letter: str
    tics: int
    light: int = 0


@dataclass(frozen=True)
class WeaponLook:
    """The pictures of a weapon.

    Attributes:
        sprite: the four letters of its pictures' names.
        fires: what it shows from the pull of the trigger on.
        flash: the four letters of the flash's pictures.
        flashes: what the flash shows.
        begin: tics from the pull of the trigger to the flash.
        ready: the letter of the weapon that is ready.
        up: the tic of the game from which on it is no longer raised.
    """

    sprite: str
    fires: tuple[Tics, ...]
    flash: str
    flashes: tuple[Tics, ...]
    begin: int = 0
    ready: str = "A"
    up: int = 15

    def pictures(self) -> list[tuple[str, str]]:
        """Sprite and letter of each picture, without repetition."""
        gun = [(self.sprite, tics.letter) for tics in (Tics(self.ready, 1), *self.fires)]
        flash = [(self.flash, tics.letter) for tics in self.flashes]
        return list(dict.fromkeys(gun + flash))

    def timed(self) -> np.ndarray:
        """int32[tics + 1, 3]: picture, picture of the flash or -1, and light by tic; ready last."""
        known = self.pictures()
        gun = [
            known.index((self.sprite, one.letter)) for one in self.fires for _ in range(one.tics)
        ]
        flash, light = [-1] * len(gun), [0] * len(gun)
        tic = self.begin
        for one in self.flashes:
            for at in range(tic, min(tic + one.tics, len(gun))):
                flash[at], light[at] = known.index((self.flash, one.letter)), one.light
            tic += one.tics
        rows = [
            *zip(gun, flash, light, strict=True),
            (known.index((self.sprite, self.ready)), -1, 0),
        ]
        return np.array(rows, np.int32)


WEAPON_LOOKS = {
    "pistol": WeaponLook(
        "PISG",
        (Tics("A", 4), Tics("B", 6), Tics("C", 4), Tics("B", 5)),
        "PISF",
        (Tics("A", 7, 1),),
        begin=4,
    ),
    "rocket launcher": WeaponLook(
        "MISG",
        (Tics("B", 20),),
        "MISF",
        (Tics("A", 3, 1), Tics("B", 4, 1), Tics("C", 4, 2), Tics("D", 4, 2)),
        up=17,
    ),
}
"""The pictures of weapons, by the names of `weapons.Weapon`."""


def held(
    look: WeaponLook, trigger: Any, swing: jax.Array, time: jax.Array
) -> tuple[Held, jax.Array]:
    """The pictures of a weapon in the player's hands; int32[], by how many shades it flashes.

    Args:
        look: its pictures.
        trigger: its `weapons.Trigger`.
        swing: float32[], how far it swings, in rows of the screen.
        time: int32[], tics since the game began.
    """
    table = look.timed()
    ready = len(table) - 1
    tics = jnp.minimum(trigger.tics, ready)
    gun, flash, light = jnp.asarray(table).at[tics].get(mode="promise_in_bounds")
    angle = (time * (2**32 // SWING_TICS)).astype(jnp.uint32)
    cosine, _ = direction(angle)
    _, sine = direction(angle & np.uint32(2**31 - 1))
    ways = jnp.stack([cosine, sine]).astype(jnp.float32) * np.float32(1 / ONE)
    place = jnp.where(trigger.tics < ready, 0, swing * ways) + np.array([0, REST], np.float32)
    lacks = (look.up - time).astype(jnp.float32)
    low = np.array([0, UP], np.float32) + np.array([0, RISE], np.float32) * lacks
    place = jnp.where(time < look.up, low, place)
    shown = Held(
        picture=jnp.stack([jnp.maximum(flash, 0), gun]),
        place=jnp.stack([place, place]),
        shown=jnp.stack([flash >= 0, jnp.bool_(True)]),
    )
    return shown, light * FLASH_SHADES


def read_stamps(wad: Wad, look: WeaponLook) -> list[Picture]:
    """The pictures of a weapon."""
    return [wad.sprite(sprite, letter)[0] for sprite, letter in look.pictures()]


def stamps_of(pictures: Sequence[Picture], first: np.ndarray) -> Stamps:
    """The engine's table of pictures, whose first texels in the atlas are at int32[S]."""
    column, opaque = pack_opaque([picture.pixels >= 0 for picture in pictures])
    widths, heights = sides_of([picture.pixels for picture in pictures])
    return Stamps(
        first,
        widths,
        heights,
        column=column,
        opaque=opaque,
        left=np.array([picture.left for picture in pictures], np.int32),
        top=np.array([picture.top for picture in pictures], np.int32),
        sway=(SWING, UP, UP + 16 * RISE),
    )
