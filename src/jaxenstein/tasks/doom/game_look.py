"""The game's own pictures on walls, floor, ceiling and things: `look="game"`.

Sampling and light follow ZDoom's software renderer (r_segs.cpp, r_plane.cpp, r_things.cpp): a wall
is sampled at the left and lower edge of a pixel, floor and ceiling at the right edge and the middle
row, with the light of the upper edge.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ...engine.shade import luma, pack_rgb
from ...engine.textures import (
    Flats,
    Sampling,
    Textures,
    append_bright,
    build_atlas,
    sides_of,
)
from ...errors import WadError, quoted
from .game_things import Look, Views, as_in_file, cutouts_of, read_views
from .game_walls import wall_materials, wall_rows
from .game_weapon import WeaponLook, read_stamps, stamps_of
from .maps import load_map, tiled
from .wad import Wad

# The narrowest screen of the game, and the screen from which smaller frames are sampled.
LEAST_WIDTH, SCREEN = 160, (240, 320)
# Rows from the edge of a pixel to its sample, so that a sample between two texels is in the lower
# one: the eye of a player who stands is at such a height.
NUDGE, LEAST_NUDGE = 2.0**-13, 2.0**-16
# `view.ROW_FOCAL_SHARE` of the game itself, whose aspect of 6 to 5 is a whole number of 65536ths.
GAME_FOCAL_SHARE = 78643 / 65536 * 2 / 3
# The colour that tints a frame in the tic of a pickup, and its share in 256ths.
GOLD, GOLD_SHARE = (215, 186, 69), 48


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
        thing=(0.5, low + LEAST_NUDGE),
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


class GamePictures(NamedTuple):
    """The pictures of a scenario, and the rows of them that each look has."""

    textures: Textures
    views: Views


@functools.cache
def game_pictures(
    path: str, map_name: str, looks: tuple[Look, ...], weapons: tuple[WeaponLook, ...], unit: int
) -> GamePictures:
    """The pictures of a scenario, from a WAD file.

    Args:
        path: the file.
        map_name: the name of the map.
        looks: of the things.
        weapons: the player's weapons, if they are shown.
        unit: map units a tile.

    Raises:
        WadError: the file is not a WAD file, is damaged, or lacks a picture.
    """
    wad, doom_map = Wad(path), load_map(map_name)
    tiles = tiled(doom_map, unit)
    papers = {name: _paper(wad, name) for name in {wall.texture for wall in doom_map.walls}}
    flats = {name: _plane(wad, name) for name in doom_map.flats}
    views = read_views(wad, looks)
    shown = [looks[number] for number in views.look]
    things = as_in_file(views.pictures)
    stamps = read_stamps(wad, weapons)
    floor, ceiling = doom_map.flats
    planes = [flats[ceiling], flats[floor]]
    widths, heights = sides_of(planes)
    colours = _colours(wad)

    def paint(picture: np.ndarray, shade: int) -> np.ndarray:
        return colours[shade][np.maximum(picture, 0)]

    count = len(doom_map.walls)
    # Pictures that are only shown in full light need no other shades.
    dark = {id(pixels) for pixels, look in zip(things, shown, strict=True) if not look.bright}
    walls = [papers[wall.texture] for wall in doom_map.walls]
    lit = [pixels for pixels in things if id(pixels) in dark]
    atlas, first = build_atlas([*walls, *planes, *lit], paint)
    bright = [pixels for pixels in things if id(pixels) not in dark]
    bright += [picture.pixels for picture in stamps]
    whole, last = append_bright(atlas, bright, paint)
    places = dict(zip(map(id, [*lit, *bright]), [*first[count + 2 :], *last], strict=True))
    first_of = np.array([places[id(pixels)] for pixels in things], np.int32)
    stamped = np.array([places[id(picture.pixels)] for picture in stamps], np.int32)
    cutouts = cutouts_of(shown, views.pictures, first_of, unit)
    textures = Textures(
        atlas=whole,
        walls=wall_materials(doom_map, tiles, first[:count], sides_of(walls)),
        of_wall=np.zeros(256, np.int32),
        of_face=wall_rows(doom_map, tiles),
        flats=Flats(
            first[count : count + 2],
            widths,
            heights,
            scale=np.full((2, 2), unit, np.float32),
            # The world's grid, in which x grows eastwards from 0, and rows southwards.
            origin=np.stack([tiles.west % widths, -tiles.north % heights], axis=1).astype(
                np.float32
            ),
        ),
        cutouts=cutouts,
        extra=len(whole) - len(atlas),
        stamps=stamps_of(stamps, stamped) if stamps else None,
        blends=None if cutouts.blend is None else _blends(wad),
    )
    return GamePictures(textures, views)


def _blends(wad: Wad) -> np.ndarray:
    """`Textures.blends`: the nearest colours of the palette, but for its first one."""
    levels = np.arange(32, dtype=np.int32)
    levels = levels << 3 | levels >> 2
    palette = wad.palette()[1:].astype(np.int32)
    found = []
    for red in levels:
        wanted = np.stack(np.meshgrid(red, levels, levels, indexing="ij"), axis=-1).reshape(-1, 3)
        apart = ((wanted[:, None] - palette[None]) ** 2).sum(axis=-1)
        found.append(palette[apart.argmin(axis=1)])
    channels = list(np.concatenate(found).T.astype(np.float32))
    return pack_rgb(channels, np.float32(1))


def _colours(wad: Wad) -> np.ndarray:
    """uint32[shades, 256]: the packed colour of each index of the palette under each light."""
    palette = np.moveaxis(wad.palette(), -1, 0).astype(np.float32)
    return pack_rgb(list(palette), np.float32(1))[wad.colormap()]


def _plane(wad: Wad, name: str) -> np.ndarray:
    """int[height, width]: a flat or, as in the game, a wall's texture on floor or ceiling."""
    return wad.flat(name) if name in wad.names("F") else _paper(wad, name)


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
