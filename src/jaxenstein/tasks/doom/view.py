"""The look of Doom's scenarios: one colour per texture, Doom's light, our own pictures."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ...engine.art import SIZE, load_art, planes_of
from ...engine.scene import Theme
from ...engine.shade import ImageKind, Light, by_side, luma, pack_rgb
from ...maps.symbols import LABEL_COLOURS, SYMBOLS
from ...maps.things import RGB
from ...maps.tilemap import TileMap
from .maps import TileGrid

EYE = 41
"""Height of the eye above the floor in map units."""
ROW_FOCAL_SHARE = 0.8
"""Vertical resolution and focal length of the game's screen: 240 rows and 192, because pixels are
1.2 times as high as wide."""

# For each wall texture: the symbol of the wall that represents it, and its mean colour.
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
# Mean colours of textures, whose names follow.
BROWN, ACID, CEILING = (65, 46, 26), (23, 47, 13), (0, 0, 25)  # FLAT1_1, NUKAGE1, CEIL4_1
GREY, CRATES = (98, 98, 98), (81, 81, 81)  # FLOOR0_5, CRATOP1
TAN, SLATE = (116, 92, 72), (38, 38, 38)  # FLOOR0_1, FLAT4
TILES, OCHRE = (88, 67, 49), (73, 64, 29)  # CEIL1_1, CEIL1_2
STEEL, TUBES = (89, 89, 89), (60, 44, 44)  # STONE5, TLITE6_5
CLAY = (89, 69, 45)  # CEIL3_3

Layer = tuple[str, tuple[RGB, RGB]]
"""A picture of `engine/art`, with the colours of its shape and of its detail."""
FIST: Layer = "fist", ((196, 148, 108), (120, 84, 60))
FLASH: Layer = "muzzle-flash", ((240, 132, 28), (255, 244, 190))
# The shares of the image's rows and columns that a weapon in the player's hands covers, and the
# tics for which the flash of a shot is visible.
HAND_ROWS, HAND_COLUMNS, FLASH_TICS = 0.4, 0.3, 4


@dataclass(frozen=True)
class Picture:
    """The picture of a thing: a square on the floor or above it.

    Attributes:
        art: a file in `engine/art`.
        side: side of the square, in map units.
        shape: RGB of the picture's first colour.
        detail: RGB of its second colour.
        lift: height of its lower side above the floor, in map units; monsters' feet are below it.
    """

    art: str
    side: float
    shape: RGB
    detail: RGB
    lift: float = 0


VEST = Picture("vest", 37, (61, 84, 51), (47, 52, 40))
MEDKIT_BOX = Picture("medkit-box", 29.5, (150, 152, 148), (52, 122, 46))


class Room(NamedTuple):
    """The map of a scenario.

    Attributes:
        map_name: the name of a file in `maps/`, without suffix.
        floor: mean RGB of the floor's texture.
        ceiling: mean RGB of the ceiling's texture.
    """

    map_name: str
    floor: RGB
    ceiling: RGB


@dataclass(frozen=True)
class DoomLight(Light):
    """Doom's light: 32 steps of brightness, darker with distance, down to the sector's minimum.

    Attributes:
        level: light level of the sector, 0 to 255.
        unit: map units per tile.
    """

    level: float = 192.0
    unit: int = 16

    def wall(self, depth: jax.Array, horizontal: jax.Array, along: jax.Array) -> jax.Array:
        """float32: the factor for walls; walls that run north and south are brighter."""
        del along
        contrast = by_side(horizontal, jnp.float32(_CONTRAST), jnp.float32(-_CONTRAST))
        return self._factor(depth, contrast)

    def plain(self, depth: Any) -> Any:
        """float32: the factor for floor, ceiling and billboards; numpy for numpy, else JAX."""
        return self._factor(depth, np.float32(0))

    def _factor(self, depth: Any, darker: Any) -> Any:
        xp = np if isinstance(depth, np.ndarray) else jnp
        shade = np.float32(_STEPS * (2 - (self.level + 12) / 128)) + darker
        near = np.float32(_REACH / self.unit) / xp.maximum(depth, np.float32(1e-3))
        step = xp.floor(xp.clip(shade - near, np.float32(0), np.float32(_STEPS - 1)))
        return 1 - step * np.float32(1 / _STEPS)


# Steps of brightness; how many steps earlier walls in one direction get darker; and by how many
# steps a surface is brighter at a distance of one map unit.
_STEPS, _CONTRAST, _REACH = 32, 4, 1280


def label_of(texture: str) -> int:
    """The label id of walls with a texture."""
    return SYMBOLS[TEXTURES[texture][0]].label


def face_labels(tiles: TileGrid) -> np.ndarray:
    """uint8[4, rows, columns]: the label ids of the faces of a map's walls.

    Invisible sides have the label of another side of the tile, or the first texture's.
    """
    table = np.array([0, 0, 0, *map(label_of, tiles.textures)], np.uint8)
    faces = table[tiles.faces]
    seen = faces.max(axis=0)
    seen = np.where(seen == 0, label_of(tiles.textures[0]), seen)
    return np.where(tiles.solid & (faces == 0), seen[None], faces).astype(np.uint8)


def labelled_tiles(name: str, tiles: TileGrid, starts: np.ndarray, goals: np.ndarray) -> TileMap:
    """The map as tiles with labels.

    Args:
        name: the name of the map.
        tiles: the map as tiles.
        starts: float[n, 2], in map units.
        goals: float[n, 2], in map units.
    """

    def cells(places: np.ndarray) -> tuple[tuple[int, int], ...]:
        corners = [tiles.to_position(x, y) for x, y in places.tolist()]
        return tuple((math.floor(x), math.floor(y)) for x, y in corners)

    faces = tuple(tuple(bytes(row) for row in face) for face in face_labels(tiles))
    return TileMap(name, faces[0], faces, spawns=cells(starts), goals=cells(goals))


def doom_theme(
    pictures: Sequence[tuple[Picture, int]], room: Room, level: float, unit: int
) -> Theme:
    """The look of a scenario.

    Args:
        pictures: the pictures of the things with their label ids, in the order of
            `Sprites.picture`.
        room: the colours of floor and ceiling.
        level: the sector's light, 0 to 255.
        unit: map units per tile.
    """
    colours = np.array(LABEL_COLOURS, np.float32)
    for texture, (_, rgb) in TEXTURES.items():
        colours[label_of(texture)] = rgb
    plain = np.zeros_like(load_art("door"))
    shown = [picture for picture, _ in pictures]
    radii = np.array([picture.side / 2 for picture in shown])
    lifts = np.array([picture.lift for picture in shown])
    return Theme(
        wall_colours=colours,
        wall_panels=np.zeros(len(colours), np.int32),
        panels=plain[None],
        panel_accent=np.zeros(3, np.float32),
        floor=np.array((room.floor, room.floor), np.float32),
        ceiling=np.array(room.ceiling, np.float32),
        sprite_art=np.stack([load_art(picture.art) for picture in shown]),
        sprite_colours=np.array([(p.shape, p.detail) for p in shown], np.float32),
        sprite_radius=(radii / unit).astype(np.float32),
        sprite_drop=((EYE - lifts - radii) / unit).astype(np.float32),
        sprite_labels=np.array([label for _, label in pictures], np.uint8),
        light=DoomLight(level, unit),
    )


def overlay_weapon(
    image: jax.Array,
    layers: tuple[Layer, ...],
    raised: jax.Array,
    flashes: jax.Array,
    kind: ImageKind,
) -> jax.Array:
    """Draw a weapon in the player's hands over an image.

    Args:
        image: uint8[height, width, 3], or uint8[height, width] of greys.
        layers: the pictures of the weapon, farthest first.
        raised: bool[], whether the weapon is visible.
        flashes: bool[], whether the flash of a shot is visible.
        kind: the kind of image; images without colours or greys are not changed.
    """
    if kind not in ("rgb", "gray"):
        return image
    height, width = image.shape[:2]
    rows, columns = max(1, round(HAND_ROWS * height)), max(1, round(HAND_COLUMNS * width))
    there, paint = _stamps(layers, rows, columns, kind)
    covers = jnp.where(flashes, there[1], there[0]) & raised
    colour = jnp.where(flashes, paint[1], paint[0])
    left = (width - columns) // 2
    place = np.s_[height - rows :, left : left + columns]
    covers = covers if kind == "gray" else covers[..., None]
    return image.at[place].set(jnp.where(covers, colour, image[place]))


@functools.cache
def _stamps(
    layers: tuple[Layer, ...], rows: int, columns: int, kind: ImageKind
) -> tuple[np.ndarray, np.ndarray]:
    """For a weapon at rest and one that fires: bool[2, rows, columns] and its colours there."""
    pictures = [_piled(layers), _piled((FLASH, *layers))]
    there, colours = (np.stack(parts) for parts in zip(*pictures, strict=True))
    row = ((np.arange(rows) + 0.5) * SIZE / rows).astype(int)[:, None]
    column = ((np.arange(columns) + 0.5) * SIZE / columns).astype(int)[None]
    there, colours = there[:, row, column], colours[:, row, column]
    if kind == "gray":
        words = pack_rgb(list(np.moveaxis(colours, -1, 0).astype(np.float32)), np.float32(1))
        colours = luma(words)
    return there, colours.astype(np.uint8)


def _piled(layers: tuple[Layer, ...]) -> tuple[np.ndarray, np.ndarray]:
    """bool[32, 32], where any of the pictures is; uint8[32, 32, 3], the topmost colours."""
    there, image = np.zeros((SIZE, SIZE), bool), np.zeros((SIZE, SIZE, 3), np.uint8)
    for art, colours in layers:
        shape, detail = planes_of(load_art(art))
        there |= shape
        for plane, colour in zip((shape, detail), colours, strict=True):
            image[plane] = colour
    return there, image
