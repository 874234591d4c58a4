"""How Doom's scenarios look here: one colour a texture, Doom's light, our own pictures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ...engine.art import load_art
from ...engine.scene import Theme
from ...engine.shade import Light
from ...maps.symbols import LABEL_COLOURS, SYMBOLS
from ...maps.things import (
    AMMUNITION,
    ARMOUR,
    CACODEMON,
    CHAINGUN_GUY,
    DEMON,
    FIREBALL,
    GOAL,
    HELL_KNIGHT,
    IMP,
    MARINE,
    MEDKIT,
    POISON,
    RGB,
    ROCKET,
    SHOTGUN_GUY,
    WEAPON,
    ZOMBIE,
)
from .lattice import Tiles

EYE = 41
"""Height of the eye above the floor in map units."""
ROW_FOCAL_SHARE = 0.8
"""Of the game's screen: 240 rows and a focal length of 192, since pixels are 1.2 times as high
as wide."""

# Each wall's texture: the symbol of the wall that stands for it here, and its mean colour.
TEXTURES: dict[str, tuple[str, RGB]] = {
    "BIGDOOR2": ("1", (55, 53, 51)),
    "CEIL4_2": ("2", (0, 0, 23)),
    "CRATE2": ("3", (81, 80, 79)),
    "COMP01": ("4", (126, 126, 126)),
    "TLITE6_1": ("5", (60, 53, 47)),
    "FLOOR1_6": ("6", (118, 0, 0)),
    "SILVER2": ("7", (78, 78, 111)),
    "SFALL2": ("8", (27, 57, 19)),
    "BIGBRIK1": ("9", (50, 31, 15)),
    "GSTONE1": ("U", (64, 68, 43)),
    "STONE2": ("#", (55, 55, 55)),
    "BRICK9": ("L", (72, 54, 35)),
    "CEMENT3": ("Q", (136, 134, 130)),
    "TANROCK2": ("W", (133, 108, 87)),
    "BRICK12": ("I", (112, 89, 70)),
    "CONS1_7": ("M", (91, 91, 86)),
    "CONS1_1": ("Z", (91, 91, 86)),
    "SLIME16": ("K", (111, 89, 67)),
    "STARGR2": ("D", (85, 84, 83)),
    "SILVER3": ("H", (100, 100, 103)),
    "FLAT23": ("X", (119, 119, 119)),
    "FLAT5_3": ("A", (116, 21, 21)),
    "COMPBLUE": ("T", (0, 0, 71)),
}
# Mean colours of the textures FLAT1_1, NUKAGE1, CEIL4_1; FLOOR0_1, FLAT4, CEIL1_1, CEIL1_2.
BROWN, ACID, CEILING = (65, 46, 26), (23, 47, 13), (0, 0, 25)
GREY, CRATES = (98, 98, 98), (81, 81, 81)  # FLOOR0_5, CRATOP1
TAN, SLATE, TILES, OCHRE = (116, 92, 72), (38, 38, 38), (88, 67, 49), (73, 64, 29)
STEEL, TUBES = (89, 89, 89), (60, 44, 44)  # STONE5, TLITE6_5
CLAY = (89, 69, 45)  # CEIL3_3


@dataclass(frozen=True)
class Picture:
    """A thing as it is drawn: a square that stands on the floor, or hovers above it.

    Attributes:
        label: its label id.
        art: its picture, a file in `engine/art`.
        side: of the square, in map units.
        shape: RGB of the picture's first colour.
        detail: RGB of its second one.
        lift: of its lower side above the floor, in map units; monsters' feet are below it.
    """

    label: int
    art: str
    side: float
    shape: RGB
    detail: RGB
    lift: float = 0


VEST = Picture(GOAL.label, "vest", 37, (61, 84, 51), (47, 52, 40))
MEDKIT_BOX = Picture(MEDKIT.label, "medkit-box", 29.5, (150, 152, 148), (52, 122, 46))
BOTTLE = Picture(POISON.label, "bottle", 15.3, (72, 112, 80), (110, 140, 66))
AMMUNITION_BOX = Picture(AMMUNITION.label, "ammunition", 26, (98, 104, 74), (226, 180, 76))
STIMPACK = Picture(MEDKIT.label, "medkit-box", 17, (150, 152, 148), (52, 122, 46))
HEALTH_BONUS = Picture(MEDKIT.label, "bottle", 15.3, (48, 72, 160), (110, 140, 66))
ARMOUR_BONUS = Picture(ARMOUR.label, "vest", 17, (72, 84, 64), (47, 52, 40))
GREEN_ARMOUR = Picture(ARMOUR.label, "vest", 37, (61, 84, 51), (47, 52, 40))
BLUE_ARMOUR = Picture(ARMOUR.label, "vest", 37, (52, 60, 130), (40, 44, 60))
BULLET_BOX = Picture(AMMUNITION.label, "ammunition", 28, (98, 104, 74), (226, 180, 76))
SHELL_BOX = Picture(AMMUNITION.label, "ammunition", 28, (120, 90, 60), (190, 40, 36))
ROCKET_BOX = Picture(AMMUNITION.label, "ammunition", 40, (92, 72, 48), (150, 146, 140))
GUN = Picture(WEAPON.label, "gun", 56, (60, 60, 66), (120, 84, 50))
SAW = Picture(WEAPON.label, "gun", 52, (150, 90, 40), (120, 124, 130))
HEAVY_GUN = Picture(WEAPON.label, "gun", 58, (92, 94, 100), (52, 54, 60))
LAUNCHER = Picture(WEAPON.label, "gun", 60, (72, 84, 64), (140, 120, 60))
GOAL_STAR = Picture(GOAL.label, "goal", 40, (255, 216, 20), (140, 118, 11), lift=10)


def _monster(
    label: int, art: str, side: float, shape: RGB, detail: RGB, lift: float = 0
) -> tuple[Picture, ...]:
    """The pictures of a monster, pose by pose (`kinds.Pose`)."""
    poses = ("one", "two", "aim", "dead")
    return tuple(Picture(label, f"{art}-{pose}", side, shape, detail, lift) for pose in poses)


# Sizes of demons, imps, marines, and fireballs are those of the game's own pictures, read off
# screens of 1280 by 960 (`python -m fidelity.doom_sizes`).
MONSTERS = {
    "demon": _monster(DEMON.label, "demon", 60, (161, 68, 68), (236, 206, 190), -3.4),
    "imp": _monster(IMP.label, "imp", 63, (82, 52, 28), (200, 170, 60), -3.4),
    "chainsaw marine": _monster(MARINE.label, "marine", 58, (74, 98, 65), (170, 140, 60), -1.7),
    "hell knight": _monster(HELL_KNIGHT.label, "imp", 70, (140, 104, 84), (110, 70, 52)),
    "zombie": _monster(ZOMBIE.label, "soldier", 56, (92, 84, 60), (150, 130, 100)),
    "shotgun guy": _monster(SHOTGUN_GUY.label, "soldier", 56, (60, 56, 52), (150, 50, 40)),
    "chaingun guy": _monster(CHAINGUN_GUY.label, "soldier", 60, (112, 44, 36), (140, 140, 140)),
}
FIREBALLS = (
    Picture(FIREBALL.label, "fireball", 16, (236, 140, 40), (255, 230, 150), lift=28),
    Picture(FIREBALL.label, "blaze", 40, (200, 80, 20), (255, 200, 90), lift=20),
)
ROCKETS = (
    Picture(ROCKET.label, "rocket", 14, (120, 116, 112), (255, 200, 90), lift=28),
    Picture(ROCKET.label, "burst", 60, (200, 80, 20), (255, 200, 90), lift=4),
)
CACODEMONS = (
    Picture(CACODEMON.label, "cacodemon", 66, (66, 38, 42), (150, 120, 60)),
    Picture(CACODEMON.label, "cacodemon-dead", 66, (66, 38, 42), (70, 70, 160)),
)


@dataclass(frozen=True)
class DoomLight(Light):
    """Doom's light: 32 steps of brightness, the farther the darker, down to the sector's own.

    Attributes:
        level: of the sector, 0 to 255.
        unit: map units a tile.
    """

    level: float = 192.0
    unit: int = 16

    def wall(self, depth: jax.Array, horizontal: jax.Array, along: jax.Array) -> jax.Array:
        """float32: of walls; those that run north and south are lit more than the others."""
        del along
        contrast = jnp.where(horizontal, jnp.float32(_CONTRAST), jnp.float32(-_CONTRAST))
        return self._factor(depth, contrast)

    def plain(self, depth: Any) -> Any:
        """float32: of floor, ceiling and billboards, numpy in, numpy out."""
        return self._factor(depth, np.float32(0))

    def _factor(self, depth: Any, darker: Any) -> Any:
        xp = np if isinstance(depth, np.ndarray) else jnp
        shade = np.float32(_STEPS * (2 - (self.level + 12) / 128)) + darker
        near = np.float32(_REACH / self.unit) / xp.maximum(depth, np.float32(1e-3))
        step = xp.floor(xp.clip(shade - near, np.float32(0), np.float32(_STEPS - 1)))
        return 1 - step * np.float32(1 / _STEPS)


# Steps of brightness; how much sooner than others walls of one direction get darker, in steps;
# and by how many steps something is brighter at a distance of one map unit.
_STEPS, _CONTRAST, _REACH = 32, 4, 1280


def label_of(texture: str) -> int:
    """The label id of walls with a texture."""
    return SYMBOLS[TEXTURES[texture][0]].label


def relabelled(tiles: Tiles) -> np.ndarray:
    """uint8[4, rows, columns]: what the faces of a map's walls show, as label ids.

    Sides that nobody sees show what another side of the tile shows, or the first texture.
    """
    table = np.array([0, 0, 0, *map(label_of, tiles.textures)], np.uint8)
    faces = table[tiles.faces]
    seen = faces.max(axis=0)
    seen = np.where(seen == 0, label_of(tiles.textures[0]), seen)
    return np.where(tiles.solid & (faces == 0), seen[None], faces).astype(np.uint8)


def doom_theme(
    pictures: tuple[Picture, ...], *, floor: RGB, ceiling: RGB, level: float, unit: int
) -> Theme:
    """The look of a scenario.

    Args:
        pictures: of the things, in the order of `Sprites.look`.
        floor: mean RGB of its texture.
        ceiling: likewise.
        level: the sector's light, 0 to 255.
        unit: map units a tile.
    """
    colours = np.array(LABEL_COLOURS, np.float32)
    for texture, (_, rgb) in TEXTURES.items():
        colours[label_of(texture)] = rgb
    plain = np.zeros_like(load_art("door"))
    radii = np.array([picture.side / 2 for picture in pictures])
    lifts = np.array([picture.lift for picture in pictures])
    return Theme(
        wall_colours=colours,
        wall_panels=np.zeros(len(colours), np.int32),
        panels=plain[None],
        panel_accent=np.zeros(3, np.float32),
        floor=np.array((floor, floor), np.float32),
        ceiling=np.array(ceiling, np.float32),
        sprite_art=np.stack([load_art(picture.art) for picture in pictures]),
        sprite_colours=np.array([(p.shape, p.detail) for p in pictures], np.float32),
        sprite_radius=(radii / unit).astype(np.float32),
        sprite_drop=((EYE - lifts - radii) / unit).astype(np.float32),
        sprite_labels=np.array([picture.label for picture in pictures], np.uint8),
        light=DoomLight(level, unit),
    )
