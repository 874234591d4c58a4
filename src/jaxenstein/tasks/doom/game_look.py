"""The game's own pictures on walls, floor, ceiling and things: `look="game"`.

Sampling and light follow ZDoom's software renderer (r_segs.cpp, r_plane.cpp, r_things.cpp): a wall
is sampled at the left and lower edge of a pixel, floor and ceiling at the right edge and the middle
row, with the light of the upper edge.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np

from ...engine.scene import Theme
from ...engine.shade import luma, pack_rgb
from ...engine.textures import (
    Cutouts,
    Flats,
    Materials,
    Sampling,
    Textures,
    build_atlas,
    pack_opaque,
    sides_of,
)
from ...errors import WadError, quoted
from .maps import DoomMap, Line, TileGrid, ends_of, load_map, rasterise, wall_faces
from .view import EYE
from .wad import Picture, Wad

# The narrowest screen of the game, and the screen from which smaller frames are sampled.
LEAST_WIDTH, SCREEN = 160, (240, 320)
# Rows from the edge of a pixel to its sample, so that a sample between two texels is in the lower
# one: the eye of a player who stands is at such a height.
NUDGE = 2.0**-13
# `view.ROW_FOCAL_SHARE` of the game itself, whose aspect of 6 to 5 is a whole number of 65536ths.
GAME_FOCAL_SHARE = 78643 / 65536 * 2 / 3
# The colour that tints a frame in the tic of a pickup, and its share in 256ths.
GOLD, GOLD_SHARE = (215, 186, 69), 48


@dataclass(frozen=True)
class Frame:
    """A picture of a thing: its letter, for how many tics it is shown, and if in full light.

    `height` is the height of the thing above the floor in map units.
    """

    letter: str = "A"
    tics: int = 1
    bright: bool = False
    height: int = 0


@dataclass(frozen=True)
class Animation:
    """The pictures that a thing shows in turn.

    Attributes:
        sprite: the four letters of its pictures' names.
        frames: its frames.
        start: the age at which the first frame begins, in tics.
        once: how many of the first frames are not repeated.
    """

    sprite: str
    frames: tuple[Frame, ...] = (Frame(),)
    start: int = 0
    once: int = 0

    @functools.cached_property
    def looks(self) -> tuple[Frame, ...]:
        """Its frames without their durations, each once."""
        return tuple(dict.fromkeys(replace(frame, tics=1) for frame in self.frames))

    def look_at(self, age: jax.Array) -> jax.Array:
        """int32[...]: the index in `looks` at an age int32[...] in tics."""
        looks = [self.looks.index(replace(frame, tics=1)) for frame in self.frames]
        tics = [frame.tics for frame in self.frames]
        first, every = sum(tics[: self.once]), sum(tics[self.once :])
        tic = age - self.start
        again = first + (tic - first) % every
        tic = jnp.where(tic < first, jnp.maximum(tic, 0), again) if first else again
        table = np.repeat(np.array(looks, np.int32), tics)
        return jnp.asarray(table).at[tic].get(mode="promise_in_bounds")


def falling(*frames: Frame) -> tuple[Frame, ...]:
    """The frames in the tics in which a thing falls from the height at which scripts make it.

    Gravity adds a map unit per tic to its speed, as in the game.
    """
    heights = [20, 19, 17, 14, 10, 5]
    return tuple(replace(frame, height=z) for frame, z in zip(frames, heights, strict=True))


_BOTTLE = [Frame(letter) for letter in "ABCDCB" for _ in range(6)]
# A thing that a script made: its age is 0 in the first tic that shows it, the second of its frame.
_MEDKIT = Animation("MEDI", (*falling(*[Frame()] * 6), Frame()), once=6)
ANIMATIONS = {
    "GreenArmor": Animation("ARM1", (Frame("A", 6), Frame("B", 7, bright=True)), start=11),
    "Medikit": _MEDKIT,
    "CustomMedikit": _MEDKIT,
    "Poison": Animation("BON1", (*falling(*_BOTTLE[1:7]), *_BOTTLE[7:], *_BOTTLE[:7]), once=6),
}
"""The pictures of things, by the game's names."""


def rows_at(animations: Sequence[Animation], age: jax.Array, picture: jax.Array) -> jax.Array:
    """int32[N]: rows of the tables of `with_looks`.

    Args:
        animations: of the things.
        age: int32[N], tics since each appeared or, if it always was there, since the game began.
        picture: int32[N], numbers of animations.
    """
    row, first = jnp.zeros_like(picture), 0
    for number, one in enumerate(animations):
        row = jnp.where(picture == number, first + one.look_at(age), row)
        first += len(one.looks)
    return row


def with_looks(theme: Theme, animations: Sequence[Animation]) -> Theme:
    """A theme with a row of the tables of billboards for each of `Animation.looks`."""
    rows = np.repeat(np.arange(len(animations)), [len(one.looks) for one in animations])
    names = "sprite_art", "sprite_colours", "sprite_radius", "sprite_drop", "sprite_labels"
    return theme.replace(**{name: getattr(theme, name)[rows] for name in names})


def screen_of(height: int, width: int, samples: int = 1) -> tuple[int, int]:
    """Rows and columns of the screen of the game from which a frame takes its pixels."""
    same = 4 * height == 3 * width and width >= LEAST_WIDTH and samples == 1
    return (height, width) if same else SCREEN


def sampling(height: int, width: int, samples: int = 1) -> Sampling:
    """The points at which the game samples the pixels of a frame.

    Args:
        height: image rows.
        width: image columns.
        samples: pixels of the screen, side by side, for each pixel of the frame.
    """
    rows, screen = screen_of(height, width, samples)
    down, across = 0.5 * height / rows, 0.5 * samples * width / screen
    low = 0.5 + down
    return Sampling(
        wall=(0.5 - across, low + NUDGE),
        plane=(0.5 + across, 0.5),
        thing=(0.5, low),
        light_row=0.5 - down,
        samples=samples,
        screen=screen,
    )


def gilded(image: jax.Array, shines: jax.Array) -> jax.Array:
    """An image in colour or grey with a tint of gold if bool[] `shines`, as after a pickup."""
    tone = np.array(GOLD, np.int32)[None, None]
    if image.ndim == 2:
        tone = luma(pack_rgb([np.float32(part) for part in GOLD], np.float32(1))).astype(np.int32)
    mixed = (image.astype(jnp.int32) * (256 - GOLD_SHARE) + tone * GOLD_SHARE) >> 8
    return jnp.where(shines, mixed.astype(jnp.uint8), image)


@functools.cache
def game_textures(
    path: str, map_name: str, animations: tuple[Animation, ...], unit: int
) -> Textures:
    """The pictures of a scenario, from a WAD file.

    Args:
        path: the file.
        map_name: the name of the map.
        animations: of the things.
        unit: map units a tile.

    Raises:
        WadError: the file is not a WAD file, is damaged, or lacks a picture.
    """
    wad, doom_map = Wad(path), load_map(map_name)
    tiles = rasterise(doom_map, unit)
    papers = {name: _paper(wad, name) for name in tiles.textures}
    flats = {name: wad.flat(name) for name in doom_map.flats}
    looks = [(one.sprite, look) for one in animations for look in one.looks]
    names = [(sprite, look.letter) for sprite, look in looks]
    # Looks with the same letter have one picture, of which the atlas holds one.
    things = {name: wad.sprite(*name)[0] for name in names}
    centred = {name: _centred(picture) for name, picture in things.items()}
    pixels = {name: np.maximum(picture, 0) for name, picture in centred.items()}
    floor, ceiling = doom_map.flats
    planes = [flats[ceiling], flats[floor]]
    colours = _colours(wad)
    atlas, first = build_atlas(
        [
            *(papers[wall.texture] for wall in doom_map.walls),
            *planes,
            *(pixels[name] for name in names),
        ],
        lambda picture, shade: colours[shade][picture],
    )
    count = len(doom_map.walls)
    begin = np.array([_begin(wall, tiles) for wall in doom_map.walls], np.int32)
    offset = np.array([wall.offset for wall in doom_map.walls], np.int32)
    return Textures(
        atlas=atlas,
        walls=Materials(
            first[:count],
            *sides_of([papers[wall.texture] for wall in doom_map.walls]),
            across=np.full(count, unit, np.int32),
            down=np.full(count, unit, np.float32),
            offset=offset - begin,
            begin=begin,
            length=np.abs(np.diff(ends_of(doom_map.walls), axis=1)).sum(
                axis=(1, 2), dtype=np.int32
            ),
        ),
        of_wall=np.zeros(256, np.int32),
        of_face=_of_face(doom_map, tiles),
        flats=Flats(
            first[count : count + 2],
            *sides_of(planes),
            scale=np.full((2, 2), unit, np.float32),
            # The world's grid, in which x grows eastwards from 0, and rows southwards.
            origin=np.array([(tiles.west % 64, -tiles.north % 64)] * 2, np.float32),
        ),
        cutouts=_cutouts(
            [things[name] for name in names],
            [centred[name] for name in names],
            [look for _, look in looks],
            first[count + 2 :],
            unit,
        ),
    )


def _colours(wad: Wad) -> np.ndarray:
    """uint32[shades, 256]: the packed colour of each index of the palette under each light."""
    palette = np.moveaxis(wad.palette(), -1, 0).astype(np.float32)
    return pack_rgb(list(palette), np.float32(1))[wad.colormap()]


def _paper(wad: Wad, name: str) -> np.ndarray:
    """int16[height, width]: a wall's texture, with sides that are powers of two."""
    texture = np.maximum(wad.texture(name), 0)
    height, width = texture.shape
    if height & (height - 1) or width & (width - 1):
        raise WadError(
            f"{wad.path}: texture {quoted(name)} is {width} by {height} pixels; sides must be "
            "powers of two"
        )
    return texture


def _of_face(doom_map: DoomMap, tiles: TileGrid) -> np.ndarray:
    """int32[4, rows, columns]: the index of the wall on each face."""
    of_face = np.zeros(tiles.faces.shape, np.int32)
    for number, wall in enumerate(doom_map.walls):
        of_face[wall_faces(wall, tiles.west, tiles.north, tiles.unit)] = number
    return of_face


def _begin(wall: Line, tiles: TileGrid) -> int:
    """Where a wall begins, in map units to the viewer's right from the edge of the map's tiles."""
    x, y = wall.x0 - tiles.west, tiles.north - wall.y0
    if wall.x0 == wall.x1:
        return -y if wall.y1 > wall.y0 else y
    return x if wall.x1 > wall.x0 else -x


def _centred(picture: Picture) -> np.ndarray:
    """int16[height, width]: a picture with the thing's position in its middle."""
    left, right = _margins(picture)
    return np.pad(picture.pixels, ((0, 0), (left, right)), constant_values=-1)


def _margins(picture: Picture) -> tuple[int, int]:
    """How many empty columns at its left and right side centre a picture."""
    beyond = 2 * picture.left - picture.pixels.shape[1]
    return max(0, -beyond), max(0, beyond)


def _cutouts(
    things: list[Picture],
    centred: list[np.ndarray],
    looks: list[Frame],
    first: np.ndarray,
    unit: int,
) -> Cutouts:
    column, opaque = pack_opaque([pixels >= 0 for pixels in centred])
    widths, heights = sides_of(centred)
    top = np.array(
        [EYE - look.height - thing.top for look, thing in zip(looks, things, strict=True)]
    )
    margins = np.array([_margins(picture) for picture in things], np.int32)
    return Cutouts(
        first,
        widths,
        heights,
        half_width=(widths / (2 * unit)).astype(np.float32),
        top=(top / unit).astype(np.float32),
        bottom=((top + heights) / unit).astype(np.float32),
        bright=np.array([look.bright for look in looks]),
        column=column,
        opaque=opaque,
        left=margins[:, 0],
        right=widths - margins[:, 1],
    )
