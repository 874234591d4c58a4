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
from .wad import Wad, WadPicture

# Rows from the top of a screen of 320 by 200 at which a weapon is held, and while it is raised:
# so many lower in each tic before it is up.
REST, UP, RISE = 32.375, 32, 6
SWITCH_TICS, RAISE_TICS = 30, 15
"""Tics from selecting a weapon to its first possible shot, and how many of them raise it."""
# The tics of each picture of a weapon that moves while it is ready.
IDLES = 4
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
        ready: the letters of the weapon that is ready; the first one while it is raised.
        up: the tic of the game from which on it is no longer raised.
    """

    sprite: str
    fires: tuple[Tics, ...]
    flash: str = ""
    flashes: tuple[Tics, ...] = ()
    begin: int = 0
    ready: str = "A"
    up: int = 15

    def pictures(self) -> list[tuple[str, str]]:
        """Sprite and letter of each picture, without repetition."""
        letters = [*self.ready, *(tics.letter for tics in self.fires)]
        gun = [(self.sprite, letter) for letter in letters]
        flash = [(self.flash, tics.letter) for tics in self.flashes]
        return list(dict.fromkeys(gun + flash))

    def idles(self, known: Sequence[tuple[str, str]]) -> list[int]:
        """The pictures of the weapon that is ready, two, counted over known ones."""
        return [known.index((self.sprite, letter)) for letter in (self.ready * 2)[:2]]

    def timed(self, known: Sequence[tuple[str, str]]) -> np.ndarray:
        """int32[tics + 1, 3]: picture, picture of the flash or -1, and light by tic; ready last.

        Pictures are counted over known ones.
        """
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
            (self.idles(known)[0], -1, 0),
        ]
        return np.array(rows, np.int32)


WEAPON_LOOKS = {
    "fist": WeaponLook(
        "PUNG", (Tics("B", 4), Tics("C", 4), Tics("D", 5), Tics("C", 4), Tics("B", 5))
    ),
    "chainsaw": WeaponLook("SAWG", (Tics("A", 4), Tics("B", 4)), ready="CD"),
    "shotgun": WeaponLook(
        "SHTG",
        (
            *(Tics("A", 10), Tics("B", 5), Tics("C", 5), Tics("D", 4)),
            *(Tics("C", 5), Tics("B", 5), Tics("A", 10)),
        ),
        "SHTF",
        (Tics("A", 4, 1), Tics("B", 3, 2)),
        begin=3,
    ),
    "super shotgun": WeaponLook(
        "SHT2",
        (
            *(Tics("A", 10), *(Tics(letter, 7) for letter in "BCDEF")),
            *(Tics("G", 6), Tics("H", 6), Tics("A", 5)),
        ),
        "SHT2",
        (Tics("I", 4, 1), Tics("J", 3, 2)),
        begin=3,
    ),
    "chaingun": WeaponLook(
        "CHGG", (Tics("A", 4), Tics("B", 4)), "CHGF", (Tics("A", 4, 1), Tics("B", 4, 2))
    ),
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
    looks: Sequence[WeaponLook],
    trigger: Any,
    swing: jax.Array,
    time: jax.Array,
    selected: jax.Array | None = None,
) -> tuple[Held, jax.Array]:
    """The pictures of a weapon in the player's hands; int32[], by how many shades it flashes.

    Args:
        looks: the pictures of the player's weapons.
        trigger: the `weapons.Trigger` of the one in hand.
        swing: float32[], how far it swings, in rows of the screen.
        time: int32[], tics since the game began.
        selected: int32[], the weapon in hand; None for the only one.
    """
    known = pictures_of(looks)
    tables = [look.timed(known) for look in looks]
    lengths = np.array([len(table) for table in tables], np.int32)

    def own(values: np.ndarray) -> Any:
        return values[0] if selected is None else jnp.asarray(values)[selected]

    ready = own(lengths - 1)
    row = own(np.cumsum(lengths, dtype=np.int32) - lengths) + jnp.minimum(trigger.tics, ready)
    table = np.concatenate(tables)
    gun, flash, light = jnp.asarray(table).at[row].get(mode="promise_in_bounds")
    angle = (time * (2**32 // SWING_TICS)).astype(jnp.uint32)
    cosine, _ = direction(angle)
    _, sine = direction(angle & np.uint32(2**31 - 1))
    ways = jnp.stack([cosine, sine]).astype(jnp.float32) * np.float32(1 / ONE)
    rests = trigger.tics >= ready
    place = jnp.where(rests, swing * ways, 0) + np.array([0, REST], np.float32)
    if selected is not None:
        changes = trigger.wait > 0
        # The weapon is lowered from its rest, and the next one raised from below.
        wait = trigger.wait.astype(jnp.float32)
        lowered = SWITCH_TICS + (REST - UP) / RISE - wait
        lacks = jnp.where(trigger.wait < RAISE_TICS, wait + 1, lowered)
        place = jnp.where(changes, _lower(lacks), place)
        idles = np.array([look.idles(known) for look in looks], np.int32)
        gun = jnp.where(rests & ~changes, jnp.asarray(idles)[selected, time // IDLES % 2], gun)
    place = jnp.where(time < looks[0].up, _lower((looks[0].up - time).astype(jnp.float32)), place)
    shown = Held(
        picture=jnp.stack([jnp.maximum(flash, 0), gun]),
        place=jnp.stack([place, place]),
        shown=jnp.stack([flash >= 0, jnp.bool_(True)]),
    )
    return shown, light * FLASH_SHADES


def _lower(lacks: jax.Array) -> jax.Array:
    """float32[2]: the place of a weapon that lacks float32[] tics until it is up."""
    low, rise = np.array([0, UP], np.float32), np.array([0, RISE], np.float32)
    return jnp.asarray(low) + rise * lacks


def pictures_of(looks: Sequence[WeaponLook]) -> list[tuple[str, str]]:
    """Sprite and letter of each picture of weapons, without repetition."""
    return list(dict.fromkeys(picture for look in looks for picture in look.pictures()))


def read_stamps(wad: Wad, looks: Sequence[WeaponLook]) -> list[WadPicture]:
    """The pictures of weapons."""
    return [wad.sprite(sprite, letter)[0] for sprite, letter in pictures_of(looks)]


def stamps_of(pictures: Sequence[WadPicture], first: np.ndarray) -> Stamps:
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
